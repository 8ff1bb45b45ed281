"""``ikgym compare`` on arms that are not in the catalogue."""

import re

import pytest

from baselines.cli import main
from baselines.evaluation.compare.rule import PREFERRED
from tests.robots import FOLDER, ROBOTS


def compared(robot, path, capsys, *options):
    """Whether solvers follow, by solver and path, and the text."""
    base, tip, *_ = ROBOTS[robot]
    words = ["compare", str(FOLDER / f"{robot}.urdf"), str(path), "--base", base, "--tip", tip, "--acceleration", "5"]
    assert main([*words, *options]) == 0
    text = capsys.readouterr().out
    rows = re.findall(rf"^({'|'.join(PREFERRED)}) +(as it is|retimed|late drives) .* (yes|no)$", text, re.MULTILINE)
    return {(solver, path): follows for solver, path, follows in rows}, text


def test_a_short_path(capsys, tmp_path):
    """The first points of the path in large steps."""
    lines = (FOLDER / "ur10.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "short.csv").write_text("\n".join(lines[:3]), encoding="utf-8")
    rows, text = compared("ur10", tmp_path / "short.csv", capsys, "--speed", "0.1", "--dt", "0.01")
    assert rows["qp", "as it is"] == "yes"
    assert ("sns", "late drives") in rows
    assert re.search(r"^Recommended: (qp|sns|rhc_foresight)\.", text, re.MULTILINE)


@pytest.mark.slow
@pytest.mark.parametrize("robot", ROBOTS)
def test_recommendations(robot, capsys):
    _, text = compared(robot, FOLDER / f"{robot}.csv", capsys, "--speed", str(ROBOTS[robot].speed))
    assert re.search(rf"^Recommended: {ROBOTS[robot].recommended}[.,]", text, re.MULTILINE)
