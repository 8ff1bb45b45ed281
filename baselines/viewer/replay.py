"""Episodes to be shown: joint motion, errors and costs of each policy, and the path of the reference."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from tqdm import tqdm

import baselines
from baselines.viewer.approach import Pose
from ikgym import scenarios
from ikgym.arms import Arm
from ikgym.arms.inverse import LENGTH_OF_RADIAN
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.simulator import Simulator
from ikgym.validation import FloatArray, whole_number

# Speed of the reference if the scenario's own stands still, in lengths of the arm per second.
SLOW = 0.1


def size(arm: Arm) -> float:
    """The length in [m] that the picture of an arm is scaled by: its reach, 1 if it has none."""
    return arm.reach(np.zeros(arm.joints)) or 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class Replay:
    """One episode of one policy; row 0 is the start, row k the state after step k.

    Args:
        policy: The name of the policy.
        times: In [s]. Shape (steps + 1,).
        q: True joint coordinates in [rad] or [m]. Shape (steps + 1, n).
        position_error: In [m]. Shape (steps + 1,).
        orientation_error: In [rad], NaN where the task has no orientation. Shape (steps + 1,).
        cost: Accumulated cost. Shape (steps + 1,).
        statuses: Values of :class:`baselines.Status`; row 0 repeats the first step. Shape (steps + 1,).
    """

    policy: str
    times: FloatArray
    q: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    cost: FloatArray
    statuses: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Stage:
    """An episode that policies are shown in.

    Args:
        scenario: The scenario, cut to the steps that are shown.
        seed: The reset seed.
        start: Joint coordinates at the start, in [rad] or [m]. Shape (n,).
        rotations: Orientations of the reference; those of the tool at the start if the task has none.
            Shape (steps + 1, 3, 3).
        path: Positions of the reference in [m]. Shape (steps + 1, 3).
        errors: Errors of position in [m] and of orientation in [rad] at the start.
        pace: Largest motion of the reference in one step towards a dragged target: in [m] the mean of the scenario's
            own reference, in [rad] the angle that :meth:`ikgym.arms.Arm.inverse` weighs equally.
    """

    scenario: Scenario
    seed: int
    start: FloatArray
    rotations: FloatArray
    path: FloatArray
    errors: tuple[float, float]
    pace: tuple[float, float]

    @classmethod
    def of(cls, scenario: str | Scenario, seed: int = 0, steps: int | None = None) -> Stage:
        """An episode of a scenario.

        Args:
            scenario: As :func:`ikgym.scenarios.find` takes it.
            seed: The reset seed.
            steps: Most steps; the scenario's own if left out.

        Raises:
            UnknownNameError: There is no such scenario.
            InvalidInputError: The seed or the number of steps is not valid.
        """
        whole = found = scenarios.find(scenario)
        if steps is not None:
            found = found.replace(steps=min(whole_number("steps", steps, at_least=1), found.steps))
        simulator = Simulator(found, None, 1)
        generator = seeding.np_random(whole_number("seed", seed, at_least=0))[0]
        simulator.reset(np.ones(1, dtype=np.bool_), [generator])
        out = simulator.observe()
        errors = float(out.position_error[0]), float(out.orientation_error[0])
        start, pace = simulator.true_q[0].copy(), _pace(whole, seed)
        return cls(found, seed, start, _rotations(found, seed, start), simulator.nominal_positions(0), errors, pace)

    def pose(self, step: int) -> Pose:
        """The pose of the reference after a number of steps."""
        return Pose(self.rotations[step], self.path[step])


def _pace(scenario: Scenario, seed: int) -> tuple[float, float]:
    """See :class:`Stage`."""
    whole, points = size(scenario.arm), scenario.points()
    path = scenario.frames(scenario.episode(seed), int(points[-1]) + 1)[points, -3:]
    shift = float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum()) / scenario.steps
    shift = shift or SLOW * whole * scenario.dt
    return shift, shift / (LENGTH_OF_RADIAN * whole)


def _rotations(scenario: Scenario, seed: int, start: FloatArray) -> FloatArray:
    points = scenario.points()
    if not scenario.task.has_orientation:
        return np.broadcast_to(scenario.arm.forward(start)[0], (len(points), 3, 3))
    frames = scenario.frames(scenario.episode(seed), int(points[-1]) + 1)[points]
    return frames[:, :9].reshape(-1, 3, 3)


def named(policies: Sequence[str]) -> tuple[str, ...]:
    """The policies to show, each once.

    Raises:
        InvalidInputError: There is none.
    """
    if not policies:
        raise InvalidInputError("policy: expected at least one, got none.")
    return tuple(dict.fromkeys(policies))


def play_all(stage: Stage, policies: Sequence[str], *, progress: bool = False) -> list[Replay]:
    """Plays the episode with each policy, see :func:`play`; with a bar on stderr if asked for."""
    bar = tqdm(policies, disable=not progress, file=sys.stderr, unit="policy", dynamic_ncols=True)
    return [play(stage, policy) for policy in bar]


def play(stage: Stage, policy: str) -> Replay:
    """Plays the episode with one policy.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The policy does not suit the scenario, or a parameter is refused.
    """
    made = baselines.track(stage.scenario, policy, seed=stage.seed)
    position, orientation = stage.errors
    return Replay(
        policy,
        made.motion.times,
        made.motion.q,
        np.append(position, made.position_error),
        np.append(orientation, made.orientation_error),
        np.append(0.0, np.cumsum(made.tracking_cost + made.velocity_cost)),
        np.append(made.statuses[:1], made.statuses),
    )
