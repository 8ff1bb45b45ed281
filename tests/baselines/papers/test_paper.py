"""Verdicts on claims that were tested in several readings."""

from __future__ import annotations

import pytest

from baselines.papers.ledger import ledger
from baselines.papers.paper import Claim, Finding, Paper, verdict_by_condition


@pytest.mark.parametrize(
    ("holds", "wanted"),
    [((True, True), "reproduced"), ((False, False), "contradicted"), ((True, False), "depends")],
)
def test_a_claim_is_contradicted_only_if_it_fails_in_all_readings(holds, wanted):
    finding = verdict_by_condition(dict(zip("ab", holds, strict=True)), "1 m", error_m=1.0)
    assert finding == Finding(wanted, "1 m", {"error_m": 1.0})


def test_counts_name_what_there_is():
    def claim(name):
        return Claim(name, f"{name}.", "fig. 1", "played", lambda runs: Finding("depends", "", {}))

    paper = Paper("p", "P 2000", (), tuple(map(claim, "abc")), ())
    found = {n: Finding(v, "1 m", {}) for n, v in zip("abc", ("depends", "reproduced", "depends"), strict=True)}
    assert "2 depends, 1 reproduced." in ledger([paper], {"p": found})
