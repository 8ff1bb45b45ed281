"""The data model of reproductions: verdicts, figures in words, the ledger, and the episodes that claims share."""

import re

import pytest

import ikgym
from baselines.papers import PAPERS, ledger
from baselines.papers.comparisons import differ, falls
from baselines.papers.paper import Claim, Finding, Paper, in_unit
from baselines.papers.runs import Runs


@pytest.mark.parametrize(
    ("holds", "wanted"),
    [
        (True, "reproduced"),
        (False, "contradicted"),
        (None, "not testable"),
        ({1: False, 2: False, 3: False}, "contradicted"),
        ({1: True, 2: False}, "depends"),
        ({}, "contradicted"),
    ],
)
def test_a_claim_is_contradicted_only_if_it_fails_in_all_readings(holds, wanted):
    assert Finding(holds, {}).verdict == wanted


def test_figures_in_words():
    figures = {**in_unit({"fast": 0.0537, "slow": [1e-3, 2e-3]}, "mm"), "[rad]": 0.25, "steps": 7}
    assert Finding(True, figures).text == "fast 53.7 mm; slow 1, 2 mm; 0.25 rad; steps 7"


@pytest.mark.parametrize(
    ("before", "after", "wanted"),
    [(1.0, 0.8, {"a": True}), (0.8, 1.0, {"a": False}), (1.0, 0.95, {}), (0.0, 3.0, {"a": False})],
)
def test_changes_of_less_than_a_tenth_decide_nothing(before, after, wanted):
    assert falls({"a": (before, after)}) == wanted
    assert differ(before, after) == differ(after, before) == bool(wanted)


def test_a_ledger_in_words():
    def claim(name):
        return Claim(name, f"{name}.", "fig. 1", "largest, of all", lambda runs: Finding(None, {}), "open")

    paper = Paper("p", "P 2000", (), tuple(map(claim, "abc")))
    results = ledger.rows(
        {"p": {n: Finding(h, {"x [m]": 1.0}) for n, h in zip("abc", (None, True, None), strict=True)}}
    )
    text = ledger.markdown([paper], results)
    assert "2 not testable, 1 reproduced." in text
    assert "| a. (fig. 1) | largest, of all | x 1 m | *not testable*: open |" in text


def test_episodes_are_identified_by_the_content_of_their_scenarios():
    runs = Runs(steps=5)
    scenario = ikgym.scenarios.get("faitli3-regular")
    slower = scenario.replace(dt=5e-4)
    assert slower.name == scenario.name
    one = runs.play("faitli3-regular", "dls")
    assert runs.play(scenario, "dls") is one
    assert runs.play(slower, "dls") is not one
    assert len(one.q) == 5


@pytest.mark.parametrize("name", PAPERS)
def test_texts_of_claims_fit_a_table(name):
    paper = PAPERS[name]
    assert paper.name == name
    assert len({claim.text for claim in paper.claims}) == len(paper.claims)
    for claim in paper.claims:
        assert all((claim.text, claim.where, claim.method))
        assert not re.search(r"[|\n]", claim.text + claim.where + claim.method + claim.condition)
