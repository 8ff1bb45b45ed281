"""What the papers' claims share: verdicts by reading, and episodes of scenarios that are not in the catalogue."""

from __future__ import annotations

import pytest

import ikgym
from baselines.papers.ledger import ledger
from baselines.papers.paper import Claim, Finding, Paper, verdict_by_condition
from baselines.papers.runs import Runs


@pytest.mark.parametrize(
    ("holds", "wanted"),
    [
        ((True, True), "reproduced"),
        ((False, False, False), "contradicted"),
        ((True, False), "depends"),
        ((False, True, True), "depends"),
    ],
)
def test_a_claim_is_contradicted_only_if_it_fails_in_all_readings(holds, wanted):
    finding = verdict_by_condition(dict(enumerate(holds)), "1 m", error_m=1.0)
    assert finding == Finding(wanted, "1 m", {"error_m": 1.0})


def test_counts_name_what_there_is():
    def claim(name):
        return Claim(name, f"{name}.", "fig. 1", "played", lambda runs: Finding("depends", "", {}))

    paper = Paper("p", "P 2000", (), tuple(map(claim, "abc")), ())
    found = {n: Finding(v, "1 m", {}) for n, v in zip("abc", ("depends", "reproduced", "depends"), strict=True)}
    assert "2 depends, 1 reproduced." in ledger([paper], {"p": found})


def test_runs_tell_scenarios_by_their_content():
    runs = Runs(steps=5)
    scenario = ikgym.scenarios.get("faitli3-regular")
    slower = scenario.replace(dt=5e-4)
    assert slower.name == scenario.name
    one = runs.play("faitli3-regular", "dls")
    assert runs.play(scenario, "dls") is one
    assert runs.play(slower, "dls") is not one
    assert len(one.q) == 5
