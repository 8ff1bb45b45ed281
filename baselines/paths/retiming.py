"""A path in the time that it can be driven in."""

from __future__ import annotations

import dataclasses

from baselines.paths.motion import Motion, ideal, played
from baselines.paths.survey import Branch, Survey, branch_of, follows, survey
from baselines.paths.timing import Timing
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario

#: How much slower a timing is made until `qp` follows, and how precisely the least slowing is found.
SLOWEST, PRECISION = 3.0, 0.01
#: Most branches that are tried, and how often a timing is worked out again from the motion in the one before.
TRIED, AGAIN = 4, 2


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


@dataclasses.dataclass(frozen=True, eq=False)
class _Candidate:
    """A timing that `qp` follows from a start; with the motion."""

    branch: Branch
    timing: Timing
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
        return _retimed(found, _Candidate(found.best, Timing.uniform(found.duration, 1.0), found.as_asked))
    best: _Candidate | None = None
    for branch in found.branches[:TRIED]:
        if branch.whole:
            best = _faster(found, branch, best, fastest)
    for _ in range(AGAIN if best else 0):
        before = best
        assert best
        best = _faster(found, branch_of(found.scenario, best.motion, best.timing), best, fastest)
        if best is before:
            break
    if best is None:
        raise InvalidInputError(_refusal(found))
    return _retimed(found, best)


def _faster(found: Survey, branch: Branch, best: _Candidate | None, fastest: bool) -> _Candidate | None:
    """The fastest timing along a branch that is faster than the best so far; else that one."""
    timing = branch.shortest if fastest else branch.asked
    if timing is None:
        return best
    most = SLOWEST if best is None else min(SLOWEST, (1.0 - PRECISION) * best.timing.duration / timing.duration)
    low, high, step = 1.0, 1.0, PRECISION
    while high <= most and (tried := _followed(found, branch, timing.slower(high))) is None:
        low, high, step = high, high + step, 3.0 * step
    if high > most:
        return best
    while high - low > PRECISION:
        middle = 0.5 * (low + high)
        slower = _followed(found, branch, timing.slower(middle))
        low, high, tried = (middle, high, tried) if slower is None else (low, middle, slower)
    return tried


def _followed(found: Survey, branch: Branch, timing: Timing) -> _Candidate | None:
    """The timing with its motion, if `qp` follows."""
    trajectory = timing.of(found.scenario.trajectory)
    motion = played(ideal(found.scenario, trajectory=trajectory, start=branch.start), branch.start[None])
    return _Candidate(branch, timing, motion) if follows(motion) else None


def _retimed(found: Survey, best: _Candidate) -> Retimed:
    scenario = found.scenario.replace(
        name=f"{found.scenario.name}-retimed",
        trajectory=best.timing.of(found.scenario.trajectory),
        start=best.branch.start,
        steps=len(best.motion.times) - 1,
        initial_pose=None,
        iterations_per_point=1,
    )
    return Retimed(scenario, best.timing.duration, found.duration, best.motion)


def _refusal(found: Survey) -> str:
    far = found.best
    return (
        f"Scenario {found.scenario.name!r}: expected a path that can be driven to its end, got one of which "
        f"{len(found.branches)} starts reach {100 * far.reached:.3g} % at most, and then miss it by "
        f"{far.position_error:.3g} m and {far.orientation_error:.3g} rad."
    )
