"""Whether a path can be driven, from which starts, and how fast."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.controller.guards import Guards
from baselines.paths.motion import PREFERRED, Motion, ideal, in_time, path_duration, play_from
from baselines.paths.starts import starts
from baselines.paths.timing import Timing, grid, shortest
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, number

#: The share of the limits that the commands leave to feedback. With a lag of 20 ms and 2 periods of 4 ms, the control
#: loop follows 29 of 29 retimed paths, with 40 ms and 3 periods 20; without a reserve, with 20 ms and 2 periods, none
#: of seven.
RESERVE = 0.15
#: Errors in [m] and [rad] within which a pose of the path counts as reached.
REACHED = 1e-3, 1e-3
#: Errors in [m] and [rad] within which `qp` follows a path.
FOLLOWED = 5e-5, 5e-4
#: Shares of the limits of velocity and acceleration that a timing uses.
USED = 0.985, 0.96
#: The path is played in the time asked for, and where most branches miss poses, slowed by this factor: as slowly as
#: can be, then slower and slower until half of the branches reach all of it.
SLOWEST, SLOWER = 30.0, (1.6, 2.5, 4.0, 6.5, 10.0, 16.0)
#: Steps of a slower play: a longer path is sampled at larger intervals, a shorter one at smaller ones.
FEWEST_STEPS, MOST_STEPS = 1000, 4000
#: Timings that take at most this multiple of the requested time count as equal. Joints nearer to a stop than the first
#: of these distances, in [rad] or [m], are braked by it; more than the second is no better. A motion leaps that begins
#: with more than the last share of a velocity limit, where accelerations are not limited.
SLOWING, NARROW, ENOUGH, LEAP = 1.02, 0.02, 0.8, 0.1
#: The longest control period, as a share of the path's duration.
SHARE = 0.1
#: A clearance in [m] below the first of these, less than `qp` keeps, is too small; more than the second is no better.
CLOSE, CLEAR = 0.003, 0.05


class Contact(NamedTuple):
    """How close bodies come to each other and to obstacles along a path.

    Attributes:
        clearance: The smallest signed distance until they touch, in [m].
        pair: The names of the two that are closest, or that touch.
        time: When they do, were the motion as fast as asked, in [s].
        touched: Whether they touch, so that the path cannot be followed further.
    """

    clearance: float
    pair: tuple[str, str]
    time: float
    touched: bool


@dataclasses.dataclass(frozen=True, eq=False)
class Branch:
    """A joint motion along the path from one start.

    Args:
        start: Joint coordinates in [rad] or [m]. Shape (n,).
        given: Whether the scenario states this start.
        slowing: How many times the time asked for the motion took, the first one that reaches the whole path.
        reached: Share of the path's poses that are reached before the first that is not.
        position_error: The largest in [m].
        orientation_error: The largest in [rad]; 0 where the task has no orientation.
        velocity: The largest joint velocities, were this motion as fast as asked, in [rad/s] or [m/s]. Shape (n,).
        acceleration: Shares of the acceleration limits, in [rad/s²] or [m/s²]. Shape (n,).
        leap: The largest share of a velocity limit in the first control period, from rest.
        room: The least distance of each joint from its stops in [rad] or [m], inf where there is none. Shape (n,).
        contact: How close bodies come; None where nothing can meet.
        shortest: The shortest timing of this motion in which all limits hold; None if poses are missed.
        asked: The same, nowhere faster than asked.
    """

    start: FloatArray
    given: bool
    slowing: float
    reached: float
    position_error: float
    orientation_error: float
    velocity: FloatArray
    acceleration: FloatArray
    leap: float
    room: FloatArray
    contact: Contact | None
    shortest: Timing | None
    asked: Timing | None

    @property
    def whole(self) -> bool:
        """Whether the arm reaches the whole path and some timing keeps the limits."""
        return self.asked is not None and self.shortest is not None

    def rank(self) -> tuple[float, ...]:
        """The smaller, the better: share of the path, time, a given start, clearance, room, shortest time."""
        if self.asked is None or self.shortest is None:
            return -self.reached, self.position_error
        slowing = max(self.asked.duration / self.asked.progress[-1], SLOWING)
        room = float(self.room.min())
        enough = min(round(room, 1), ENOUGH)
        clearance = np.inf if self.contact is None else self.contact.clearance
        return (
            -2.0,
            room < NARROW or self.leap > LEAP or clearance < CLOSE,
            round(slowing, 2),
            not self.given,
            -min(round(clearance, 2), CLEAR),
            -enough,
            self.shortest.duration,
        )


@dataclasses.dataclass(frozen=True, eq=False)
class Survey:
    """The start branches of a path.

    Args:
        scenario: The scenario.
        duration: The time that is asked for, in [s].
        branches: The best first.
        reserve: The share of the limits of velocity and acceleration that motions leave to feedback.
        solver: The solver of the branches, such as ``"qp"``.
    """

    scenario: Scenario
    duration: float
    branches: tuple[Branch, ...]
    reserve: float = 0.0
    solver: str = PREFERRED

    @property
    def best(self) -> Branch:
        """The branch that comes to the end in the shortest time, or else the farthest."""
        return self.branches[0]

    @functools.cached_property
    def limited(self) -> Scenario:
        """The scenario with the limits that motions keep."""
        return with_reserve(self.scenario, self.reserve)

    @property
    def drivable(self) -> bool:
        """Whether `qp` follows the path from the best start, in the time that is asked for and within all limits."""
        return self.as_asked() is not None

    def as_asked(self, errors: tuple[float, float] = FOLLOWED, solver: str | None = None) -> Motion | None:
        """The motion of a solver from the best start in the time asked for; None if it errs more, in [m] and [rad]."""
        solver = self.solver if solver is None else solver
        if not self.best.whole or self.best.slowing > 1.0:
            return None
        if solver not in self._motions:
            self._motions[solver] = self.play(solver, start=self.best.start)
        return last_if_followed(self._motions[solver], errors)

    def timing_of(self, branch: Branch, fastest: bool) -> Timing | None:
        """The timing of a branch, as fast as asked or as the limits allow; eased in where there is a reserve."""
        timing = branch.shortest if fastest else branch.asked
        return timing.eased_in() if timing and self.reserve else timing

    def play(self, solver: str, start: FloatArray, **changes: Any) -> list[Motion]:
        """Motions of a solver from a start on the changed scenario: within the limits less the reserve, and the whole.

        A redundant arm may move otherwise within the whole limits.
        """
        scenarios = [self.limited] if self.reserve == 0.0 else [self.limited, self.scenario]
        return [play_from(ideal(scenario, start=start, **changes), start[None], solver) for scenario in scenarios]

    @functools.cached_property
    def _motions(self) -> dict[str, list[Motion]]:
        return {}


def last_if_followed(motions: Sequence[Motion], errors: tuple[float, float]) -> Motion | None:
    """The last of motions that all follow within errors in [m] and [rad]; None if one does not."""
    return motions[-1] if all(follows(motion, errors) for motion in motions) else None


def with_reserve(scenario: Scenario, reserve: float) -> Scenario:
    """The scenario with limits of velocity and acceleration that are smaller by a share; the same without one.

    Accelerations that the arm does not limit are limited as in the control loop, see :class:`Guards`.
    """
    if reserve == 0.0:
        return scenario
    arm, left = scenario.arm, 1.0 - reserve
    slower = {
        "velocity_limit": left * arm.velocity_limit,
        "acceleration_limit": left * Guards().acceleration(arm),
    }
    return scenario.replace(arm=arm.replace(**slower), velocity_limit=left * scenario.velocity_limit)


def describe_reserve(reserve: float) -> str:
    """Which share of the limits a motion leaves to feedback; empty for none."""
    return f", with {100 * reserve:.3g} % of the limits in reserve (--reserve)" if reserve else ""


def follows(motion: Motion, errors: tuple[float, float] = FOLLOWED) -> bool:
    """Whether poses are met within errors in [m] and [rad], no limit holds back a joint, and nothing touches."""
    position, orientation = motion.position_error.max(), motion.orientation_error.max()
    free = not motion.held_back.any() and not motion.stopped.any()
    return bool(position <= errors[0] and orientation <= errors[1] and free)


def survey(
    scenario: Scenario, *, reserve: float = 0.0, solver: str = PREFERRED, begin: FloatArray | None = None
) -> Survey:
    """Follows a path from several start branches, and times each of them.

    Branches are postures at the first pose: that of the scenario, and others from random postures. From each of
    them `qp` plays the path in the time asked for and, while it misses poses, slower, obstacles with it. Where the
    scenario has collisions, branches begin clear, and end where bodies touch.

    Args:
        scenario: A scenario whose path is the same at every reset. Its plant is taken to be ideal.
        reserve: The share of the limits of velocity and acceleration that motions leave to feedback, from 0 to 0.9.
        solver: The solver, as text such as ``"qp:secondary_gain=0"``.
        begin: Starts in [rad] or [m] instead of those that are searched. Shape (N, n).

    Raises:
        InvalidInputError: The path is random, its first pose is out of reach, none of its postures is clear, or the
            control period is longer than a tenth of the path.
        ModuleNotFoundError: toppra is not installed.
    """
    reserve, duration = number("reserve", reserve, at_least=0.0, at_most=0.9), path_duration(scenario)
    if scenario.dt > SHARE * duration:
        raise InvalidInputError(
            f"dt: expected a control period of at most a tenth of the path's {duration:.4g} s, got {scenario.dt:g} s."
        )
    whole, scenario = scenario, with_reserve(scenario, reserve)
    begin = starts(ideal(scenario)) if begin is None else begin
    branches = _branches(scenario, begin, 1.0, solver)
    if sum(branch.whole for branch in branches) < 0.5 * len(branches):
        # Poses that even the slowest play misses are out of reach.
        _play_again(scenario, branches, [not branch.whole for branch in branches], SLOWEST, solver)
    for factor in SLOWER:
        slowest = [branch.whole and branch.slowing == SLOWEST for branch in branches]
        if sum(slowest) > 0.5 * sum(branch.whole for branch in branches):
            _play_again(scenario, branches, slowest, factor, solver)
    return Survey(whole, duration, tuple(sorted(branches, key=Branch.rank)), reserve, solver)


def _play_again(scenario: Scenario, branches: list[Branch], chosen: list[bool], slowing: float, solver: str) -> None:
    """Replaces the chosen branches by those of a slower play, where it reaches the path or is the slowest one."""
    rows = np.flatnonzero(chosen).tolist()
    if rows:
        starts = np.array([branches[row].start for row in rows])
        for row, branch in zip(rows, _branches(scenario, starts, slowing, solver), strict=True):
            if branch.whole or slowing == SLOWEST:
                branches[row] = branch


def _branches(scenario: Scenario, starts: FloatArray, slowing: float, solver: str) -> list[Branch]:
    """Branches from starts of shape (N, n), played in a multiple of the requested time."""
    timing = Timing.uniform(path_duration(scenario), slowing)
    dt = timing.duration / min(max(timing.duration / scenario.dt, FEWEST_STEPS), MOST_STEPS)
    motion = play_from(ideal(scenario, **in_time(scenario, timing.of), start=starts[0], dt=dt), starts, solver)
    return [branch_of(scenario, motion.of(row), timing) for row in range(len(starts))]


def branch_of(scenario: Scenario, motion: Motion, timing: Timing) -> Branch:
    """A branch from the motion of one start, played in the timing."""
    q, dt, arm = motion.q[:, 0], motion.times[1], scenario.arm
    slowing = timing.duration / float(timing.progress[-1])
    missed = (motion.position_error > REACHED[0]) | (motion.orientation_error > REACHED[1])
    reached = float(np.argmax(missed) / len(missed)) if missed.any() else 1.0
    timings: list[Timing | None] = [None, None]
    if reached == 1.0:
        progress = timing.of(scenario.trajectory).base_times(motion.times)
        rows = grid(progress, q, scenario.largest_qdot)
        limits = {"velocity": USED[0] * scenario.largest_qdot, "acceleration": USED[1] * arm.acceleration_limit}
        timings = [shortest(progress[rows], q[rows], **limits, dt=scenario.dt, rate=rate) for rate in (np.inf, 1.0)]
    return Branch(
        start=q[0],
        given=scenario.start is not None and bool((q[0] == scenario.start).all()),
        slowing=slowing,
        reached=reached,
        position_error=float(motion.position_error.max()),
        orientation_error=float(motion.orientation_error.max()),
        velocity=np.abs(np.diff(q, axis=0)).max(axis=0) / dt * slowing,
        acceleration=np.abs(np.diff(q, n=2, axis=0)).max(axis=0) / dt**2 * slowing**2,
        leap=float((np.abs(q[1] - q[0]) / dt / scenario.largest_qdot).max()),
        room=np.minimum(q - arm.lower, arm.upper - q).min(axis=0),
        contact=_contact(scenario, motion, slowing),
        shortest=timings[0],
        asked=timings[1],
    )


def _contact(scenario: Scenario, motion: Motion, slowing: float) -> Contact | None:
    """How close bodies come in the motion of one start, played in a multiple of the requested time."""
    if motion.pair[0, 0, 0] < 0:
        return None
    stops = np.flatnonzero(motion.stopped[:, 0])
    until = motion.clearance[: stops[0] + 1, 0] if len(stops) else motion.clearance[:, 0]
    step = int(stops[0] if len(stops) else until.argmin())
    pair = scenario.pair_names(motion.pair[step, 0].tolist())
    return Contact(float(until.min()), pair, float(motion.times[step + 1]) / slowing, len(stops) > 0)
