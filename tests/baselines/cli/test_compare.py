"""``ikgym compare`` on arms that are not in the catalogue."""

import re

import pytest

from baselines.cli import main
from baselines.evaluation.compare.rule import PREFERRED
from docs import keeping
from docs.compare import FOLDER, ROBOTS


def compared(robot, path, capsys, *options):
    """Whether solvers follow, by solver and path, and the text."""
    base, tip, _ = ROBOTS[robot]
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
def test_the_arms_of_the_page(robot, capsys):
    rows, text = compared(robot, FOLDER / f"{robot}.csv", capsys, "--speed", str(ROBOTS[robot].speed))
    lines = [one for one in keeping.lines("compare") if one["arm"] == robot]
    (chosen,) = (line for line in lines if line["recommended"])
    on_the_path = " on the retimed path" * (chosen["path"] == "retimed")
    assert re.search(rf"^Recommended: {chosen['recommended']}{on_the_path}[.,]", text, re.MULTILINE)
    for line in lines:
        said = {name: "no" if "✗" in line[f"{name}_mm"] else "yes" for name in ("qp", "sns", "dls")}
        assert {name: rows[name, line["path"]] for name in said} == said
