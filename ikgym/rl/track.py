"""The work of the wrappers of the environments by id, on N rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from ikgym.exceptions import InvalidInputError
from ikgym.rl.stages import Rows, Stage, Told
from ikgym.rl.track_kernels import MOST, distance_rewards, track_rows
from ikgym.rl.twists import twist_size
from ikgym.rl.view import own_space
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray, flag, number

#: Error in [m] below which an agent gains little more: Δx of the cost.
UNIT = 1e-3
#: Steps that count as 1 in ages of measurements.
OLDEST = 10.0


class TrackStage(Stage):
    """See :class:`ikgym.rl.TrackObservation`."""

    def __init__(self, env: Any, radian: float, coarse: float, fine: float, context: bool = False) -> None:
        space, scenario = own_space(env), env.unwrapped.scenario
        sizes = {"radian": radian, "coarse": coarse, "fine": fine}
        scales = tuple(number(name, size, above=0.0) for name, size in sizes.items())
        home, half = middle(scenario)
        self._fastest = scenario.largest_qdot
        self._command = scenario.task.kind, scenario.model.chain, scales, home, half, self._fastest
        self._more = [key for key in ("q_age", "pose_age", "commands") if key in space.spaces]
        self._own = 2 * (scenario.joints + len(env.unwrapped.preview) * int(twist_size(scenario.task.kind)))
        added = spaces.flatdim(spaces.Dict({key: space[key] for key in self._more}))
        self._env, self._shown = env.unwrapped, flag("context", context)
        if context and not scenario.plant.context:
            raise InvalidInputError(f"context: expected a plant with numbers drawn from ranges, got {scenario.plant}.")
        self._context = self._contexts()
        self.observation_space = spaces.Box(-MOST, MOST, (self._own + added + self._context.shape[1],), np.float32)

    def observation(self, observation: Any, begun: BoolArray) -> Any:
        """The features. Shape (N, f)."""
        del begun
        self._context = self._contexts()
        return self._features(observation, self._context)

    def _contexts(self) -> FloatArray:
        """What is shown of the contexts of all rows. Shape (N, c) or (N, 0)."""
        context = np.atleast_2d(self._env.context)
        return context.copy() if self._shown else context[:, :0]

    def _features(self, observation: Any, context: FloatArray) -> Any:
        rows = len(observation["q"])
        out = np.empty((rows, self._own))
        track_rows(*self._command, *(observation[key] for key in ("q", "qdot", "pose", "nominal")), out)
        parts = [out, *(self._scaled(key, observation[key]).reshape(rows, -1) for key in self._more)]
        return np.concatenate([*parts, context], axis=1).astype(np.float32)

    def last_observations(self, rows: Rows, observations: Sequence[Any]) -> Sequence[Any]:
        """The features of these rows. Shapes (f,)."""
        together = {key: np.array([one[key] for one in observations]) for key in observations[0]}
        return list(self._features(together, self._context[rows]))  # those of the episodes that have ended

    def _scaled(self, key: str, value: FloatArray) -> FloatArray:
        """Past commands as shares of the largest joint velocities, ages in units of ten steps."""
        scaled: FloatArray = np.clip(value / (self._fastest if key == "commands" else OLDEST), -MOST, MOST)
        return scaled


class ShareStage(Stage):
    """See :class:`ikgym.rl.ShareAction`."""

    def __init__(self, env: Any, share: float = 1.0) -> None:
        scenario = env.unwrapped.scenario
        self._fraction = number("share", share, above=0.0) * scenario.largest_qdot / scenario.velocity_limit
        self.action_space = spaces.Box(-1.0, 1.0, self._fraction.shape, np.float32)

    def action(self, actions: FloatArray) -> FloatArray:
        """Fractions of the scenario's velocity limit."""
        fractions: FloatArray = actions * self._fraction
        return fractions


class DistanceStage(Stage):
    """See :class:`ikgym.rl.DistanceReward`."""

    def __init__(self, env: Any, radian: float = 1.0, zero: float = 0.1) -> None:
        self._scales = number("radian", radian, at_least=0.0), UNIT, number("zero", zero, above=0.0)
        self._oriented = env.unwrapped.scenario.task.has_orientation

    def reward(self, rewards: FloatArray, told: Told) -> FloatArray:
        """Rewards 1 − log(1 + (d / 1 mm)² + Φ^U) / log(1 + (D / 1 mm)²)."""
        out, position = np.empty(len(rewards)), told("position_error")
        orientation = told("orientation_error") if self._oriented else np.zeros(len(rewards))
        distance_rewards(self._scales, position, orientation, told("velocity_cost"), out)
        return out


def middle(scenario: Scenario) -> tuple[FloatArray, FloatArray]:
    """Home of an arm, and half of the range of its joints, in [rad] or [m]. Shapes (n,).

    Raises:
        InvalidInputError: The arm has no home, or a joint has no limits.
    """
    arm = scenario.model
    half = 0.5 * (arm.upper - arm.lower)
    if arm.home is None or not np.isfinite(half).all():
        raise InvalidInputError(f"env: expected an arm with a home and limits of all joints, got {arm.name!r}.")
    return np.array(arm.home), half  # writable, as all that a kernel is compiled for
