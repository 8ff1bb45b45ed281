"""A path in the time that it can be driven in."""

from __future__ import annotations

import dataclasses

from baselines.paths.motion import Motion, ideal, played
from baselines.paths.survey import Branch, Survey, follows, survey
from baselines.paths.timing import Timing
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.trajectories import Trajectory

#: How much slower a timing is made until `qp` follows, and how precisely the least slowing is found.
SLOWEST, PRECISION = 3.0, 0.01
#: Most branches that are tried.
TRIED = 5


@dataclasses.dataclass(frozen=True, eq=False)
class Retimed:
    """A scenario that can be driven.

    Args:
        scenario: The path from the best start, in the time of `qp`.
        duration: That time, in [s].
        asked: The time that was asked for, in [s].
        motion: The motion of `qp` that was checked.
    """

    scenario: Scenario
    duration: float
    asked: float
    motion: Motion


def retime(scenario: Scenario | Survey, *, fastest: bool = False) -> Retimed:
    """The scenario in a time in which `qp` follows within 0.05 mm and 0.5 mrad, and all limits hold.

    The path in space stays as it is. Where limits bind, it is driven slower than asked, elsewhere as fast as asked.
    A redundant arm moves otherwise at another speed; therefore each timing is played, and made slower where needed.

    Args:
        scenario: A scenario whose path is the same at every reset, or its survey.
        fastest: Whether the path may be driven faster than asked, as fast as the limits allow.

    Raises:
        InvalidInputError: No start leads along the whole path.
        ModuleNotFoundError: toppra is not installed.
    """
    found = scenario if isinstance(scenario, Survey) else survey(scenario)
    if not fastest and found.drivable:
        return _retimed(found, found.best, found.scenario.trajectory, found.duration, found.as_asked)
    best: Retimed | None = None
    for branch in found.branches[:TRIED]:
        timing = branch.shortest if fastest else branch.asked
        if timing is not None:
            best = _faster(found, branch, timing, best)
    if best is None:
        far = found.best
        raise InvalidInputError(
            f"Scenario {found.scenario.name!r}: expected a path that can be driven to its end, got one of which "
            f"{len(found.branches)} starts reach {100 * far.reached:.3g} % at most, and then miss it by "
            f"{far.position_error:.3g} m and {far.orientation_error:.3g} rad."
        )
    return best


def _faster(found: Survey, branch: Branch, timing: Timing, best: Retimed | None) -> Retimed | None:
    """The fastest of the timings that are this one, or slower, and faster than the best so far; else that one."""
    most = SLOWEST if best is None else min(SLOWEST, (1.0 - PRECISION) * best.duration / timing.duration)
    low, high = 1.0, 1.0
    while high <= most:
        tried = _tried(found, branch, timing.slower(high))
        if tried is not None:
            best = tried
            break
        low, high = high, high * (1.0 + 2.0 * (high - low) + PRECISION)
    while high <= most and high - low > PRECISION:
        middle = 0.5 * (low + high)
        tried = _tried(found, branch, timing.slower(middle))
        low, high, best = (middle, high, best) if tried is None else (low, middle, tried)
    return best


def _tried(found: Survey, branch: Branch, timing: Timing) -> Retimed | None:
    """The scenario in a timing, if `qp` follows it."""
    trajectory = timing.of(found.scenario.trajectory)
    motion = played(ideal(found.scenario, trajectory=trajectory, start=branch.start), branch.start[None])
    return _retimed(found, branch, trajectory, timing.duration, motion) if follows(motion) else None


def _retimed(found: Survey, branch: Branch, trajectory: Trajectory, duration: float, motion: Motion) -> Retimed:
    plain = {"initial_pose": None, "iterations_per_point": 1, "steps": len(motion.times) - 1}
    name = f"{found.scenario.name}-retimed"
    scenario = found.scenario.replace(name=name, trajectory=trajectory, start=branch.start, **plain)
    return Retimed(scenario, duration, found.duration, motion)
