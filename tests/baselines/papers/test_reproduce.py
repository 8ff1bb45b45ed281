"""Reproductions: every figure of every paper is drawn, every claim tested, and the ledger in the tree is up to date."""

import dataclasses
import json
import pathlib
import re

import pytest

from baselines.cli.commands.reproduce import main
from baselines.evaluation.table import from_csv
from baselines.papers import PAPERS, ledger
from baselines.papers.paper import Finding
from baselines.papers.runs import Runs

#: One figure for each function that draws and each episode.
OF_EACH_KIND = {"varga": [2, 5, 6, 8, 9, 11], "khan": [3, 7, 8, 11, 14, 18, 19]}
VERDICTS = ("reproduced", "contradicted", "depends", "not testable")
#: A point of Khan's path takes 60 steps.
STEPS = {"varga": 20, "faitli": 20, "khan": 60, "zhang": 20}
DOCS = pathlib.Path(__file__).parents[3] / "docs"
REMEDY = "`ikgym reproduce` and `python -m docs.paper_pages results/papers` write it"

papers = pytest.mark.parametrize("name", PAPERS)


@papers
def test_figures_are_drawn(name):
    """Without a file, most of whose time is the layout of texts."""
    runs = Runs(STEPS[name])
    for figure in PAPERS[name].figures:
        if figure.number in OF_EACH_KIND.get(name, range(20)):
            assert figure.draw(runs).axes, figure.number


@papers
def test_the_command_draws_and_tests_everything(name, tmp_path, monkeypatch, capsys):
    """In short episodes, with one figure for all."""
    paper = dataclasses.replace(PAPERS[name], figures=PAPERS[name].figures[:1])
    monkeypatch.setitem(PAPERS, name, paper)
    assert main(["--paper", name, "--steps", str(STEPS[name]), "--out", str(tmp_path)]) == 0
    results = from_csv((tmp_path / "claims.csv").read_text())
    assert [row["claim"] for row in results] == [claim.name for claim in paper.claims]
    assert all(row["verdict"] in VERDICTS for row in results)
    (figure,) = paper.figures
    assert len((tmp_path / name / f"figure-{figure.number:02d}.png").read_bytes()) > 8000
    claims = json.loads((tmp_path / name / "numbers.json").read_text(), parse_constant=pytest.fail)["claims"]
    assert {claim: v["verdict"] for claim, v in claims.items()} == {row["claim"]: row["verdict"] for row in results}
    assert (tmp_path / "papers.md").read_text() == ledger.markdown([paper], results)
    out = capsys.readouterr().out
    for row in results:
        assert re.search(rf"^{name} +{row['verdict']} +{row['claim']}: ", out, re.MULTILINE)


def test_the_command_draws_figures_alone(capsys, tmp_path):
    words = ["--paper", "zhang", "--figure", "9", "3", "--steps", "20", "--out", str(tmp_path / "new")]
    assert main(words) == 0
    out, err = capsys.readouterr()
    files = sorted(p.relative_to(tmp_path / "new").as_posix() for p in (tmp_path / "new").rglob("*.*"))
    assert files == ["zhang/figure-03.png", "zhang/figure-09.png"]
    assert "figure-09.png: Iteration count" in err
    assert str(tmp_path / "new") in out


def in_the_tree():
    """Verdicts and figures in docs/results/papers.csv, by paper and claim."""
    results = {}
    for row in from_csv((DOCS / "results" / "papers.csv").read_text(encoding="utf-8")):
        results.setdefault(row["paper"], {})[row["claim"]] = row["verdict"], row["figures"]
    return results


@papers
def test_the_ledger_has_these_claims(name):
    results = in_the_tree()[name]
    assert list(results) == [claim.name for claim in PAPERS[name].claims], REMEDY
    for claim in PAPERS[name].claims:
        verdict, figures = results[claim.name]
        assert verdict in VERDICTS
        assert (claim.condition != "") == (verdict in ("depends", "not testable")), claim.name
        assert figures or verdict == "not testable"


NUMBER = re.compile(r"(?<![\w.])-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def difference(now, then):
    """Why two lines of figures differ: numbers by more than 5 %, or other numbers; None if they do not.

    Numbers below 1e-9 are rounding errors, which differ between machines.
    """
    a, b = (list(map(float, NUMBER.findall(text))) for text in (now, then))
    if len(a) != len(b):
        return f"{len(a)} numbers instead of {len(b)}"
    for x, y in zip(a, b, strict=True):
        if abs(x - y) > 0.05 * max(abs(x), abs(y)) and max(abs(x), abs(y)) > 1e-9:
            return f"{x:g} instead of {y:g}"
    return None


#: Claims whose episodes have many times the steps of all others together, variants of methods side by side. They are
#: tested where the ledger is written; a change of a method shows in the other claims.
LONG = {
    "varga": {"printed_step", "limit_reached"},
    "khan": {
        *("compensates_position", "compensates_orientation", "compensates_manufacturing", "needs_precise_measurement"),
        *("counter_rotation", "twelve_dimensions", "dinevas_iteration", "j_prev_a", "no_exploration", "less_hectic"),
        *("sign_works_for_two_joints", "sign_variant"),
    },
}
#: Claims that measure time, which needs the machine for itself: they are tested where the ledger is written, too.
TIMED = {
    "varga": {"offline_only", "time_proportional", "multipliers_cost_more"},
    "zhang": {"inverse_of_18", "less_calculation"},
}


@pytest.mark.slow
@papers
def test_the_ledger_is_up_to_date(name):
    """Whole episodes."""
    runs, left_out, wrong = Runs(), LONG.get(name, set()) | TIMED.get(name, set()), []
    assert {claim.name for claim in PAPERS[name].claims} > left_out
    for claim in PAPERS[name].claims:
        if claim.name in left_out:
            continue
        finding: Finding = claim.test(runs)
        verdict, figures = in_the_tree()[name][claim.name]
        if finding.verdict != verdict or difference(finding.text, figures):
            wrong.append(f"{claim.name}: {finding.verdict}: {finding.text}\n  instead of {verdict}: {figures}")
    assert not wrong, f"{REMEDY}\n" + "\n".join(wrong)
