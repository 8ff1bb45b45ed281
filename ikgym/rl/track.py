"""The work of the wrappers of the environments by id, on N rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.rl.stages import Rows, Stage, Told
from ikgym.rl.track_kernels import MOST, distance_rewards, track_rows
from ikgym.rl.twists import twist_size
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray, flag, float_array, number, shortened

#: Error in [m] below which an agent gains little more: Δx of the cost.
UNIT = 1e-3
#: Steps that count as 1 in ages of measurements.
OLDEST = 10.0


class TrackStage(Stage):
    """See :class:`ikgym.rl.TrackObservation`."""

    def __init__(
        self, env: Any, radian: float = 1.0, coarse: float = 0.03, fine: float = 0.01, context: bool = False
    ) -> None:
        space, scenario = own_space(env), env.unwrapped.scenario
        sizes = {"radian": radian, "coarse": coarse, "fine": fine}
        scales = tuple(number(name, size, above=0.0) for name, size in sizes.items())
        self._fastest = scenario.largest_qdot
        self._command = scenario.task.kind, scenario.model.chain, scales, *middle(scenario.model), self._fastest
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
        scenario = env.unwrapped.scenario
        self._oriented, self._near = scenario.task.has_orientation, scenario.proximity is not None

    def reward(self, rewards: FloatArray, told: Told) -> FloatArray:
        """Rewards 1 − log(1 + (d / 1 mm)² + Φ^U + Φ^C) / log(1 + (D / 1 mm)²)."""
        out, position = np.empty(len(rewards)), told("position_error")
        orientation = told("orientation_error") if self._oriented else np.zeros(len(rewards))
        others = told("velocity_cost") + told("proximity_cost") if self._near else told("velocity_cost")
        distance_rewards(self._scales, position, orientation, others, out)
        return out


def steps_ahead(ahead: Sequence[float], dt: float) -> tuple[int, ...]:
    """Times ahead in [s] as steps, at least one each; times that fall on the same step are shown once."""
    times = float_array("ahead", ahead)
    if times.ndim != 1 or not times.size or (np.diff(times, prepend=0.0) <= 0.0).any():
        raise InvalidInputError(f"ahead: expected rising times above 0 in [s], got {shortened(ahead)}.")
    return tuple(dict.fromkeys(max(1, round(time / dt)) for time in times.tolist()))


def middle(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Where joints are seen from, in [rad] or [m], and the unit of their coordinates. Shapes (n,).

    Home, or the middle of the range where there is no home, and 0 without a range. The unit is 1 rad; for a prismatic
    joint half of its range, 1 m without a range.
    """
    limited = np.isfinite(arm.upper - arm.lower)
    lower, upper = (np.where(limited, limit, 0.0) for limit in (arm.lower, arm.upper))
    units = np.where(limited & np.array(arm.prismatic), 0.5 * (upper - lower), 1.0)
    home = np.clip(0.5 * (lower + upper), arm.lower, arm.upper) if arm.home is None else np.array(arm.home)
    return home, units


def own_space(env: Any) -> spaces.Dict:
    """The observation space of one row of an environment of this package."""
    if not isinstance(getattr(env.unwrapped, "scenario", None), Scenario):
        raise InvalidInputError(f"env: expected an environment RedundantIK-v0, single or vector, got {env}.")
    name = "single_observation_space" if hasattr(env, "single_observation_space") else "observation_space"
    space, own = getattr(env, name), getattr(env.unwrapped, name)
    if space != own:
        got = f"a {type(space).__name__} of shape {space.shape}"
        raise InvalidInputError(f"env: expected its own observation, wrapped by nothing that changes it, got {got}.")
    found: spaces.Dict = own
    return found
