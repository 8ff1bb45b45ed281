"""Scores on the validation split are those of an evaluation."""

import json

import numpy as np
import pytest

import baselines
from baselines.episodes import rollouts
from baselines.evaluate import evaluate
from baselines.fingerprints import fingerprint
from baselines.statistics import geometric_mean
from baselines.training import validation
from baselines.training.validation import record_of, reference_costs, score, validation_seeds
from ikgym import scenarios, tasks

SCENARIO = scenarios.get("varga7-random").replace(steps=40)


def test_scores_are_those_of_an_evaluation():
    rows = evaluate(SCENARIO, "mfac", split="validation", episodes=3)
    found = score(baselines.make("mfac", SCENARIO), SCENARIO, 3)
    assert (found.cost_ratio, found.episodes, found.lost) == (None, 3, 0.0)
    assert found.cost == pytest.approx(geometric_mean([row.total_cost for row in rows]), rel=1e-12)
    assert found.worst == max(row.total_cost for row in rows)
    assert found.position_error_max_mm == pytest.approx(1e3 * np.mean([row.position_error_max for row in rows]))
    assert found.orientation_error_max_mrad == pytest.approx(1e3 * np.mean([row.orientation_error_max for row in rows]))


def test_lost_arms_are_counted():
    scenario = SCENARIO.replace(steps=300)
    assert score(baselines.make("dls", scenario, damping=1e3), scenario, 4).lost == 1.0


def test_cost_ratio_is_over_the_reference(monkeypatch):
    policy, seeds = baselines.make("dls", SCENARIO), validation_seeds(SCENARIO, 2)
    costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in rollouts(SCENARIO, policy, seeds)]
    record = {"fingerprint": fingerprint(SCENARIO), "seeds": list(seeds), "costs": np.array(costs) / [2.0, 8.0]}
    monkeypatch.setattr(validation, "_records", lambda: [record])
    found = score(policy, SCENARIO, 2)
    assert found.cost_ratio == pytest.approx(4.0, rel=1e-12)
    assert found.worst == pytest.approx(8.0, rel=1e-12)
    assert score(policy, SCENARIO, 3).cost_ratio is None
    assert reference_costs(fingerprint(SCENARIO.replace(dt=2e-3)), seeds) is None


def recorded(task):
    """A scenario, and its record."""
    scenario = scenarios.get(validation.SCENARIO).replace(task=tasks.get(task))
    records = json.loads(validation.FILE.read_text(encoding="utf-8"))
    return scenario, next(record for record in records if record["task"] == task)


@pytest.mark.parametrize("task", validation.TASKS)
def test_the_record_is_of_the_scenario_as_it_is(task):
    """Where this fails, the scenario or the cost has changed: python -m baselines.training.validation."""
    scenario, record = recorded(task)
    assert record["fingerprint"] == fingerprint(scenario)
    assert tuple(record["seeds"]) == scenarios.seeds("validation", validation.EPISODES)
    costs = reference_costs(fingerprint(scenario), record["seeds"][3:5])
    assert costs.tolist() == record["costs"][3:5]


@pytest.mark.slow
def test_the_record_holds_the_costs_of_the_reference():
    scenario, record = recorded("pose")
    again = record_of(scenario, record["seeds"][:1])
    assert again["costs"] == pytest.approx(record["costs"][:1], rel=1e-6)
    assert {**again, "costs": 0, "seeds": 0} == {**record, "costs": 0, "seeds": 0}
