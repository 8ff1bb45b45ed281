"""Scores of agents: the yardsticks, the mean over seeds, and what is played."""

from __future__ import annotations

import json
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

import baselines
from baselines.episodes import Seeds, rollouts
from benchmarks.yardsticks import Still, counted, returns
from ikgym import rl, scenarios
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.rl.scoring import FILE, interquartile_mean, yardsticks

TRACK = "ikgym/Track-v0"


def cost_of(score, episodes=4, split="validation"):
    """A cost with a score, by the definition."""
    found = yardsticks(TRACK, split, episodes)
    return np.expm1(found["still"] + score * (found["solver"] - found["still"]))


def test_it_is_linear_in_the_logarithm_and_may_exceed_1():
    for wanted in (0.0, 0.4, 1.0, 1.2):
        found = rl.score({TRACK: np.full((5, 4), cost_of(wanted))})[TRACK]
        assert found[:3] == pytest.approx((wanted, wanted, wanted))
    best = np.expm1(yardsticks(TRACK, "validation", 4)["best"])
    assert rl.score({TRACK: [[best] * 4]})[TRACK].mean == pytest.approx(found.best)


@pytest.mark.parametrize("split", ["validation", "test"])
@pytest.mark.parametrize("name", [TRACK, "ikgym/Reach-v0"])
def test_the_yardsticks_are_those_of_the_episodes_that_are_scored(name, split):
    """Whatever their number: on the first ones of a split alone an arm at rest has a score of exactly 0."""
    assert yardsticks(name, split, 2) != yardsticks(name, split, 256)
    for episodes in (1, 3):
        found = rl.costs(Still(), name, split=split, episodes=episodes)
        assert rl.score({name: [found]}, split)[name].mean == pytest.approx(0.0, abs=1e-4)
    policy = json.loads(FILE.read_text(encoding="utf-8"))["policies"][name]
    tuned = np.expm1(counted(name, policy, split, 3))
    assert rl.score({name: [tuned]}, split)[name].mean == pytest.approx(1.0, abs=1e-4)


def test_costs_of_another_split_are_refused():
    found = rl.costs(Still(), TRACK, episodes=2)
    with pytest.raises(InvalidInputError, match="expected costs of the split 'test', got some of 'validation'"):
        rl.score({TRACK: [found, found]}, "test")


def test_the_mean_is_that_of_the_middle_half_of_the_seeds():
    assert interquartile_mean(np.array([[9.0, 1.0, 2.0, 3.0, -7.0], [0.0, 0.0, 0.0, 0.0, 5.0]])).tolist() == [2.0, 0.0]
    costs = [[cost_of(score)] * 4 for score in (0.1, 0.2, 0.3, 0.4, 0.9)]
    found = rl.score({TRACK: costs})[TRACK]
    assert found.mean == pytest.approx(0.3)
    assert 0.1 <= found.low < 0.3 < found.high <= 0.9
    assert rl.score({TRACK: costs})[TRACK] == found


@pytest.mark.parametrize("name", rl.IDS)
def test_yardsticks_are_in_their_order(name):
    for split in ("validation", "test"):
        found = yardsticks(name, split, 256)
        assert found["best"] <= found["solver"] < found["still"]


@pytest.mark.parametrize("name", rl.IDS)
def test_reward_thresholds_are_measured_returns(name):
    measured = json.loads(FILE.read_text())["thresholds"][name]
    assert gym.spec(name).reward_threshold == pytest.approx(measured, abs=0.1)


@pytest.mark.parametrize("name", [TRACK, "ikgym/Reach-v0"])
def test_returns_of_yardsticks_are_those_of_the_environment(name):
    env, costs, total = gym.make(name, lost_distance=None), [], 0.0
    env.reset(seed=1)
    for _ in range(env.spec.max_episode_steps):
        _, reward, _, _, info = env.step(np.full(7, 0.1, dtype=np.float32))
        total += reward
        costs.append(info["tracking_cost"] + info["velocity_cost"])
    episode = SimpleNamespace(cost=np.array(costs), seeds=Seeds(1))
    assert returns(env.unwrapped.task, [episode]) == pytest.approx([total], rel=1e-6)


def test_settings_of_yardsticks_play_the_same_steps():
    scenario, seeds = scenarios.get("learning-reach"), scenarios.seeds("validation", 2)
    episodes = rollouts(scenario, baselines.make("dls", scenario, gain=0.3), seeds)
    costs = [(one.tracking_cost + one.velocity_cost)[50:].sum() for one in episodes]
    assert counted("ikgym/Reach-v0", "dls:gain=0.3", "validation", 2) == pytest.approx(np.log1p(costs), rel=1e-12)


def test_models_that_see_the_inverse_are_scored_in_the_same_scenario():
    class Inverse:
        def predict(self, observation, state=None, **_):
            return np.clip(observation[:, 38:45] / rl.IDS[TRACK].task.share, -1.0, 1.0), state

    found = rl.costs(Inverse(), TRACK, episodes=4, inverse=True)
    assert rl.score({TRACK: [found]})[TRACK].mean > 0.9
    with pytest.raises(InvalidInputError, match="expected its scenario and counted steps"):
        rl.costs(Inverse(), TRACK, episodes=1, scenario="learning-fast")
    with pytest.raises(IkgymError, match="unexpected keyword argument 'inwerse'"):
        rl.costs(Inverse(), TRACK, episodes=1, inwerse=True)
