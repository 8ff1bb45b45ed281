"""The table `compare`: ``ikgym compare`` on four arms that are not in the catalogue."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

from baselines.cli.own_path import OwnPath, scenario_of
from baselines.evaluation.compare import Comparison, compare
from baselines.evaluation.compare.playing import AS_IT_IS, LATE, RETIMED, solver_of
from baselines.evaluation.compare.rule import PREFERRED, Rows, fault
from baselines.evaluation.table import number
from docs.keeping import Line
from ikgym.scenarios import Scenario

FOLDER = Path(__file__).parents[1] / "tests" / "robots"


class Robot(NamedTuple):
    """A chain of a URDF file, and the speed of its tool in [m/s] on the path of the same name."""

    base: str
    tip: str
    speed: float

    def scenario(self, name: str) -> Scenario:
        """Its scenario; accelerations of at most 5 rad/s² or m/s²."""
        arm, path = (str(FOLDER / f"{name}.{ending}") for ending in ("urdf", "csv"))
        options = {"arm": arm, "base": self.base, "tip": self.tip, "speed": self.speed}
        return scenario_of(OwnPath(path, acceleration=(5.0,), **options))  # type: ignore[arg-type]


ROBOTS = {
    "ur10": Robot("base_link", "tool0", 1.0),
    "ur10_rail": Robot("world", "tool0", 0.2),
    "baxter": Robot("torso", "left_gripper", 0.8),
    "pr2": Robot("base_link", "r_gripper_tool_frame", 0.5),
}


def lines(name: str, found: Comparison) -> list[Line]:
    """The largest position errors in [mm], one line a path; a cross where a solver does not follow."""
    chosen, out = found.recommendation, []
    for path in (AS_IT_IS, RETIMED, LATE):
        rows: Rows = {solver_of(row): row for row in found.rows if row.scenario == path}
        cells = {f"{solver}_mm": _cell(rows, solver, found.dt) for solver in PREFERRED}
        taken = path == (RETIMED if chosen.retimed else AS_IT_IS)
        out.append({"arm": name, "path": path, **cells, "recommended": chosen.solver if taken else ""})
    return out


def _cell(rows: Rows, solver: str, dt: float) -> str:
    if solver not in rows:
        return ""
    return number(1e3 * rows[solver].position_error_max) + " ✗" * bool(fault(rows[solver], dt))


def measured() -> list[Line]:
    """The table."""
    table = []
    for name, robot in ROBOTS.items():
        found = compare(robot.scenario(name), progress=True)
        print(f"{name}, {robot.speed} m/s\n\n{found.table()}\n", file=sys.stderr)
        table += lines(name, found)
    return table
