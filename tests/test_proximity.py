"""A cost of proximity in all ways of simulation, in rows and in files; without one nothing changes."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.evaluate import evaluate
from baselines.fingerprints import fingerprint
from baselines.oracle.episode import EpisodeProblem
from ikgym.exceptions import InvalidInputError
from tests.bodied import AROUND, PERSON, crowd, wild
from tests.comparison import played_alike

NEAR = ikgym.ProximityCost(0.014, 0.005, 3.0, 1.5)
PLANT = ikgym.Plant(zero=0.01, link=1e-3, payload=0.02, payload_step=60, command_delay=2)
CROWD = crowd(1000, (*AROUND, PERSON)).replace(iterations_per_point=2, plant=PLANT)


def depth_cost(clearance):
    """The formula in plain Python."""
    share = max(0.014 - max(clearance, 0.0), 0.0) / 0.005
    return share**3.0 if share > 1.0 else share**1.5


def test_one_arm_many_in_a_loop_and_many_at_once_pay_what_the_formula_says():
    scenario = CROWD.replace(proximity=NEAR)
    envs = [
        gym.make_vec("RedundantIK-v0", num_envs=5, scenario=scenario, vectorization_mode=mode)
        for mode in ("vector_entry_point", "sync")
    ]
    returned, paid = played_alike(*envs, wild(5, 300)), []
    for k, (_, rewards, _, _, infos) in enumerate(returned, start=1):
        expected = [depth_cost(one) if k % 2 == 0 else 0.0 for one in infos["clearance"]]
        np.testing.assert_allclose(infos["proximity_cost"], expected, rtol=1e-12)
        total = infos["tracking_cost"] + infos["velocity_cost"] + infos["proximity_cost"]
        np.testing.assert_array_equal(rewards, -total)
        paid.append(infos["proximity_cost"])
    assert infos["collision"].any()
    assert returned[-1][0]["obstacles"].shape == (5, 5, 16)
    assert 0.0 < np.mean(np.array(paid)[1::2] > 0.0) < 1.0


def test_it_changes_nothing_but_the_cost():
    results = []
    for one in (CROWD, CROWD.replace(proximity=NEAR)):
        env = gym.make("RedundantIK-v0", scenario=one)
        env.reset(seed=2)
        played = [env.step(action) for action in wild(5, 300)[:, 2]]
        results.append(
            [(seen["q"].tolist(), info["tracking_cost"], info["velocity_cost"]) for seen, *_, info in played]
        )
        assert all(("proximity_cost" in info) is (one.proximity is not None) for *_, info in played)
    assert results[0] == results[1]
    assert max(info["proximity_cost"] for *_, info in played) > 0.0


def test_rows_and_trajectories_have_it():
    scenario = ikgym.scenarios.get("panda-table").replace(steps=300)
    near = scenario.replace(name="near", proximity=ikgym.ProximityCost(0.3))
    first, second = evaluate([scenario, near], ["dls"])
    assert first.proximity_cost is None
    assert second.proximity_cost > 0.0
    assert second.total_cost == pytest.approx(first.total_cost + second.proximity_cost, rel=1e-12)
    played = baselines.track(near, "dls")
    assert played.total_cost == second.total_cost
    assert played.columns()["proximity_cost [1]"].sum() == pytest.approx(second.proximity_cost, rel=1e-12)


def test_learners_are_rewarded_with_it():
    scenario = ikgym.scenarios.get("panda-table").replace(steps=50)
    rewards = []
    for one in (scenario, scenario.replace(proximity=ikgym.ProximityCost(0.3))):
        envs = ikgym.rl.make_vec(one, 2)
        envs.reset(seed=0)
        rewards.append(envs.step(np.zeros((2, 7), dtype=np.float32))[1])
    assert (rewards[1] < rewards[0]).all()


def test_episodes_with_it_are_others_and_no_best_cost_is_sought():
    scenario = ikgym.scenarios.get("panda-table")
    near = scenario.replace(proximity=NEAR)
    assert len({fingerprint(one) for one in (scenario, near, near.replace(proximity=NEAR.replace(delta=0.1)))}) == 3
    with pytest.raises(InvalidInputError, match=r"'panda-table': expected no proximity, got ProximityCost"):
        EpisodeProblem.of(near, 0)


def test_a_file_switches_it_on(tmp_path):
    file = tmp_path / "near.toml"
    file.write_text('name = "near"\nlike = "panda-table"\n\n[proximity]\nclearance = 0.05\np_in = 1\n')
    assert ikgym.scenarios.load(file).proximity == ikgym.ProximityCost(0.05, p_in=1)
