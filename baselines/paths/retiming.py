"""A path in the time that it can be driven in."""

from __future__ import annotations

import dataclasses
import itertools
from typing import Any

import numpy as np

from baselines.controller.guards import Guards
from baselines.paths.motion import OTHERS, PREFERRED, Motion, with_slow_joints_spared
from baselines.paths.survey import FOLLOWED, REACHED, Branch, Survey, branch_of, last_if_followed, survey
from baselines.paths.timing import Timing
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario

#: How much slower a timing is made until `qp` follows, and how precisely the least slowing is found.
SLOWEST, PRECISION = 5.0, 0.01
#: Most branches that are tried, and how often a timing is worked out again from the motion in the one before.
TRIED, AGAIN = 4, 2

#: A motion that spares slow joints is taken where it is shorter by this factor.
WORTHWHILE = 0.95

#: Most branches along which another solver than `qp` is played, and how many times slower, one after the other.
OTHER_BRANCHES, OTHER_SLOWER = 2, (1.0, 1.3)

#: Bodies that come nearer than this in [m] are said to be in the way.
NEAR = 0.02

#: Largest errors in [m] and [rad].
Errors = tuple[float, float]


@dataclasses.dataclass(frozen=True, eq=False)
class Retimed:
    """A scenario that can be driven.

    Args:
        scenario: The path from the best start, in a time in which the solver follows.
        duration: That time, in [s].
        asked: The time that was asked for, in [s].
        motion: The motion of the solver that was checked.
        solver: The name of the solver.
    """

    scenario: Scenario
    duration: float
    asked: float
    motion: Motion
    solver: str

    @property
    def share(self) -> float:
        """The largest share of a limit of velocity or acceleration that the motion takes, from rest on.

        Where the arm states no acceleration, that of the control loop is the limit, see :class:`Guards`.
        """
        q, dt, scenario = self.motion.q[:, 0], self.motion.times[1], self.scenario
        qdot = np.diff(q, axis=0, prepend=q[:1]) / dt
        shares = (
            np.abs(qdot) / scenario.largest_qdot,
            np.abs(np.diff(qdot, axis=0)) / dt / Guards().acceleration(scenario.arm),
        )
        return float(max(share.max() for share in shares))


@dataclasses.dataclass(frozen=True, eq=False)
class Candidate:
    """A timing that a solver follows from a start; with the motion."""

    branch: Branch
    timing: Timing
    motion: Motion
    solver: str = PREFERRED


def retime(scenario: Scenario | Survey, *, fastest: bool = False, reserve: float = 0.0) -> Retimed:
    """The scenario in a time in which a solver follows within 0.05 mm and 0.5 mrad, and all limits hold.

    The path in space stays as it is. Where limits bind, it is driven slower than asked, elsewhere as fast as asked.
    A redundant arm moves otherwise at another speed; therefore each timing is played, and made slower where needed.
    The solver is `qp`; where limits bind, and some joints are much slower than others, also with weights that spare
    these. Where it does not follow at any speed, as near a singularity, it is `sns` or `rhc_foresight`. Where
    none follows so closely, 1 mm and 1 mrad of `qp` will do.

    Args:
        scenario: A scenario whose path is the same at every reset, or its survey.
        fastest: Whether the path may be driven faster than asked, as fast as the limits allow.
        reserve: As for :func:`survey`, which a scenario gets.

    Raises:
        InvalidInputError: No start leads along the whole path, or `qp` follows from none.
        ModuleNotFoundError: toppra is not installed.
    """
    found = scenario if isinstance(scenario, Survey) else survey(scenario, reserve=reserve)
    out = find_retimed(found, fastest=fastest)
    if out is None:
        raise InvalidInputError(
            f"Scenario {found.scenario.name!r}: expected a path that can be driven; {refusal(found)}"
        )
    return out


def find_retimed(found: Survey, *, fastest: bool = False) -> Retimed | None:
    """The result of :func:`retime`; None where no start leads along the whole path, or no solver follows from any."""
    best = best_candidate(found, FOLLOWED, fastest)
    if fastest or best is None or best.timing.duration > found.duration:
        for solver in with_slow_joints_spared(found.scenario):
            other = best_candidate(survey(found.scenario, reserve=found.reserve, solver=solver), FOLLOWED, fastest)
            if other and (best is None or other.timing.duration < WORTHWHILE * best.timing.duration):
                best = other
    if best is None:
        rough = best_candidate(found, REACHED, fastest)
        best = _by_another(found, rough, fastest) or rough
    return None if best is None else write_scenario(found, best)


def best_candidate(found: Survey, errors: Errors, fastest: bool) -> Candidate | None:
    """The fastest timing that the solver of a survey follows within errors in [m] and [rad]; None if there is none."""
    if not fastest and (motion := found.as_asked(errors)) is not None:
        return Candidate(found.best, Timing.uniform(found.duration, 1.0), motion, found.solver)
    best: Candidate | None = None
    for branch in found.branches[:TRIED]:
        best = _faster(found, branch, best, errors, fastest)
    for _ in range(AGAIN if best else 0):
        before = best
        assert best
        best = _faster(found, branch_of(found.limited, best.motion, best.timing), best, errors, fastest)
        if best is before:
            break
    return best


def _by_another(found: Survey, rough: Candidate | None, fastest: bool) -> Candidate | None:
    """A timing that another solver follows closely: that of `qp`, or those of the best branches; None if none."""
    timings = [(one, found.timing_of(one, fastest)) for one in found.branches[:OTHER_BRANCHES]]
    if rough is not None:
        timings.insert(0, (rough.branch, rough.timing))
    for slower, solver in itertools.product(OTHER_SLOWER, OTHERS):
        for branch, timing in timings:
            if timing and (candidate := _with_motion(found, branch, timing.slower(slower), FOLLOWED, solver)):
                return candidate
    return None


def refusal(found: Survey) -> str:
    """Why a path cannot be driven."""
    best, scenario = found.best, found.scenario
    far = f"{best.position_error:.3g} m and {best.orientation_error:.3g} rad"
    if best.whole:
        return f"no solver follows it closer than {far}, however slowly."
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


def _faster(found: Survey, branch: Branch, best: Candidate | None, errors: Errors, fastest: bool) -> Candidate | None:
    """The fastest timing along a branch that is faster than the best so far; else that one."""
    timing = found.timing_of(branch, fastest)
    if timing is None:
        return best
    most = SLOWEST if best is None else min(SLOWEST, (1.0 - PRECISION) * best.timing.duration / timing.duration)
    low, high, step = 1.0, 1.0, PRECISION
    while high <= most and (tried := _with_motion(found, branch, timing.slower(high), errors)) is None:
        low, high, step = high, high + step, 3.0 * step
    if high > most:
        return best
    while high - low > PRECISION:
        middle = 0.5 * (low + high)
        slower = _with_motion(found, branch, timing.slower(middle), errors)
        low, high, tried = (middle, high, tried) if slower is None else (low, middle, slower)
    return tried


def _with_motion(
    found: Survey, branch: Branch, timing: Timing, errors: Errors, solver: str | None = None
) -> Candidate | None:
    """The timing with its motion, if the solver follows."""
    solver = found.solver if solver is None else solver
    trajectory = timing.of(found.scenario.trajectory)
    motion = last_if_followed(found.play(solver, branch.start, trajectory=trajectory), errors)
    return None if motion is None else Candidate(branch, timing, motion, solver)


def write_scenario(found: Survey, best: Candidate) -> Retimed:
    """The scenario that a candidate drives."""
    changes: dict[str, Any] = {"initial_pose": None, "iterations_per_point": 1}
    if best.timing.duration != found.duration:
        changes |= {"trajectory": best.timing.of(found.scenario.trajectory), "steps": None}
    name = f"{found.scenario.name}-retimed"
    changes["policy"] = None if best.solver == PREFERRED else best.solver
    scenario = found.scenario.replace(name=name, start=best.branch.start, **changes)
    return Retimed(scenario, best.timing.duration, found.duration, best.motion, best.solver)
