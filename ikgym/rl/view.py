"""Features of N arms for learning agents, and the unit of their velocities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import Observation
from ikgym.rl.feature_kernels import CONTEXT, FASTEST, MOST, observe_rows, unit_rows
from ikgym.rl.twists import is_turned, shown_joints, twist_size
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, number

Features = npt.NDArray[np.float32]

#: Default bound of |v̂|.
FURTHEST = 20.0
#: Ages of measurements are shown as a share of so many steps.
OLDEST = 100.0
#: Bound of the logarithm of a speed.
LARGEST_LOG = 30.0


class AgentView:
    """Features and units of N arms of a scenario.

    Args:
        env: The environment, single or vector, for its scenario and its preview.
        furthest: Bound of |v̂|, above 0.

    Raises:
        InvalidInputError: The environment is another, its observation has been changed, it shows less than two
            reference poses, or `furthest` is out of its range.
    """

    def __init__(self, env: Any, furthest: float) -> None:
        space = own_space(env)
        scenario, preview = env.unwrapped.scenario, env.unwrapped.preview
        if len(preview) < 2:
            raise InvalidInputError(f"preview: expected at least two steps ahead, got {preview}.")
        self.furthest = number("furthest", furthest, above=0.0)
        offsets = np.array(preview, dtype=np.int64)
        self._kind, self._chain = scenario.task.kind, scenario.model.chain
        self._ahead = scenario.dt, offsets, self.furthest
        self._more = [key for key in ("q_age", "pose_age", "commands") if key in space.spaces]
        bounds = [bound(scenario, len(preview)), *(self._bound(key, space[key]) for key in self._more)]
        lower, upper = np.concatenate([low for low, _ in bounds]), np.concatenate([high for _, high in bounds])
        self._size = len(bounds[0][0])
        self.space = spaces.Box(lower.astype(np.float32), upper.astype(np.float32), dtype=np.float32)

    def see(self, observation: Observation) -> Features:
        """The features of N arms. Shape (N, f)."""
        rows = len(observation["q"])
        out, unit = np.empty((rows, *self.space.shape), dtype=np.float32), np.empty(rows)
        features = np.empty((rows, self._size), dtype=np.float32)
        keys = ("q", "qdot", "pose", "nominal", "remaining")
        observe_rows(self._kind, self._chain, *self._ahead, *(observation[key] for key in keys), features, unit)
        out[:, : self._size], at = features, self._size
        for key in self._more:
            part = observation[key].reshape(rows, -1)
            scale = unit[:, None] if key == "commands" else OLDEST
            limit = FASTEST if key == "commands" else 1.0
            out[:, at : at + part.shape[1]] = np.clip(part / scale, -limit, limit)
            at += part.shape[1]
        return out

    def unit(self, observation: Observation) -> FloatArray:
        """S (0.2 + |v̂|) of N arms, in [rad/s] or [m/s]. Shape (N,)."""
        out = np.empty(len(observation["q"]))
        unit_rows(self._kind, *self._ahead, observation["pose"], observation["nominal"], out)
        return out

    @staticmethod
    def _bound(key: str, space: Any) -> tuple[FloatArray, FloatArray]:
        limit = np.ones(math.prod(space.shape))
        return (-FASTEST * limit, FASTEST * limit) if key == "commands" else (0.0 * limit, limit)


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


def bound(scenario: Scenario, shown: int) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds of the features, in the order of :class:`ikgym.rl.AgentObservation`.

    Args:
        scenario: The tracking problem.
        shown: p, the number of steps ahead that are shown.
    """
    kind, prismatic = scenario.task.kind, scenario.model.chain.prismatic
    w, joints = int(twist_size(kind)), np.ones(int(shown_joints(kind, prismatic)))
    at = 0
    for j in range(1 if is_turned(kind, prismatic) else 0, scenario.joints):
        if prismatic[j]:
            joints[at] = scenario.joint_bound()[j]
        at += 1 if prismatic[j] else 2
    # Each part of the mean twists is at most the root of their number times their root mean square, which is below s.
    ahead = np.full((shown - 1) * w, math.sqrt((shown - 1) * w))
    n = scenario.joints
    moving = np.concatenate([np.full(w // 3 * n, MOST), np.full(n, FASTEST)])
    context = CONTEXT * np.concatenate([joints, ahead, [LARGEST_LOG, 1.0]])
    upper = np.concatenate([np.ones(w + 1), moving, context])
    lower = -upper
    lower[w] = lower[-1] = 0.0
    return lower, upper
