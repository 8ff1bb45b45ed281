"""An episode that is shown: the reference, and the motion, errors and costs of each policy."""

from __future__ import annotations

import dataclasses
import functools
import sys
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from tqdm import tqdm

import baselines
from baselines.evaluation.jobs import job_of
from ikgym import scenarios
from ikgym.arms import Arm
from ikgym.arms.inverse import LENGTH_OF_RADIAN
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles.solids import solids_of
from ikgym.rendering.scene import Scene
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, whole_number

# Speed of the reference if that of the scenario rests, in lengths of the arm per second.
SLOW = 0.1


def size(arm: Arm) -> float:
    """The length in [m] that the picture of an arm is scaled by: its reach, 1 if it has none."""
    return arm.reach(np.zeros(arm.joints)) or 1.0


@dataclasses.dataclass(frozen=True, eq=False)
class Stage:
    """An episode, before any policy plays it. Frames are the 9 numbers of a rotation and a position in [m]."""

    scenario: Scenario  # the scenario, cut to the steps that are shown
    seed: int
    start: FloatArray  # joint coordinates at the start, in [rad] or [m]. Shape (n,)
    # the reference; its rotation is that of the tool at the start if the task has none. (steps + 1, 12)
    frames: FloatArray
    # largest motion of the reference in one step towards a dragged target: in [m] the mean of the scenario's
    # reference, in [rad] the angle that :meth:`ikgym.arms.Arm.inverse` weighs equally
    pace: tuple[float, float]

    @classmethod
    def of(cls, scenario: str | Scenario, seed: int = 0, steps: int | None = None) -> Stage:
        """An episode of a scenario as :func:`ikgym.scenarios.find` takes it; all of its steps if they are left out."""
        whole = shown = scenarios.find(scenario)
        if steps is not None:
            shown = whole.replace(steps=min(whole_number("steps", steps, at_least=1), whole.steps))
        start = shown.start_of(whole_number("seed", seed, at_least=0))
        points, length = whole.points(), size(whole.arm)
        frames = whole.frames(whole.episode(seed), int(points[-1]) + 1)[points]
        if not whole.task.has_orientation:
            rotation = whole.arm.forward(start)[0].ravel()
            frames = np.hstack([np.broadcast_to(rotation, (len(frames), 9)), frames])
        shift = float(np.linalg.norm(np.diff(frames[:, 9:], axis=0), axis=1).sum()) / whole.steps
        shift = shift or SLOW * length * whole.dt
        return cls(shown, seed, start, frames[: shown.steps + 1], (shift, shift / (LENGTH_OF_RADIAN * length)))

    @functools.cached_property
    def boxes(self) -> FloatArray:
        """The obstacles after 0, 1, … steps, once if none moves, see :func:`ikgym.obstacles.solids.solids_of`."""
        scenario = self.scenario
        return solids_of(scenario.obstacles_of(self.seed), scenario.times(scenario.steps + 1), scenario.model)

    def scene(self, q: FloatArray, step: int, target: FloatArray | None = None) -> Scene:
        """An arm at q in [rad] or [m] (n,) after a number of steps, with the reference or another target (12,)."""
        reference = self.frames[step] if target is None else target
        return Scene(self.scenario, q, reference, self.obstacles(step))

    def obstacles(self, step: int) -> FloatArray:
        """The obstacles after a number of steps. Shape (o, 16)."""
        now: FloatArray = self.boxes[min(step, len(self.boxes) - 1)]
        return now


class Replay(NamedTuple):
    """The episode of one policy; row k is the state after step k, row 0 the start with errors and status of step 1."""

    policy: str
    q: FloatArray  # true joint coordinates in [rad] or [m]. Shape (steps + 1, n)
    position_error: FloatArray  # in [m]. Shape (steps + 1,)
    orientation_error: FloatArray  # in [rad], NaN where the task has no orientation. Shape (steps + 1,)
    cost: FloatArray  # accumulated cost. Shape (steps + 1,)
    statuses: npt.NDArray[np.int64]  # values of :class:`baselines.Status`. Shape (steps + 1,)


def play_all(stage: Stage, policies: Sequence[str]) -> list[Replay]:
    """Plays the episode with each policy once, with a bar on a terminal."""
    if not policies:
        raise InvalidInputError("policy: expected at least one, got none.")
    wanted, replays = list(dict.fromkeys(policies)), []
    for policy in wanted:  # all are checked before one plays
        job_of(policy, stage.scenario, stage.seed)
    for policy in tqdm(wanted, disable=None, file=sys.stderr, unit="policy"):
        made = baselines.track(stage.scenario, policy, seed=stage.seed)
        steps = np.maximum(np.arange(stage.scenario.steps + 1) - 1, 0)
        errors = made.position_error[steps], made.orientation_error[steps]
        cost = np.append(0.0, np.cumsum(made.cost))
        replays.append(Replay(policy, made.motion.q, *errors, cost, made.status[steps]))
    return replays
