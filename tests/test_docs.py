"""Prose, tables and snippets hold: they are executed, or compared with what the code says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import baselines
import ikgym
from baselines import registry
from baselines.evaluate import evaluate
from docs.tables import PAGES, filled

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PROSE = [*ROOT.glob("*.md"), *sorted(PAGES.glob("*.md"))]


@pytest.mark.parametrize("page", sorted(PAGES.glob("*.md")), ids=lambda page: page.name)
def test_tables_are_up_to_date(page):
    text = page.read_text(encoding="utf-8")
    assert filled(text) == text, "write the tables anew with: python -m docs.tables"


def test_readme_snippets_run(capsys):
    snippets = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    assert len(snippets) == 2
    for snippet in snippets:
        lines = [line for line in snippet.splitlines() if line.strip() and not line.startswith(("import", "from"))]
        assert len(lines) <= 10
        exec(snippet, {})
    printed = capsys.readouterr().out
    assert "'nominal': (2, 6)" in printed
    cost = float(re.search(r"cost (\S+)", printed)[1])
    assert cost == pytest.approx(cells()["dls"]["total cost"], rel=1e-3)


def cells() -> dict[str, dict[str, float]]:
    """The README's table of the demo: policy, column, number."""
    table = re.search(r"<!-- demo -->\n(.*?)<!-- end -->", README, re.DOTALL)[1].strip()
    head, _, *lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()]
    return {
        line[0].split()[0]: {
            key: float(value) if re.match(r"[\d.]", value) else value for key, value in zip(head, line, strict=True)
        }
        for line in lines
    }


def test_readme_table_is_what_the_demo_prints():
    shown = cells()
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    rows = evaluate("varga7-fast", re.search(r"^DEMO := (.*)$", makefile, re.MULTILINE)[1].split())
    assert list(shown) == [row.policy for row in rows]
    for row in rows:
        # Where the path was lost, or nothing but rounding is left, another processor may print other digits.
        lost = row.position_error_max > 1.0
        for key, value in {
            "total cost": row.total_cost,
            "tracking cost": row.tracking_cost,
            "velocity cost": row.velocity_cost,
            "pos max [mm]": 1e3 * row.position_error_max,
            "ori max [mrad]": 1e3 * row.orientation_error_max,
            "q̇ peak": row.qdot_peak,
        }.items():
            if value < 1e-3:
                assert shown[row.policy][key] < 1e-3
            else:
                assert shown[row.policy][key] == pytest.approx(value, rel=0.5 if lost else 2e-3), (row.policy, key)
        assert shown[row.policy]["status"] == row.status


def test_what_readme_says_of_its_table():
    assert "about ten times the computing time" in README
    assert cells()["rhc_foresight"]["total cost"] < cells()["follow_nominal"]["total cost"]
    assert 5 < cells()["rhc_gradient"]["p50 [µs]"] / cells()["dls"]["p50 [µs]"] < 20


@pytest.mark.parametrize("page", PROSE, ids=lambda page: page.name)
def test_links_and_commands_exist(page):
    text = page.read_text(encoding="utf-8")
    for target in re.findall(r"\]\(([^)#]+)\)", text):
        if "://" not in target:
            assert (page.parent / target).exists(), target
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in re.findall(r"(?:^|`)make (\w+)", text, re.MULTILINE):
        assert re.search(rf"^{target}:", makefile, re.MULTILINE), target
    for path in re.findall(r"`((?:ikgym|baselines|docs|tests|benchmarks|examples)/[\w./]*)`", text):
        assert (ROOT / path).exists(), path


def test_make_help_lists_every_target():
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    phony = re.search(r"^\.PHONY: (.*)$", makefile, re.MULTILINE)[1].split()
    assert set(re.findall(r"^(\w+):.*##", makefile, re.MULTILINE)) == set(phony)


def test_changelog_counts_right():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert f"- {len(ikgym.scenarios.names())} scenarios" in text
    assert f"## {ikgym.__version__}" in text or "## Unreleased" in text


def snippets_of(page):
    return re.findall(r"```python\n(.*?)```", (PAGES / page).read_text(encoding="utf-8"), re.DOTALL)


def test_evaluation_snippets_run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names = {}
    for snippet in snippets_of("evaluation.md"):
        exec(compile(snippet, "evaluation.md", "exec", dont_inherit=True), names)
    printed = capsys.readouterr().out
    assert "('dls', 0.01, " in printed
    assert "(200, 7)" in printed
    assert "Still unknown 2" in printed
    assert {file.name for file in tmp_path.iterdir()} == {"dls.csv", "dls.png"}


def test_policies_snippets_run(monkeypatch):
    monkeypatch.setattr(registry, "_places", dict(registry._places))
    monkeypatch.setattr(registry, "_classes", dict(registry._classes))
    own, real = snippets_of("policies.md")
    names = {"__name__": __name__}
    exec(compile(own, "policies.md", "exec", dont_inherit=True), names)
    assert [(row.policy, row.parameters.get("gain")) for row in names["rows"]] == [
        ("proportional", 1.0),
        ("proportional", 0.5),
        ("dls", 1.0),
    ]
    exec(compile(real, "policies.md", "exec", dont_inherit=True), names)
    assert abs(names["arm"].forward(names["measured"])[1] - names["positions"][100]).max() < 5e-2  # of an arm of 5 m
    assert baselines.track("varga7-fast", "rhc_gradient", steps=100).q[-1] == pytest.approx(names["measured"])


def test_changelog_names_every_policy():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert all(f"`{name}`" in text for name in baselines.names())
