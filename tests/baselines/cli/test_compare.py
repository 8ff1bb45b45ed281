"""``ikgym compare`` on arms that are not in the catalogue."""

import re
from pathlib import Path

import pytest

from baselines.cli import main
from baselines.evaluation.compare.rule import PREFERRED

ROBOTS = Path(__file__).parents[2] / "robots"
#: Path, chain and speed of each robot, and the solvers that may be recommended.
ARMS = {
    "ur10": ("ur10_circle", ("base_link", "tool0"), 0.1),
    "ur10_rail": ("ur10_rail_line", ("world", "tool0"), 0.4),
    "baxter": ("baxter_circle", ("torso", "left_gripper"), 0.2),
    "pr2": ("pr2_circle", ("base_link", "r_gripper_tool_frame"), 0.1),
}


def compared(robot, path, capsys, *options):
    """Lines of the table by solver and path, and what is recommended."""
    _, (base, tip), speed = ARMS[robot]
    words = ["compare", str(ROBOTS / f"{robot}.urdf"), str(path), "--base", base, "--tip", tip, "--speed", str(speed)]
    assert main([*words, "--acceleration", "8", *options]) == 0
    text = capsys.readouterr().out
    rows = re.findall(rf"^({'|'.join(PREFERRED)}) +(as it is|retimed|late drives) .* (yes|no)$", text, re.MULTILINE)
    return {(solver, path): follows for solver, path, follows in rows}, text


@pytest.mark.parametrize("robot", ["ur10", "baxter"])
def test_a_short_path(robot, capsys, tmp_path):
    """The first points of the path in large steps."""
    lines = (ROBOTS / f"{ARMS[robot][0]}.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "short.csv").write_text("\n".join(lines[:3]), encoding="utf-8")
    rows, text = compared(robot, tmp_path / "short.csv", capsys, "--dt", "0.01")
    assert rows["qp", "as it is"] == "yes"
    assert ("sns", "late drives") in rows
    assert re.search(r"^Recommended: (qp|sns)\.", text, re.MULTILINE)
