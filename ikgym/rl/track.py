"""Observation, action and reward of a learner, on N rows; a single environment is one row."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.rl.task import Task
from ikgym.rl.track_kernels import MOST, track_rows
from ikgym.rl.twists import twist_size
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray, shorten

#: Error in [m] that costs 1: Δx of the cost.
UNIT = 1e-3
#: λ of the damped inverse Jacobian that is shown, as of `dls`.
DAMPING = 1e-3
#: Steps that count as 1 in ages of measurements.
OLDEST = 10.0
#: Observations of N rows, or of one without a row axis.
Features = npt.NDArray[np.float32]


class Learner:
    """The work of a learning task on N rows.

    Args:
        task: Its parameters.
        scenario: Its scenario.
        preview: Steps ahead at which the reference is shown.
        space: The observation space of one row of the environment.
        rows: N, or None for one arm whose actions have no row axis.

    Attributes:
        observation_space: Space of one row's observation.
        action_space: Space of one row's action.
    """

    def __init__(
        self, task: Task, scenario: Scenario, preview: Sequence[int], space: Any, rows: int | None = None
    ) -> None:
        kind, self._fastest = scenario.task.kind, scenario.largest_qdot
        scales = task.radian, task.coarse, task.fine
        self._command = kind, scenario.model.chain, scales, *joint_scales(scenario.model), self._fastest
        self._more = [key for key in ("q_age", "pose_age", "commands") if key in space.spaces]
        self._size = 2 * (scenario.joints + len(preview) * int(twist_size(kind)))
        self._scenario, self._ahead = scenario, preview if task.inverse else ()
        self._contexts = len(scenario.plant.context) if task.context else 0
        size = (
            self._size
            + len(self._ahead) * scenario.joints
            + spaces.flatdim(spaces.Dict({key: space[key] for key in self._more}))
            + self._contexts
        )
        self.observation_space = spaces.Box(-MOST, MOST, (task.history * size,), np.float32)
        self._history, self._context = np.zeros((rows or 1, task.history, size), np.float32), np.zeros((rows or 1, 0))
        self._fraction = task.share * self._fastest / scenario.velocity_limit
        self.action_space = spaces.Box(-1.0, 1.0, self._fraction.shape, np.float32)
        self._shape = self._fraction.shape if rows is None else (rows, scenario.joints)
        self._task, self._from = task, scenario.steps - (task.counted or scenario.steps)
        self._first = slice(2 * scenario.joints, 2 * scenario.joints + twist_size(kind))  # features of the first error
        self._closeness = np.zeros(rows or 1)  # before the step, from 0 to 1

    def reset(self, seen: dict[str, FloatArray], context: FloatArray, begun: BoolArray) -> Features:
        """The observations after a reset; where no episode has begun, they are those of the last step.

        Args:
            seen: The observation of the environment.
            context: The contexts of the rows' episodes. Shape (N, c).
            begun: Rows whose episodes have begun. Shape (N,).
        """
        self._context = context[:, : self._contexts].copy()
        return self._show(self._features(seen, self._context), begun)

    def observe(self, seen: dict[str, FloatArray], context: FloatArray, begun: BoolArray) -> Features:
        """The observations after a step; for the arguments see :meth:`reset`."""
        self._context = context[:, : self._contexts].copy()
        features = self._features(seen, self._context)
        self._history = np.concatenate([features[:, None], self._history[:, :-1]], axis=1)
        return self._show(features, begun)

    def last_observations(self, rows: npt.NDArray[np.int64], seen: Sequence[dict[str, FloatArray]]) -> list[Features]:
        """The last observations of k rows whose next episodes have begun in the same step.

        Args:
            rows: Their numbers. Shape (k,).
            seen: The observation of each in the environment.
        """
        together = {key: np.array([one[key] for one in seen]) for key in seen[0]}
        features = self._features(together, self._context[rows])  # those of the episodes that have ended
        return list(np.concatenate([features, self._history[rows, :-1].reshape(len(rows), -1)], axis=1))

    def actions(self, actions: npt.ArrayLike) -> FloatArray:
        """Actions as the environment's fractions of the velocity limit.

        Raises:
            InvalidInputError: They are no numbers of the shape (n,), for N arms (N, n).
        """
        raw = np.asarray(actions)
        if raw.dtype.kind not in "fiub" or raw.shape != self._shape:
            raise InvalidInputError(f"action: expected numbers of shape {self._shape}, got {shorten(actions)}.")
        fractions: FloatArray = np.clip(raw.astype(np.float64), -1.0, 1.0) * self._fraction
        return fractions

    def rewards(self, cost: FloatArray, before: npt.ArrayLike) -> FloatArray:
        """Rewards of steps.

        Args:
            cost: Their stage costs. Shape (N,).
            before: Steps that the episodes had before. Shape (N,) or ().
        """
        closeness = cost_rewards(self._task, cost)
        rewards = np.where(np.asarray(before) < self._from, 0.0, closeness)
        if self._task.progress:
            rewards += self._task.progress * (closeness - self._closeness)
            self._closeness = closeness
        return rewards

    def _show(self, features: Features, begun: BoolArray) -> Features:
        if self._task.progress:
            twist = features[begun, self._first].astype(np.float64) * (self._task.coarse / UNIT)
            self._closeness[begun] = cost_rewards(self._task, (twist * twist).sum(axis=1))
        self._history[begun] = features[begun, None]
        return self._history.reshape(len(self._history), -1).copy()

    def _features(self, seen: dict[str, FloatArray], context: FloatArray) -> Features:
        """The observations of the moment. Shape (N, f)."""
        rows = len(context)
        model = np.empty((rows, self._size))
        track_rows(*self._command, *(seen[key] for key in ("q", "qdot", "pose", "nominal")), model)
        more = [self._scale(key, seen[key]).reshape(rows, -1) for key in self._more]
        return np.concatenate([model, *self._inverse(seen), *more, context], axis=1).astype(np.float32)

    def _inverse(self, seen: dict[str, FloatArray]) -> list[FloatArray]:
        """Joint velocities that reach each reference in time, as shares of the largest. Shapes (N, n)."""
        if not self._ahead:
            return []
        arm, task, q = self._scenario.model, self._scenario.task, seen["q"]
        jacobian = task.jacobian(arm.forward(q)[0], arm.jacobian(q))
        transposed = np.swapaxes(jacobian, 1, 2)
        gram, out = jacobian @ transposed + DAMPING * np.eye(task.error_size), []
        for i, steps in enumerate(self._ahead):
            error = task.error(seen["nominal"][:, i], seen["pose"])[..., None]
            shift = (transposed @ np.linalg.solve(gram, error))[..., 0]
            out.append(np.clip(shift / (steps * self._scenario.dt * self._fastest), -MOST, MOST))
        return out

    def _scale(self, key: str, value: FloatArray) -> FloatArray:
        """Past commands as shares of the largest joint velocities, ages in units of ten steps."""
        scaled: FloatArray = np.clip(value / (self._fastest if key == "commands" else OLDEST), -MOST, MOST)
        return scaled


def cost_rewards(task: Task, cost: FloatArray) -> FloatArray:
    """Rewards 1 / (1 + (√c · 1 mm / h)^k) of stage costs c, see :class:`ikgym.rl.Task`. Shapes (...)."""
    rewards: FloatArray = 1.0 / (1.0 + (np.sqrt(cost) * (UNIT / task.half)) ** task.steepness)
    return rewards


def joint_scales(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Where joints are seen from, in [rad] or [m], and the unit of their coordinates. Shapes (n,).

    Home, or the middle of the range where there is no home, and 0 without a range. The unit is 1 rad; for a prismatic
    joint half of its range, 1 m without a range.
    """
    limited = np.isfinite(arm.upper - arm.lower)
    lower, upper = (np.where(limited, limit, 0.0) for limit in (arm.lower, arm.upper))
    units = np.where(limited & np.array(arm.prismatic), 0.5 * (upper - lower), 1.0)
    home = np.clip(0.5 * (lower + upper), arm.lower, arm.upper) if arm.home is None else np.array(arm.home)
    return home, units
