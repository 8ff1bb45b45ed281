"""Problems with obstacles that others published, by CppFlow's rule: ``python -m docs.obstructed``.

Writes `results/obstructed.csv`, a line for each problem; a line that stands there is not measured again. The start is
free: `qp` plays from up to a hundred postures at the first pose, `rhc_foresight` from the start that `planned` has. The
joint velocities of both are limited to 7° a waypoint.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

import baselines
from baselines.episodes import rollout
from baselines.evaluation.motion.published_rule import TRAVEL, TURN, Verdict, verdict
from baselines.evaluation.records import from_csv, to_csv
from baselines.files import write
from baselines.paths import motion
from baselines.paths.routes import Routes
from baselines.paths.starts import solutions
from ikgym import problems, scenarios
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

RESULTS = Path(__file__).parent / "results" / "obstructed.csv"
#: Steps from waypoint to waypoint, postures from which `qp` begins, and the second search of a way, which is finer.
STRIDE, STARTS, FINE = 10, 100, {"cell": 0.3, "postures": 2500}


def line(name: str) -> dict[str, Any]:
    """What passes of a problem, and how many of its poses can be reached, with and without collisions."""
    scenario = scenarios.get(name)
    poses = len(problems.waypoints(name).positions)
    found = route(scenario)
    whole = len(found) == poses
    out: dict[str, Any] = {"problem": name, "poses": poses, "reached": len(found)}
    out["without_collisions"] = poses if whole else len(route(scenario.replace(collisions=False)))
    for policy in ("planned", "rhc_foresight"):
        out[policy] = int(judged(scenario, found[0], policy).passed) if whole else 0
    passed, starts = among_starts(scenario)
    return out | {"qp": int(passed > 0), "qp_passed": passed, "qp_starts": starts}


def route(scenario: Scenario) -> FloatArray:
    """The way along the waypoints, as far as there is one, from any start."""
    knots = scenario.times(scenario.steps + 1)[::STRIDE]
    largest = np.where(scenario.arm.prismatic, TRAVEL, TURN)
    found = Routes(scenario, knots, largest).route()
    return found if len(found) == len(knots) else Routes(scenario, knots, largest, **FINE).route()  # type: ignore[arg-type]


def judged(scenario: Scenario, start: FloatArray, policy: str) -> Verdict:
    """How a policy follows from a start."""
    begun = scenario.replace(start=start)
    if policy == "planned":
        played = baselines.make(policy, begun, largest=TURN)
    else:
        begun = slow(begun)
        played = baselines.make(policy, begun)
    outcome = rollout(begun, played, 0, timed=False)
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
    paths = motion.played(held, q).q[::STRIDE] if len(q) else np.empty((0, 0, 0))
    return sum(verdict(scenario, paths[:, i]).passed for i in range(len(q))), len(q)


def main() -> None:
    """Measures what is missing."""
    lines = list(from_csv(RESULTS.read_text(encoding="utf-8"))) if RESULTS.exists() else []
    for name in problems.OBSTRUCTED:
        if not any(one["problem"] == name for one in lines):
            lines.append(line(name))
            write(RESULTS, to_csv(lines).encode())
            print(" ".join(map(str, lines[-1].values())), flush=True)


if __name__ == "__main__":
    main()
