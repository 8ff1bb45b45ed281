"""What the callback logs is what an evaluation of the same model measures."""

from __future__ import annotations

import re

import numpy as np
import pytest
from stable_baselines3 import PPO
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from baselines.evaluate import evaluate
from baselines.training import callback as callbacks
from baselines.training.callback import ValidationCallback
from baselines.training.validation import validation_seeds
from docs.tables import PAGES
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.sb3 import RedundantIKVecEnv

STEPS = 8


@pytest.fixture(scope="module")
def scenario():
    return scenarios.get("varga7-random").replace(steps=STEPS)


def test_what_is_logged_is_what_is_measured(scenario, tmp_path, monkeypatch):
    known = np.array([2.0, 8.0])
    monkeypatch.setattr(callbacks, "reference_costs", lambda digest, seeds: known)
    env = RedundantIKVecEnv(2, scenario)
    model = PPO(
        "MultiInputPolicy",
        env,
        n_steps=STEPS,
        batch_size=2 * STEPS,
        n_epochs=1,
        device="cpu",
        tensorboard_log=str(tmp_path),
    )
    model.learn(3 * 2 * STEPS, callback=ValidationCallback(scenario, every=2 * STEPS, episodes=2))
    events = EventAccumulator(str(tmp_path / "PPO_1")).Reload()
    assert {"rollout/ep_rew_mean", "validation/cost_ratio"} <= set(events.Tags()["scalars"])
    assert len(events.Scalars("validation/cost")) == 3
    again = ValidationCallback(scenario, every=1, episodes=2)
    again.init_callback(model)
    logged = again._measured()
    rows = evaluate(scenario, model, episodes=2, split="validation", preview=2)
    costs = np.array([row.total_cost for row in rows])
    assert logged["cost"] == pytest.approx(np.exp(np.log(costs).mean()), rel=1e-9)
    assert logged["cost_ratio"] == pytest.approx(np.exp(np.log(costs / known).mean()), rel=1e-9)
    wanted = 1e3 * np.mean([row.position_error_max for row in rows])
    assert logged["position_error_max_mm"] == pytest.approx(wanted, rel=1e-9)
    wanted = 1e3 * np.sqrt(np.mean([row.position_error_rms**2 for row in rows]))
    assert logged["position_error_rms_mm"] == pytest.approx(wanted, rel=1e-9)
    wanted = 1e3 * np.mean([row.orientation_error_max for row in rows])
    assert logged["orientation_error_max_mrad"] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.slow
def test_the_snippet_of_the_page_logs_to_tensorboard(tmp_path, monkeypatch):
    snippets = re.findall(r"```python\n(.*?)```", (PAGES / "agents.md").read_text(encoding="utf-8"), re.DOTALL)
    (snippet,) = [snippet for snippet in snippets if "ValidationCallback" in snippet]
    monkeypatch.chdir(tmp_path)
    exec(snippet, {})
    names = EventAccumulator(str(tmp_path / "runs" / "mine" / "PPO_1")).Reload().Tags()["scalars"]
    assert {"validation/cost_ratio", "validation/position_error_max_mm", "validation/position_error_rms_mm"} <= {*names}


def test_costs_are_over_the_best_known_where_there_is_one(scenario):
    assert callbacks._known_costs(scenarios.get("varga7-fast"), (1_000_000,)).shape == (1,)
    seeds = validation_seeds(scenarios.get("varga7-random"), 4)
    assert callbacks._known_costs(scenarios.get("varga7-random"), seeds).shape == (4,)
    assert callbacks._known_costs(scenario, seeds) is None


def test_mistakes():
    with pytest.raises(UnknownNameError, match="Did you mean"):
        ValidationCallback("varga7-randon", every=10)
    with pytest.raises(InvalidInputError, match="every"):
        ValidationCallback("varga7-fast", every=0)
