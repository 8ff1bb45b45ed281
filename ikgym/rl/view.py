"""What agents see of N arms, and the unit that their velocities are measured in: what all wrappers share."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt
from gymnasium import spaces

from ikgym import task_kernels
from ikgym.exceptions import InvalidInputError
from ikgym.outcome import Observation
from ikgym.rl.feature_kernels import CONTEXT, FASTEST, MOST, jacobian_rows, observe_rows, unit_rows
from ikgym.rl.twists import is_turned, shown_joints, twist_size
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, number

Features = npt.NDArray[np.float32]

#: Where |v̂| is cut.
FURTHEST = 20.0
#: Ages of measurements are seen as a share of so many steps.
OLDEST = 100.0
#: The logarithm of a speed is not beyond.
LARGEST_LOG = 30.0


class AgentView:
    """Features and units of N arms of a scenario.

    Args:
        env: The environment, single or vector, for its scenario and its preview.
        furthest: Where |v̂| is cut, above 0.
        jacobian: Whether the Jacobian is seen.

    Raises:
        InvalidInputError: The environment is another, its observation has been changed, it shows less than two
            reference poses, `furthest` is out of its range, or there is no Jacobian of skew coordinates to be seen.
    """

    def __init__(self, env: Any, furthest: float, jacobian: bool = False) -> None:
        space = _own_space(env)
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
        self._size, self._jacobian = len(bounds[0][0]), 0
        if jacobian:
            most = _jacobian_bound(scenario)
            lower, upper, self._jacobian = np.append(lower, -most), np.append(upper, most), len(most)
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
        if self._jacobian:
            jacobian = np.empty((rows, self._jacobian))
            jacobian_rows(self._kind, self._chain, np.ascontiguousarray(observation["q"]), jacobian)
            out[:, at:] = jacobian
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


def _own_space(env: Any) -> spaces.Dict:
    """The space of what an environment of this package shows, of one row."""
    if not isinstance(getattr(env.unwrapped, "scenario", None), Scenario):
        raise InvalidInputError(f"env: expected an environment RedundantIK-v0, single or vector, got {env}.")
    name = "single_observation_space" if hasattr(env, "single_observation_space") else "observation_space"
    space, own = getattr(env, name), getattr(env.unwrapped, name)
    if space != own:
        raise InvalidInputError(f"env: expected its own observation, wrapped by nothing that changes it, got {space}.")
    found: spaces.Dict = own
    return found


def bound(scenario: Scenario, shown: int) -> tuple[FloatArray, FloatArray]:
    """Lower and upper bounds of the features, whatever happens, in the order of :class:`ikgym.rl.AgentObservation`.

    Args:
        scenario: What is tracked.
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


def _jacobian_bound(scenario: Scenario) -> FloatArray:
    """Bounds of the Jacobian, row by row: no point is further from a joint than the arm is long.

    Raises:
        InvalidInputError: The task has skew coordinates.
    """
    kind, chain, n = scenario.task.kind, scenario.model.chain, scenario.joints
    if kind == task_kernels.SKEW:
        raise InvalidInputError("jacobian: expected False for skew coordinates, whose errors are no twists, got True.")
    lengths = np.linalg.norm(np.vstack([chain.offsets, chain.tool]), axis=1)
    reach = lengths.sum() + np.abs(scenario.joint_bound())[chain.prismatic].sum()
    linear = np.where(chain.prismatic, 1.0, reach)
    return np.concatenate([np.tile(linear, 3), np.ones((int(twist_size(kind)) - 3) * n)])


def due_size(space: spaces.Box) -> int:
    """w, of the twist that such features begin with; the share after it is the first of them that is not negative."""
    return int(np.argmax(space.low == 0.0))
