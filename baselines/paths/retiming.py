"""A path in the time that it can be driven in."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from baselines.paths.motion import Motion, ideal, played
from baselines.paths.survey import FOLLOWED, REACHED, Branch, Survey, branch_of, follows, survey
from baselines.paths.timing import Timing
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario

#: How much slower a timing is made until `qp` follows, and how precisely the least slowing is found.
SLOWEST, PRECISION = 5.0, 0.01
#: Most branches that are tried, and how often a timing is worked out again from the motion in the one before.
TRIED, AGAIN = 4, 2

#: Bodies that come nearer than this in [m] are said to be in the way.
NEAR = 0.02

#: Largest errors in [m] and [rad].
Errors = tuple[float, float]


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
    Where `qp` follows no closer at any speed, as near a singularity, 1 mm and 1 mrad will do.

    Args:
        scenario: A scenario whose path is the same at every reset, or its survey.
        fastest: Whether the path may be driven faster than asked, as fast as the limits allow.

    Raises:
        InvalidInputError: No start leads along the whole path, or `qp` follows from none.
        ModuleNotFoundError: toppra is not installed.
    """
    found = scenario if isinstance(scenario, Survey) else survey(scenario)
    out = retimed(found, fastest=fastest)
    if out is None:
        raise InvalidInputError(
            f"Scenario {found.scenario.name!r}: expected a path that can be driven; {refusal(found)}"
        )
    return out


def retimed(found: Survey, *, fastest: bool = False) -> Retimed | None:
    """The result of :func:`retime`; None where no start leads along the whole path, or `qp` follows from none."""
    for errors in (FOLLOWED, REACHED):
        best = _best(found, errors, fastest)
        if best is not None:
            return _made(found, best)
    return None


def _best(found: Survey, errors: Errors, fastest: bool) -> _Candidate | None:
    if not fastest and found.drivable_within(errors):
        return _Candidate(found.best, Timing.uniform(found.duration, 1.0), found.as_asked)
    best: _Candidate | None = None
    for branch in found.branches[:TRIED]:
        best = _faster(found, branch, best, errors, fastest)
    for _ in range(AGAIN if best else 0):
        before = best
        assert best
        best = _faster(found, branch_of(found.scenario, best.motion, best.timing), best, errors, fastest)
        if best is before:
            break
    return best


def refusal(found: Survey) -> str:
    """Why a path cannot be driven."""
    best, scenario = found.best, found.scenario
    far = f"{best.position_error:.3g} m and {best.orientation_error:.3g} rad"
    if best.whole:
        return f"qp follows it no closer than {far}, however slowly."
    time = best.reached * found.duration
    x = scenario.trajectory.frames(np.array([time]), scenario.arm)[0, -3:]
    where = f"from {time:.3g} s on, at ({', '.join(f'{one:.4g}' for one in x)}) m"
    missed = f"misses poses {where}, and by up to {far}"
    if (met := best.contact) is None or met.clearance > NEAR:
        return f"no start reaches all of it. The farthest {missed}."
    (first, second), apart = met.pair, "touch" if met.touched else f"are {1e3 * met.clearance:.3g} mm apart"
    return (
        f"no start reaches all of it and keeps clear. The farthest {missed}; {first!r} and {second!r} {apart} at "
        f"{met.time:.3g} s."
    )


def _faster(found: Survey, branch: Branch, best: _Candidate | None, errors: Errors, fastest: bool) -> _Candidate | None:
    """The fastest timing along a branch that is faster than the best so far; else that one."""
    timing = branch.shortest if fastest else branch.asked
    if timing is None:
        return best
    most = SLOWEST if best is None else min(SLOWEST, (1.0 - PRECISION) * best.timing.duration / timing.duration)
    low, high, step = 1.0, 1.0, PRECISION
    while high <= most and (tried := _followed(found, branch, timing.slower(high), errors)) is None:
        low, high, step = high, high + step, 3.0 * step
    if high > most:
        return best
    while high - low > PRECISION:
        middle = 0.5 * (low + high)
        slower = _followed(found, branch, timing.slower(middle), errors)
        low, high, tried = (middle, high, tried) if slower is None else (low, middle, slower)
    return tried


def _followed(found: Survey, branch: Branch, timing: Timing, errors: Errors) -> _Candidate | None:
    """The timing with its motion, if `qp` follows."""
    trajectory = timing.of(found.scenario.trajectory)
    motion = played(ideal(found.scenario, trajectory=trajectory, start=branch.start), branch.start[None])
    return _Candidate(branch, timing, motion) if follows(motion, errors) else None


def _made(found: Survey, best: _Candidate) -> Retimed:
    changes: dict[str, Any] = {"initial_pose": None, "iterations_per_point": 1}
    if best.timing.duration != found.duration:
        changes |= {"trajectory": best.timing.of(found.scenario.trajectory), "steps": None}
    name = f"{found.scenario.name}-retimed"
    scenario = found.scenario.replace(name=name, start=best.branch.start, **changes)
    return Retimed(scenario, best.timing.duration, found.duration, best.motion)
