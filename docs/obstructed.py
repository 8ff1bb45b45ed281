"""The table `obstructed`: problems with obstacles that others published, by CppFlow's rule.

`obstructed_paths.csv` has a line for each problem, and the table its sums. A line that is there is not measured
again. The start is free: `qp` plays from up to a hundred postures at the first pose, `rhc_foresight` from the start
of the planned path. The joint velocities of both are limited to 7° a waypoint. :func:`verdict` is CppFlow's rule.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

import baselines
from baselines.episodes import rollout
from baselines.paths import motion
from baselines.paths.routes import Routes
from baselines.paths.starts import solutions
from docs.keeping import Line, keep, lines
from ikgym import problems, scenarios
from ikgym.kernels.rotations import geodesic_angle
from ikgym.scenarios import Scenario
from ikgym.trajectories import PublishedPath
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray

PATHS = "obstructed_paths"
#: Sets of problems by the beginnings of their names.
SETS = {"RL-ITG, drawn": "rlitg-s", "RL-ITG, random": "rlitg-obstacle", "CppFlow": "cppflow"}
#: Columns of the table: the planned path, solvers, and the trajectory that was published.
POLICIES = ("planned", "qp", "rhc_foresight", "published")
#: Steps from waypoint to waypoint, most postures from which `qp` begins, and a finer search where there is no way.
STRIDE, STARTS, FINE = 10, 100, MappingProxyType({"cell": 0.3, "postures": 2500})
#: Errors of the tool in [m] and [rad], and joint motions between waypoints in [rad], and in [m] of a prismatic joint,
#: that a passed problem stays below (Morgan, Millard and Sukhatme 2024).
POSITION, ORIENTATION, TURN, TRAVEL = 1e-4, np.radians(0.1), np.radians(7.0), 0.02


@dataclasses.dataclass(frozen=True)
class Verdict:
    """Errors, motions and clearance of a joint path at the waypoints of a problem."""

    position: float  # largest error in [m]
    orientation: float  # largest error in [rad]
    turn: float  # largest motion of a revolute joint between two waypoints, in [rad]
    travel: float  # likewise of a prismatic joint, in [m]
    within: bool  # whether the joints are within their limits
    clearance: float  # smallest signed distance between bodies in [m]; infinite where none can meet

    @property
    def followed(self) -> bool:
        """Whether the tool is on the path."""
        return self.position < POSITION and self.orientation < ORIENTATION

    @property
    def passed(self) -> bool:
        """Whether the path is followed in small joint motions, within the limits, and without a collision."""
        smooth = self.turn < TURN and self.travel < TRAVEL
        return self.followed and smooth and self.within and self.clearance > 0.0


def verdict(scenario: Scenario, q: FloatArray) -> Verdict:
    """Judges joint coordinates (k, n) in [rad] or [m] at the waypoints of a published path, by our bodies."""
    assert isinstance(scenario.trajectory, PublishedPath)
    arm, (positions, quaternions, *_) = scenario.arm, problems.get(scenario.trajectory.problem)
    rotations, there = arm.forward(q)
    endless = np.isinf(arm.upper - arm.lower)
    moved = np.abs(np.diff(q, axis=0))
    moved = np.where(endless, np.abs(np.remainder(moved + np.pi, 2.0 * np.pi) - np.pi), moved)
    sliding = arm.chain.prismatic
    return Verdict(
        position=float(np.linalg.norm(there - positions, axis=1).max()),
        orientation=float(max(map(geodesic_angle, rotations, matrices(quaternions)))),
        turn=float(moved[:, ~sliding].max()),
        travel=float(moved[:, sliding].max(initial=0.0)),
        within=bool(((q >= arm.lower) & (q <= arm.upper)).all()),
        clearance=float(arm.clearance(q, scenario.obstacles)[0].min()),
    )


def line(name: str) -> Line:
    """What passes of a problem, and how many of its poses can be reached, with and without collisions."""
    scenario = scenarios.get(name)
    alone, poses = scenario.replace(collisions=False), len(problems.get(name).positions)
    found = route(scenario)
    free = found if len(found) == poses else route(alone)
    if len(free) < poses:
        free = route(alone, FINE)
    if len(found) < len(free):
        found = route(scenario, FINE)
    whole = len(found) == poses
    out: Line = {"problem": name, "poses": poses, "reached": len(found), "without_collisions": len(free)}
    out["planned"] = int(whole and verdict(scenario, found).passed)
    out["rhc_foresight"] = int(whole and judge(scenario, found[0]).passed)
    passed, starts = among_starts(scenario)
    out |= {"qp": int(passed > 0), "qp_passed": passed, "qp_starts": starts}
    theirs = [verdict(scenario, joints) for joints in problems.get(name).trajectories.values()]
    return out | {
        "published": sum(one.passed for one in theirs),
        "published_clear": sum(one.clearance > 0.0 for one in theirs),
    }


def route(scenario: Scenario, search: Mapping[str, Any] = MappingProxyType({})) -> FloatArray:
    """The way along the waypoints, as far as there is one, from any start."""
    largest = np.where(scenario.arm.prismatic, TRAVEL, TURN)
    return Routes(scenario, scenario.times(scenario.steps + 1)[::STRIDE], largest, **search).route()


def judge(scenario: Scenario, start: FloatArray) -> Verdict:
    """How `rhc_foresight` follows from a start."""
    begun = slow(scenario.replace(start=start))
    outcome = rollout(begun, baselines.make("rhc_foresight", begun), 0, timed=False)
    return verdict(scenario, np.vstack([start, outcome.q[STRIDE - 1 :: STRIDE]]))


def slow(scenario: Scenario) -> Scenario:
    """The scenario with joint velocities of at most 7° a waypoint."""
    arm, period = scenario.arm, STRIDE * scenario.dt
    most = np.minimum(arm.velocity_limit, (1.0 - 1e-4) * np.where(arm.prismatic, TRAVEL, TURN) / period)
    return scenario.replace(arm=arm.replace(velocity_limit=most), velocity_limit=most)


def among_starts(scenario: Scenario) -> tuple[int, int]:
    """From how many starts `qp` passes, and of how many."""
    held = motion.ideal(slow(scenario))
    q = solutions(held)
    q = q[scenario.arm.clearance(q, scenario.obstacles)[0] > 0.0][:STARTS]
    paths = motion.play_from(held, q).q[::STRIDE] if len(q) else np.empty((0, 0, 0))
    return sum(verdict(scenario, paths[:, i]).passed for i in range(len(q))), len(q)


def table(problem_lines: Sequence[Line]) -> list[Line]:
    """How many problems have a way, and how many each policy passes."""
    out = []
    for label, beginning in SETS.items():
        here = [one for one in problem_lines if one["problem"].startswith(beginning)]
        ways = {
            key: sum(int(one[key]) == int(one["poses"]) for one in here) for key in ("without_collisions", "reached")
        }
        passed = {policy: sum(int(one[policy]) for one in here) for policy in POLICIES}
        out.append({"set": label, "problems": len(here), **ways, **passed})
    return out


def measure() -> list[Line]:
    """The table, after what is missing was measured."""
    done = lines(PATHS)
    for name in problems.OBSTRUCTED:
        if not any(one["problem"] == name for one in done):
            done.append(line(name))
            keep(PATHS, done)
            print(" ".join(map(str, done[-1].values())), flush=True)
    return table(done)
