"""What the papers' claims share: verdicts by reading, and episodes of scenarios that are not in the catalogue."""

from __future__ import annotations

import pytest

import ikgym
from baselines.papers.ledger import ledger
from baselines.papers.paper import Claim, Paper, by_reading
from baselines.papers.runs import Runs


@pytest.mark.parametrize(
    ("holds", "wanted"),
    [
        ([True, True], "reproduced"),
        ([False, False, False], "contradicted"),
        ([True, False], "depends"),
        ([False, True, True], "depends"),
    ],
)
def test_a_claim_with_readings(holds, wanted):
    finding = by_reading(iter(holds), "evidence", number=3)
    assert finding == (wanted, "evidence", {"number": 3})


@pytest.mark.parametrize(("holds", "counts"), [([True, False], "1 depends."), ([True], "1 reproduced.")])
def test_the_ledger_counts_verdicts_that_occur(holds, counts):
    claim = Claim("one", "It works.", "section 1", "seen", lambda _: by_reading(holds, "so it is"))
    paper = Paper("p", "A paper", (), (claim,), ())
    text = ledger([paper], {"p": {"one": claim.test(Runs())}})
    assert f"\n{counts}\n" in text


def test_runs_tell_scenarios_by_their_content():
    runs = Runs(steps=5)
    scenario = ikgym.scenarios.get("faitli3-regular")
    slower = scenario.replace(dt=5e-4)
    assert slower.name == scenario.name
    one = runs.play("faitli3-regular", "dls")
    assert runs.play(scenario, "dls") is one
    assert runs.play(slower, "dls") is not one
    assert len(one.q) == 5
