"""Whether a path can be driven, from which starts, and how fast."""

from __future__ import annotations

import dataclasses
import functools

import numpy as np

from baselines.paths.motion import Motion, ideal, path_duration, played, without_rates
from baselines.paths.starts import starts
from baselines.paths.timing import JointPath, Limits, Timing, shortest
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Errors in [m] and [rad] within which a pose of the path counts as reached.
REACHED = 1e-3
#: Errors in [m] and [rad] within which `qp` follows a path.
FOLLOWED = 5e-5, 5e-4
#: Shares of the limits of velocity and acceleration that a timing uses.
USED = 0.985, 0.96
#: Timings that take no more than so many times what is asked count as the same. Joints nearer to a stop than the first
#: of these rooms, in [rad] or [m], are braked by it; more than the second is no better.
SLOWING, NARROW, ENOUGH = 1.02, 0.02, 0.3


@dataclasses.dataclass(frozen=True, eq=False)
class Branch:
    """A joint motion along the path from one start.

    Args:
        start: Joint coordinates in [rad] or [m]. Shape (n,).
        reached: Share of the path's poses that are reached before the first that is not.
        position_error: The largest in [m].
        orientation_error: The largest in [rad]; 0 where the task has no orientation.
        velocity: The largest share of each joint's velocity limit, as the path is asked for. Shape (n,).
        acceleration: The same of the acceleration limits; 0 where there is none. Shape (n,).
        room: The least distance of each joint from its stops in [rad] or [m], inf where there is none. Shape (n,).
        shortest: The shortest timing in which all limits hold; None if poses are missed.
        asked: The same, nowhere faster than asked.
    """

    start: FloatArray
    reached: float
    position_error: float
    orientation_error: float
    velocity: FloatArray
    acceleration: FloatArray
    room: FloatArray
    shortest: Timing | None
    asked: Timing | None

    @property
    def whole(self) -> bool:
        """Whether the arm reaches the whole path and some timing keeps the limits."""
        return self.asked is not None and self.shortest is not None

    def rank(self) -> tuple[float, ...]:
        """The smaller, the better: by share of the path, time as asked, room to the stops, shortest time."""
        if self.asked is None or self.shortest is None:
            return -self.reached, self.position_error
        slowing = max(self.asked.duration / self.asked.progress[-1], SLOWING)
        room = float(self.room.min())
        return -2.0, float(room < NARROW), round(slowing, 2), -min(round(room, 1), ENOUGH), self.shortest.duration


@dataclasses.dataclass(frozen=True, eq=False)
class Survey:
    """The start branches of a path.

    Args:
        scenario: The scenario.
        duration: The time that is asked for, in [s].
        branches: The best first.
    """

    scenario: Scenario
    duration: float
    branches: tuple[Branch, ...]

    @property
    def best(self) -> Branch:
        """The branch that comes to the end in the shortest time, or else the farthest."""
        return self.branches[0]

    @functools.cached_property
    def as_asked(self) -> Motion:
        """The motion of `qp` from the best start, within all limits and in the time that is asked for."""
        return played(ideal(self.scenario, start=self.best.start), self.best.start[None])

    @property
    def drivable(self) -> bool:
        """Whether `qp` follows the path from the best start, in the time that is asked for and within all limits."""
        return self.best.whole and follows(self.as_asked)


def follows(motion: Motion) -> bool:
    """Whether all poses are met within :data:`FOLLOWED`, and no limit of the arm holds back a joint."""
    errors = motion.position_error.max(), motion.orientation_error.max()
    return errors[0] <= FOLLOWED[0] and errors[1] <= FOLLOWED[1] and not motion.held_back.any()


def survey(scenario: Scenario) -> Survey:
    """Follows a path from several start branches, and times each of them.

    The joints move as `qp` moves them where neither velocity nor acceleration is limited. Branches are postures at the
    first pose: the scenario's own start, and others from random postures.

    Args:
        scenario: A scenario whose path is the same at every reset. Its plant is taken to be ideal.

    Raises:
        InvalidInputError: The path is random, or its first pose is out of reach.
        ModuleNotFoundError: toppra is not installed.
    """
    duration = path_duration(scenario)
    free = without_rates(scenario)
    motion = played(free, starts(free))
    limits = Limits(scenario.largest_qdot, scenario.arm.acceleration_limit, scenario.dt)
    branches = [_branch(free, motion, row, limits) for row in range(motion.q.shape[1])]
    return Survey(scenario, duration, tuple(sorted(branches, key=Branch.rank)))


def _branch(free: Scenario, motion: Motion, row: int, limits: Limits) -> Branch:
    q, dt = motion.q[:, row], free.dt
    errors = motion.position_error[:, row], motion.orientation_error[:, row]
    missed = (errors[0] > REACHED) | (errors[1] > REACHED)
    timings: list[Timing | None] = [None, None]
    if not missed.any():
        path = JointPath.of(motion.times, q, limits.velocity)
        used = dataclasses.replace(
            limits, velocity=USED[0] * limits.velocity, acceleration=USED[1] * limits.acceleration
        )
        timings = [shortest(path, dataclasses.replace(used, rate=rate)) for rate in (np.inf, 1.0)]
    return Branch(
        start=q[0],
        reached=float(np.argmax(missed) / len(missed)) if missed.any() else 1.0,
        position_error=float(errors[0].max()),
        orientation_error=float(errors[1].max()),
        velocity=np.abs(np.diff(q, axis=0)).max(axis=0) / dt / limits.velocity,
        acceleration=np.abs(np.diff(q, n=2, axis=0)).max(axis=0) / dt**2 / limits.acceleration,
        room=np.minimum(q - free.arm.lower, free.arm.upper - q).min(axis=0),
        shortest=timings[0],
        asked=timings[1],
    )
