"""The table of contexts: what is trained plays, and gaps are those between the best filter and `told`."""

import json

import numpy as np
import pytest
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO

import ikgym
from baselines.evaluate import evaluate
from docs import contexts, keeping

SEEDS = ikgym.scenarios.seeds("test", 2)


class Policy:
    """A solver as a learner: its actions are shares of 0.5 of the largest joint velocities."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        assert observation.shape == (2, 38 + 2 + 28 + 7)  # features, ages, commands, context
        assert deterministic
        assert episode_start.all() == (state is None)
        return np.zeros((2, 7), dtype=np.float32), 0


def test_a_learner_is_scored_as_a_policy_is():
    costs, lost = contexts.play(Policy(), contexts.LEARNERS["ppo_shown"][1], "learning-context", SEEDS)

    class Still:
        preview = 1

        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.zeros_like(observation["q"]), state

    rows = evaluate("learning-context", [Still()], episodes=2)
    np.testing.assert_allclose(costs, [row.total_cost for row in rows], rtol=1e-12)
    assert lost.all()
    assert all(row.lost for row in rows)


def test_learners_are_trained_and_measured(tmp_path, monkeypatch):
    """Those without a model keep their line."""
    monkeypatch.setattr(contexts, "RUNS", tmp_path)
    monkeypatch.setattr(keeping, "WORK", tmp_path / "measure")
    monkeypatch.setattr(keeping, "RESULTS", tmp_path)
    monkeypatch.setattr(contexts, "EPISODES", 2)
    some = {name: contexts.POLICIES[name] for name in ("told", "filter_bank", "offset_free", "dls")}
    monkeypatch.setattr(contexts, "POLICIES", some)
    contexts.train("ppo_shown", 0, 2048)
    model = tmp_path / "context-ppo_shown" / "seed-0" / "model.zip"
    assert PPO.load(model).observation_space.shape == (75,)
    written = model.read_bytes()
    contexts.train("ppo_shown", 0, 2048)
    assert model.read_bytes() == written
    (tmp_path / "contexts.csv").write_text("policy,interpolation\nppo_history,7\nfilter_bank,4\n", encoding="utf-8")
    lines = {line["policy"]: line for line in contexts.measure(only_new=True)}
    assert lines.keys() == {*contexts.POLICIES, "ppo_shown", "ppo_history"}
    told, shown = lines["told"], lines["ppo_shown"]
    assert (told["train"], told["interpolation"], told["extrapolation"], told["gap_closed"]) == (1.0, 1.0, 1.0, 1.0)
    assert lines["filter_bank"]["interpolation"] == "4"
    best = min(4.0, lines["offset_free"]["interpolation"])
    assert shown["gap_closed"] == pytest.approx(1 - np.log(shown["interpolation"]) / np.log(best))
    assert shown["gap_closed"] < 0.0
    assert shown["minutes"] == json.loads(model.with_name("run.json").read_text())["minutes"] <= 1.0


@pytest.mark.slow
def test_recurrent_learners_remember(tmp_path, monkeypatch):
    monkeypatch.setattr(contexts, "RUNS", tmp_path)
    contexts.train("ppo_recurrent", 0, 2048)
    model = RecurrentPPO.load(tmp_path / "context-ppo_recurrent" / "seed-0" / "model.zip")
    costs, _ = contexts.play(model, contexts.LEARNERS["ppo_recurrent"][1], "learning-context", SEEDS)
    assert np.isfinite(costs).all()
