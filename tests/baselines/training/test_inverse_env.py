"""Arms whose actions weigh a damped inverse: they move as the agent does, and lose nothing by what is not a path."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from baselines.agents.bilinear.processing import Bilinear
from baselines.training.environment import inverse_env
from baselines.training.environment.inverse_env import INVERSE_EVERY, InverseVecEnv
from baselines.training.environment.view import View
from baselines.training.randomness import deterministic_torch
from baselines.training.trainers.models import network_outputs
from baselines.training.validation import played
from ikgym import scenarios, tasks
from ikgym.exceptions import InvalidInputError, NoAttributeError, ResetNeededError
from ikgym.simulator import observation
from tests.comparison import identical

SEEN = Bilinear((1, 10, 40), 1e-2, matrix=False)
SCENARIO = scenarios.get("varga7-pose-random").replace(steps=40)


@pytest.fixture(autouse=True)
def one_thread():
    with deterministic_torch():
        yield


def made(rows=3, scenario=SCENARIO, hold=4, processing=SEEN, **settings):
    envs = InverseVecEnv(rows, scenario, processing, hold, **settings)
    envs.seed(5)
    return envs


def actions_of(envs, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (envs.num_envs, *envs.action_space.shape))


def test_an_action_of_each_step_is_that_of_the_agent():
    """With hold = 1, from the start of an episode: the joint coordinates and the cost are those of the simulator."""
    envs = made(rows=1, hold=1, scenario=scenarios.get("panda-random").replace(steps=12))
    envs.reset()
    outputs, seed, rewards, features = [], int(envs._arms.seed[0]), [], []
    for step in range(12):
        outputs.append(actions_of(envs, step))
        features.append(envs._features.numpy().copy())
        rewards.append(envs.step(outputs[-1])[1][0])
    view, asked = View(SEEN, envs.scenario), iter(outputs)
    seen = []

    def act(out):
        seen.append(view.see(observation(out), np.zeros(1, dtype=np.bool_)))
        return view.act(next(asked))

    costs, *_ = played(envs.scenario, [seed], act, view.preview)
    np.testing.assert_allclose(np.array(features)[:, 0], np.array(seen)[:, 0], rtol=1e-6, atol=1e-7)
    assert costs[0] == pytest.approx(envs_cost(envs, seed, outputs), rel=1e-6)
    assert np.all(np.array(rewards) < 0.0)


def envs_cost(envs, seed, outputs):
    """What an episode costs by the law of gradients."""
    envs._arms.begin(np.array([0]), np.array([seed]), np.array([0]))
    envs._look()
    for output in outputs:
        envs.step_async(output)
        envs._move()
        envs._look()
    return envs._arms.spent[0]


@pytest.mark.parametrize("k", [1.0, 5.0])
def test_rewards_compare_with_the_reference_joint_path(k):
    """−k ln(1 + c/k), with c what these steps cost ÷ what the reference joint path does in as many."""
    envs = made(log_above=k)
    envs.reset()
    before = envs._arms.spent.copy()
    _, rewards, ends, _ = envs.step(np.zeros((3, *envs.action_space.shape)))
    spent = envs._arms.spent - before
    assert (spent > 0.0).all()
    costs = spent / (4 * envs._arms.usual)
    np.testing.assert_allclose(rewards, -k * np.log(1.0 + costs / k), rtol=1e-6)
    assert not ends.any()


def test_rewards_do_not_depend_on_what_was_spent_before():
    """Otherwise having spent more would be rewarded later."""
    first, second = made(), made()
    for envs in (first, second):
        envs.reset()
    second._arms.spent += 100.0
    second._arms.played += 100.0
    for step in range(3):
        assert identical(*(envs.step(actions_of(envs, step))[1] for envs in (first, second)))


@pytest.mark.parametrize("predicted", [False, True])
def test_the_inverse_is_renewed_while_an_action_is_held(predicted):
    """Held for 8 steps it does what it does when it is said anew every other step."""
    seen = dataclasses.replace(SEEN, predicted_rates=predicted)
    once, often = made(hold=8, processing=seen), made(hold=INVERSE_EVERY, processing=seen)
    once.reset(), often.reset()
    often._arms.restore(once._arms.state())
    often._look()
    said = actions_of(once)
    once.step(said)
    for _ in range(8 // INVERSE_EVERY):
        often.step(said)
    assert identical(*(envs._arms.q.numpy() for envs in (once, often)))
    assert identical(*(envs._arms.spent for envs in (once, often)))
    assert identical(*(envs._features.numpy() for envs in (once, often)))


def test_to_hold_the_inverse_for_an_action_would_cost_more_than_what_agents_can_gain(monkeypatch):
    """Of the agent that says 0, beside an inverse that is new at each step; an inverse of two steps is as good."""

    def spent(every):
        monkeypatch.setattr(inverse_env, "INVERSE_EVERY", every)
        envs = InverseVecEnv(32, "varga7-pose-random", hold=20)
        envs.seed(5)
        envs.reset()
        costs = []
        for _ in range(60):
            envs.step_async(np.zeros((32, *envs.action_space.shape)))
            costs.append(envs._move()[0])
            envs._arms.begin_new(np.flatnonzero(envs._arms.ended), envs._generator)
            envs._look()
        return np.mean(costs, axis=0)

    new, pair, held = (spent(every) for every in (1, INVERSE_EVERY, 20))
    assert np.exp(np.mean(np.log(pair / new))) == pytest.approx(1.0, abs=0.01)
    assert np.exp(np.mean(np.log(held / new))) > 1.1


def test_critics_see_what_rewards_depend_on():
    """Behind the features, which stay as they are: velocities ÷ speed, and what the reference joint path costs."""
    plain, envs = made(), made(privileged=True)
    assert plain.seen == envs.seen == plain.observation_space.shape[0] == envs.observation_space.shape[0] - 8
    seen, more = plain.reset(), envs.reset()
    for step in range(12):
        arms = envs._arms
        assert identical(more[:, : envs.seen], seen)
        wanted = [*(arms.qdot.numpy() / envs._speed[:, None]).T, np.log(arms.usual)]
        np.testing.assert_allclose(more[:, envs.seen :], np.array(wanted).T, rtol=1e-5, atol=1e-6)
        (seen, *ends, infos), (more, *others, longer) = (each.step(actions_of(envs, step)) for each in (plain, envs))
        assert all(identical(x, y) for x, y in zip(ends, others, strict=True))
        for info, other in zip(infos, longer, strict=True):
            if "terminal_observation" in info:
                assert identical(other["terminal_observation"][: envs.seen], info["terminal_observation"])


def test_what_is_seen_after_an_end_is_that_of_the_new_episode():
    """Of the arms that begin anew, all that is shown; of the others, and of what has ended, what was there."""
    envs = made(rows=4, privileged=True, null_map=True)
    envs.reset()
    ended = 0
    for step in range(20):
        seen, _, ends, infos = envs.step(actions_of(envs, step))
        ended += int(ends.sum())
        assert identical(envs._see(), seen)
        for row in np.flatnonzero(ends).tolist():
            last = infos[row]["terminal_observation"]
            assert last.shape == seen[row].shape
            assert not np.array_equal(last, seen[row])
    assert 8 <= ended < 80


def test_episodes_end_and_lost_arms_go_on_where_their_path_is():
    envs = made(rows=4)
    envs.reset()
    assert envs._arms.made.tolist() == [0, 8, 20, 28]  # spread over ten actions
    ended = []
    for _ in range(10):
        _, _, ends, infos = envs.step(np.zeros((4, *envs.action_space.shape)))
        ended += [(row, infos[row]["episode"]["l"]) for row in np.flatnonzero(ends)]
        assert all(not infos[row]["TimeLimit.truncated"] for row in np.flatnonzero(ends))
        assert all(infos[row]["terminal_observation"].shape == (envs._law.inputs,) for row in np.flatnonzero(ends))
    assert sorted(ended) == [(0, 40), (1, 32), (2, 20), (3, 12)]
    strict = made(lost_distance=1e-12)
    strict.reset()
    made_so_far = strict._arms.made.copy()
    _, _, ends, infos = strict.step(np.zeros((3, *strict.action_space.shape)))
    assert ends.all()
    assert all(info["TimeLimit.truncated"] for info in infos)
    assert identical(strict._arms.made, made_so_far + 4)
    on_path = strict._arms._path[np.arange(3), strict._arms.made]
    assert identical(strict._arms.q.numpy(), on_path)


def test_the_same_seed_is_the_same_run():
    a, b = made(), made()
    for envs in (a, b):
        envs.reset()
    for step in range(12):
        first, second = (envs.step(actions_of(envs, step)) for envs in (a, b))
        assert all(identical(x, y) for x, y in zip(first[:3], second[:3], strict=True))


def test_ppo_of_stable_baselines3_learns_in_it():
    envs = made()
    model = PPO("MlpPolicy", envs, n_steps=10, batch_size=15, device="cpu", seed=0)
    before = network_outputs(model, envs.reset())
    model.learn(60)
    assert not identical(network_outputs(model, envs.reset()), before)


def test_arms_of_a_group_play_the_same_episodes():
    """From the same place on, and where one has ended, too; those of another group others."""
    envs = made(rows=6, group_size=3)
    seen = envs.reset()
    for step in range(12):
        arms = envs._arms
        for array in (seen, arms.seed, arms.made, arms.usual, arms._nominal, arms._path):
            groups = np.asarray(array).reshape(2, 3, -1)
            assert identical(groups[:, :1].repeat(3, axis=1), groups)
            assert not identical(groups[0], groups[1])
        seen, *_ = envs.step(actions_of(made(rows=2), step).repeat(3, axis=0))
    parted, *_ = envs.step(actions_of(envs))
    assert not identical(parted[0], parted[1])


def test_references_of_groups_are_those_of_their_seeds():
    envs = made(rows=6, group_size=3)
    envs.reset()
    for row, seed in enumerate(envs._arms.seed.tolist()):
        assert identical(envs._arms._nominal[row], SCENARIO.nominal(seed, 40))
        assert identical(envs._arms._path[row], SCENARIO.nominal_joint_path(seed))


@pytest.mark.parametrize(("task", "freedom"), [("pose", 1), ("position", 4)])
def test_null_maps(task, freedom):
    """M h are the coordinates of what is left of h in an orthonormal basis of the null space, but for the damping."""
    scenario = SCENARIO.replace(task=tasks.get(task))
    envs = InverseVecEnv(5, scenario, Bilinear((1, 10, 40), 1e-9, matrix=False), 4, privileged=True, null_map=True)
    envs.seed(0)
    seen, n = envs.reset(), scenario.joints
    assert envs.freedom == freedom
    maps = seen[:, envs.seen + n + 1 :].reshape(5, freedom, n).astype(np.float64)
    h, law = np.random.default_rng(0).normal(size=(5, n)), envs._law
    output = torch.from_numpy(np.concatenate([h, np.zeros((5, n + 1))], axis=1))
    left = law.held(envs._arms.q, envs._features, output).numpy().reshape(5, n, n - freedom + 1)[:, :, -1]
    for row in range(5):
        moved = maps[row] @ h[row]
        assert np.linalg.norm(moved) == pytest.approx(np.linalg.norm(left[row]), rel=1e-4)
        # The map takes what is left for what it is, and h may be as large as it likes across the null space.
        np.testing.assert_allclose(maps[row] @ left[row], moved, rtol=1e-3, atol=1e-5)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"group_size": 2}, "num_envs: expected a multiple of group_size, 2, got 3"),
        ({"group_size": 0}, "group_size"),
        ({"group_size": 3, "scenario": scenarios.get("panda-line").replace(steps=40)}, "reference joint path"),
        ({"null_map": 1}, "null_map"),
        ({"hold": 3}, "hold: expected a divisor of the 40 steps"),
        ({"hold": 0}, "hold"),
        ({"lost_distance": 0.0}, "lost_distance"),
        ({"log_above": 0.0}, "log_above"),
        ({"scenario": scenarios.get("panda-field")}, "ideal plant"),
    ],
)
def test_bad_settings(changes, message):
    with pytest.raises(InvalidInputError, match=message):
        made(**changes)


def test_bad_processing_and_actions():
    with pytest.raises(InvalidInputError, match="without a matrix"):
        InverseVecEnv(2, SCENARIO, Bilinear((1, 10), 1e-2), 4, 0.05)
    envs = made()
    envs.reset()
    for bad in (np.zeros((2, 15)), np.full((3, 15), np.nan)):
        with pytest.raises(InvalidInputError, match=r"actions: expected finite numbers of shape \(3, 15\)"):
            envs.step(bad)


def test_before_a_reset_and_unknown_attributes():
    envs = made()
    with pytest.raises(ResetNeededError, match="reset"):
        envs.step(np.zeros((3, 15)))
    with pytest.raises(NoAttributeError, match="no attribute 'q'"):
        envs.get_attr("q")
    with pytest.raises(NoAttributeError, match="set_steps"):
        envs.env_method("set_steps")
    assert envs.get_attr("scenario", [1]) == [SCENARIO]
