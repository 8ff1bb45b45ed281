"""Problems that others published, as scenarios: see :mod:`ikgym.problems`.

They are paths without time. A waypoint comes every 0.2 s, the period at which RL-ITG checks velocity limits
(`torm_evaluation.cpp`, `time_duration_`), with ten control steps from one to the next. Positions and velocities of the
arm are limited, its accelerations are not, since neither source limits them and the paths have corners. Errors cost as
much as 1 at 0.1 mm, where CppFlow's threshold is.
"""

from __future__ import annotations

import functools
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ikgym import arms, problems, tasks
from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import PublishedPath, RandomPublishedPath, Trajectory
from ikgym.validation import FloatArray

#: From waypoint to waypoint in [s], and how many control steps that are.
PERIOD, STEPS = 0.2, 10
COST = TrackingCost(delta_x=1e-4)
RLITG, CPPFLOW = "MinsungYoon/RL-ITG", "jstmn/cppflow"
#: What the names of RL-ITG's random paths begin with.
RANDOM = "rlitg-random"
#: Random postures from which starts are looked for.
POSTURES = 100
# The arms of CppFlow's problems; its Panda ends at the hand, which is turned about the flange.
HAND = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 2.0**0.5]]) / 2.0**0.5


def waypoint_steps(waypoints: int) -> range:
    """After how many control steps the waypoints come; the first one is the start."""
    return range(0, STEPS * (waypoints - 1) + 1, STEPS)


def make(problem: str) -> Scenario:
    """The scenario of a problem, such as one of the hundred random paths of RL-ITG, ``rlitg-random-007``.

    Raises:
        UnknownNameError: There is no such problem; the message has the nearest name.
    """
    trajectory = PublishedPath(problem, PERIOD)
    arm = _arm("fetch_arm") if problem.startswith("rlitg") else _arm(problem.split("-")[1])
    start = None if len(trajectory.waypoints.starts) else _start(arm, trajectory)
    return _scenario(problem, arm, trajectory, len(trajectory.waypoints.positions), start)


def make_random() -> Scenario:
    """One of the hundred random paths of RL-ITG by seed; shorter ones end at rest."""
    longest = max(len(problems.waypoints(name).positions) for name in problems.names(RANDOM))
    return _scenario(RANDOM, _arm("fetch_arm"), RandomPublishedPath(f"{RANDOM}-", PERIOD), longest, None)


@functools.cache
def unreached(problem: str, restarts: int = 300) -> npt.NDArray[np.int64]:
    """Waypoints of a problem at which no joint coordinates within the limits were found, counted from 0.

    Args:
        problem: Its name.
        restarts: Random postures from which each is looked for.
    """
    scenario = make(problem)
    frames = scenario.frames(scenario.trajectory, scenario.steps + 1)[::STEPS]
    rotations, positions = frames[:, :9].reshape(-1, 3, 3), frames[:, 9:]
    return np.flatnonzero(~scenario.arm.inverse(rotations, positions, restarts=restarts)[1])


def _scenario(name: str, arm: Arm, trajectory: Trajectory, waypoints: int, start: FloatArray | None) -> Scenario:
    return Scenario(
        name,
        arm,
        tasks.get("pose"),
        trajectory,
        cost=COST,
        dt=PERIOD / STEPS,
        steps=waypoint_steps(waypoints)[-1],
        start=start,
        source=RLITG if name.startswith("rlitg") else CPPFLOW,
    )


def _arm(name: str) -> Arm:
    """An arm of the catalogue without acceleration limits."""
    arm = arms.get(name).replace(acceleration_limit=None)
    return arm.replace(tool_rotation=arm.tool_rotation @ HAND) if name == "panda" else arm


def _start(arm: Arm, trajectory: Trajectory) -> FloatArray:
    """Where CppFlow prescribes no start: of solutions from random postures, the one farthest from the limits."""
    first = trajectory.frames(np.zeros(1), arm)[0]
    lower, upper = (np.clip(limits, -np.pi, np.pi) for limits in (arm.lower, arm.upper))
    postures = np.random.default_rng(0).uniform(lower, upper, (POSTURES, arm.joints))
    poses = np.tile(first, (POSTURES, 1))
    q, converged = arm.inverse(poses[:, :9].reshape(-1, 3, 3), poses[:, 9:], postures, restarts=0)
    # Shares of the ranges; joints that turn without end have no limits to be near to.
    ranged = np.isfinite(arm.upper - arm.lower)
    below, above = (np.abs(q - limits)[:, ranged] for limits in (arm.lower, arm.upper))
    margins = (np.minimum(below, above) / (arm.upper - arm.lower)[ranged]).min(axis=1)
    start: FloatArray = q[np.argmax(np.where(converged, margins, -1.0))]
    return start


SCENARIOS: dict[str, Callable[[], Scenario]] = {name: functools.partial(make, name) for name in problems.NAMES} | {
    RANDOM: make_random
}


def names() -> tuple[str, ...]:
    """The names of the scenarios, without those of single random paths."""
    return tuple(name for name in SCENARIOS if not name.startswith(f"{RANDOM}-"))
