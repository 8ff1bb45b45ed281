"""A joint motion that is planned along the whole path, for paths along which no start branch leads."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from baselines.paths.motion import ideal
from baselines.paths.retiming import Retimed, best_candidate, write_scenario
from baselines.paths.routes import SEARCHED, Routes
from baselines.paths.survey import FOLLOWED, Survey, survey
from ikgym.kernels.rotations import geodesic_angle
from ikgym.obstacles.solids import closest, solids_of
from ikgym.scenarios import Scenario
from ikgym.trajectories import JointPath
from ikgym.validation import FloatArray

#: The policy that plays planned motions.
PLAYER = "follow_nominal"
#: Between two knots the tool moves by at most the first of these in [m] and turns by at most the second in [rad].
TRAVEL, TURN = 0.005, 0.03
#: Least and most knots, points of a path, the largest motion of the fastest joint between two knots in [rad], and the
#: share of it that a cell takes.
FEWEST, MOST, POINTS, LARGEST, CELL = 30, 400, 1000, 0.2, 0.4
#: Postures are drawn to the middle of neighbours this far away, and how often.
STRIDES, ROUNDS = (16, 8, 4, 2, 1), 12
#: Spans of the splines that smooth a motion: the first of them that is clear is timed.
SPANS = (8, 16, 32, 48)
#: Distances that bodies keep in a smoothed motion in [m], and joints from their stops in [rad] or [m].
CLEAR, EDGE = 0.001, 0.01


@dataclasses.dataclass(frozen=True)
class Plan:
    """The outcome of a search for a joint motion along the whole path."""

    reached: float  # time in [s] up to which there is a way, were the path driven as fast as asked
    motion: Retimed | None  # the motion, where it leads to the end within all limits


def plan(found: Survey, *, fastest: bool = False) -> Plan | None:
    """Searches a joint motion along the whole path, whatever the start, and times it.

    Dynamic programming finds a sequence of postures, see :class:`Routes`; splines smooth it, and each of their points
    is moved onto the path. Timed as other motions are, it is played by `follow_nominal`, and checked in the same way.

    Args:
        found: A survey; where it has one branch, the motion begins at the start of this.
        fastest: As for :func:`baselines.paths.retime`.

    Returns:
        None where there is no search for the task.
    """
    scenario = ideal(found.scenario)
    if scenario.task.error_size not in SEARCHED or scenario.joints < scenario.task.error_size:
        return None
    at = np.linspace(0.0, found.duration, POINTS)
    along = _progress(scenario, at)
    times = np.interp(np.linspace(0.0, 1.0, 1 + min(math.ceil(along[-1]), MOST)), along / along[-1], at)
    largest = LARGEST * scenario.largest_qdot / scenario.largest_qdot.max()
    routes = Routes(scenario, times, largest, cell=CELL, edge=EDGE)
    q = routes.route(found.best.start if len(found.branches) == 1 else None)
    if len(q) < len(times):
        return Plan(float(times[max(len(q) - 1, 0)]), None)
    for motion in _smooth(routes, _shorten(routes, q), at, along / along[-1]):
        planned = found.scenario.replace(trajectory=motion, start=motion.q[0], initial_pose=None)
        surveyed = survey(planned, reserve=found.reserve, solver=PLAYER, begin=motion.q[:1])
        if candidate := best_candidate(surveyed, FOLLOWED, fastest):
            return Plan(found.duration, write_scenario(surveyed, candidate))
    return Plan(found.duration, None)


def _progress(scenario: Scenario, times: FloatArray) -> FloatArray:
    """How far the tool has moved and turned, and how much time has gone by, in steps between knots. Shape (k,)."""
    frames = scenario.trajectory.frames(times, scenario.model)
    steps = FEWEST / len(times) + np.linalg.norm(np.diff(frames[:, -3:], axis=0), axis=1) / TRAVEL
    if scenario.task.has_orientation:
        rotations = frames[:, :9].reshape(-1, 3, 3)
        steps += [geodesic_angle(*pair) / TURN for pair in itertools.pairwise(rotations)]
    return np.append(0.0, np.cumsum(steps))


def _shorten(routes: Routes, q: FloatArray) -> FloatArray:
    """Postures at the knots that lie closer to the middle of their neighbours, where these are clear. Shape (k, n)."""
    rows, clearances = np.arange(len(q)), _clearances(routes.scenario, routes.times)
    for stride in STRIDES:
        before, after = np.maximum(rows - stride, 0), np.minimum(rows + stride, len(q) - 1)
        for _ in range(ROUNDS):
            middle = 0.5 * q + 0.25 * (q[before] + q[after])
            closer, met = routes.meet(routes.frames, middle)
            met &= clearances(closer) > routes.margin
            met[0] = False
            q = np.where(met[:, None], closer, q)
    return q


def _clearances(scenario: Scenario, times: FloatArray) -> Callable[[FloatArray], FloatArray]:
    """A function of postures at times of the path (k, n): distances between bodies in [m]. Shape (k,)."""
    if not scenario.collides:
        return lambda q: np.full(len(q), np.inf)
    solids, checked = solids_of(scenario.obstacles, times, scenario.model), scenario.surroundings.checked
    return lambda q: closest(scenario.arm, q, solids, checked).distances


def _smooth(routes: Routes, q: FloatArray, times: FloatArray, along: FloatArray) -> Iterator[JointPath]:
    """Joint motions along the path, near postures at knots (k, n), which meet all poses and are clear."""
    from scipy.interpolate import make_lsq_spline

    scenario = routes.scenario
    frames = scenario.trajectory.frames(times, scenario.model)
    clearances, weights = _clearances(scenario, times), np.append(1e4, np.ones(len(q) - 1))
    for spans in (one for one in SPANS if one < len(q) // 2):
        ends = np.linspace(0.0, 1.0, spans + 1)[1:-1]
        parts = np.concatenate([np.zeros(4), ends, np.ones(4)])
        exact, met = routes.meet(frames, make_lsq_spline(np.linspace(0.0, 1.0, len(q)), q, parts, w=weights)(along))
        exact[0] = q[0]
        if met.all() and clearances(exact).min() > CLEAR:
            yield JointPath(scenario.trajectory, times, exact)
