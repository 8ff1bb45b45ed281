"""Scores on the validation split are those of an evaluation."""

import numpy as np
import pytest

import baselines
from baselines.evaluate import evaluate
from baselines.oracle import best_known
from baselines.statistics import geometric_mean
from baselines.training.run import validate
from ikgym import scenarios

SCENARIO = scenarios.get("varga7-random").replace(steps=40)


def test_scores_are_those_of_an_evaluation():
    rows = evaluate(SCENARIO, "mfac", split="validation", episodes=3)
    found = validate(baselines.make("mfac", SCENARIO), SCENARIO, 3)
    assert ("cost_ratio" in found, found["lost"]) == (False, 0.0)
    assert found["cost"] == pytest.approx(geometric_mean([row.total_cost for row in rows]), rel=1e-12)
    assert found["worst"] == max(row.total_cost for row in rows)
    assert found["position_error_max_mm"] == pytest.approx(1e3 * np.mean([row.position_error_max for row in rows]))
    assert found["orientation_error_max_mrad"] == pytest.approx(
        1e3 * np.mean([row.orientation_error_max for row in rows])
    )


def test_lost_arms_are_counted():
    scenario = SCENARIO.replace(steps=300)
    assert validate(baselines.make("dls", scenario, damping=1e3), scenario, 4)["lost"] == 1.0


def test_cost_ratios_are_over_the_best_known_costs(monkeypatch):
    policy = baselines.make("dls", SCENARIO)
    plain = validate(policy, SCENARIO, 2)
    monkeypatch.setattr(best_known, "costs", lambda scenario, seeds: [2.0, 8.0])
    found = validate(policy, SCENARIO, 2)
    assert found["cost_ratio"] == pytest.approx(plain["cost"] / 4.0, rel=1e-12)
    assert found["worst"] < plain["worst"]
    monkeypatch.setattr(best_known, "costs", lambda scenario, seeds: [2.0, None])
    assert validate(policy, SCENARIO, 2) == plain
