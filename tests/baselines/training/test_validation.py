"""Validation scores what an evaluation would, on episodes of its own."""

from __future__ import annotations

import json

import numpy as np
import pytest

import baselines
from baselines.agents.features import Processing
from baselines.episodes import rollouts
from baselines.evaluation.summary import geometric_mean
from baselines.fingerprints import fingerprint
from baselines.spec import parse_policy
from baselines.training import validation
from baselines.training.validation import play, reference_costs, validate, validation_seeds
from ikgym import scenarios, tasks


def zero(features):
    return np.zeros((len(features), 7), np.float32)


@pytest.mark.parametrize("base_policy", ["dls", "mfac", "rhc_gradient:horizon=3"])
def test_outputs_of_zero_score_like_the_base_policy(base_policy):
    scenario = scenarios.get("varga7-random").replace(steps=40)
    seeds = validation_seeds(scenario, 3)
    name, parameters = parse_policy(base_policy)
    episodes = rollouts(scenario, baselines.make(name, scenario, **parameters), seeds)
    wanted = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
    costs, errors, angles = play(zero, Processing(base_policy=base_policy), scenario, seeds)
    np.testing.assert_allclose(costs, wanted, rtol=1e-12)
    np.testing.assert_array_equal(errors, [e.position_error.max() for e in episodes])
    np.testing.assert_array_equal(angles, [e.orientation_error.max() for e in episodes])
    score = validate(zero, Processing(base_policy=base_policy), scenario, 3)
    assert score.cost == pytest.approx(geometric_mean(wanted), rel=1e-12)
    assert (score.cost_ratio, score.episodes, score.lost) == (None, 3, 0.0)
    assert score.worst == pytest.approx(max(wanted), rel=1e-12)
    assert score.position_error_max_mm == pytest.approx(1e3 * np.mean(errors), rel=1e-12)
    assert score.orientation_error_max_mrad == pytest.approx(1e3 * np.mean(angles), rel=1e-12)


def test_lost_arms_are_counted():
    scenario = scenarios.get("varga7-random").replace(steps=300)
    assert validate(zero, Processing(), scenario, 4).lost == 1.0


def test_cost_ratio_is_over_the_reference(monkeypatch):
    scenario = scenarios.get("varga7-random").replace(steps=40)
    costs, *_ = play(zero, Processing(base_policy="dls"), scenario, validation_seeds(scenario, 2))
    record = {
        "fingerprint": fingerprint(scenario),
        "seeds": list(validation_seeds(scenario, 2)),
        "costs": costs / [2.0, 8.0],
    }
    monkeypatch.setattr(validation, "_records", lambda: [record])
    score = validate(zero, Processing(base_policy="dls"), scenario, 2)
    assert score.cost_ratio == pytest.approx(4.0, rel=1e-12)
    assert score.worst == pytest.approx(8.0, rel=1e-12)
    assert validate(zero, Processing(base_policy="dls"), scenario, 3).cost_ratio is None
    assert validate(zero, Processing(base_policy="dls"), scenario.replace(dt=2e-3), 2).cost_ratio is None


def test_validation_seeds():
    split = scenarios.SPLITS["validation"]
    assert validation_seeds(scenarios.get("varga7-random"), 3) == tuple(split[:3])
    assert validation_seeds(scenarios.get("faitli3-regular"), 3) == (split[0],)


@pytest.fixture(params=validation.TASKS)
def recorded(request):
    """A scenario, and what is on record of it."""
    scenario = scenarios.get(validation.SCENARIO).replace(task=tasks.get(request.param))
    records = json.loads(validation.FILE.read_text(encoding="utf-8"))
    return scenario, next(record for record in records if record["task"] == request.param)


def test_the_record_is_of_the_scenario_as_it_is(recorded):
    """Where this fails, the scenario or the cost has changed: python -m baselines.training.validation --update."""
    scenario, record = recorded
    assert record["fingerprint"] == fingerprint(scenario)
    assert tuple(record["seeds"]) == scenarios.seeds("validation", validation.EPISODES)
    costs = reference_costs(fingerprint(scenario), record["seeds"][3:5])
    assert costs.tolist() == record["costs"][3:5]


@pytest.mark.slow
def test_the_record_holds_what_the_reference_costs(recorded):
    scenario, record = recorded
    (episode,) = rollouts(scenario, validation.reference_policy(scenario), scenarios.seeds("validation", 1))
    assert float(np.sum(episode.tracking_cost + episode.velocity_cost)) == pytest.approx(record["costs"][0], rel=1e-6)


def test_command_line(capsys, monkeypatch, tmp_path):
    assert validation.main([]) == 0
    assert f"{validation.POLICY} on varga7-random (skew): geometric mean of 64 costs" in capsys.readouterr().out
    monkeypatch.setattr(validation, "FILE", tmp_path / "record.json")
    monkeypatch.setattr(validation, "POLICY", "dls")
    monkeypatch.setattr(validation, "EPISODES", 2)
    monkeypatch.setattr(scenarios, "get", lambda name, get=scenarios.get: get(name).replace(steps=20))
    assert validation.main(["--update"]) == 0
    assert "dls on varga7-random (pose): geometric mean of 2 costs" in capsys.readouterr().out
    validation._records.cache_clear()
