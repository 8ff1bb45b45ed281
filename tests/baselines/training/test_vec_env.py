"""The environment of agents: features and actions of `Processing`, and network outputs of 0 are the base policy."""

from __future__ import annotations

import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecCheckNan

import baselines
import ikgym
from baselines.agents.features import Processing
from baselines.episodes import rollouts
from baselines.policy import Batch, Problem
from baselines.spec import parse_policy
from baselines.training.environment.vec_env import ProcessedVecEnv
from baselines.training.environment.view import View
from ikgym.exceptions import InvalidInputError, ResetNeededError, UnknownNameError
from ikgym.outcome import OBSERVED
from ikgym.sb3 import RedundantIKVecEnv

N, STEPS = 3, 12
UNDER = ["dls", "mfac", "rhc_gradient:horizon=3"]


def scenario(name="varga7-random", steps=STEPS):
    return ikgym.scenarios.get(name).replace(steps=steps)


def played(env, answers):
    """Observations, rewards and infos of an environment, from its reset on."""
    out = [(env.reset(), None, None)]
    for answer in answers:
        observation, rewards, _, infos = env.step(answer)
        out.append((observation, rewards, infos))
    return out


@pytest.mark.parametrize("base_policy", [None, *UNDER])
def test_features_are_those_of_processing(base_policy):
    """Those at the end of an episode included; the base policy acts by itself, observation by
    observation, and its memory is cleared where an episode begins."""
    processing, problem = Processing(base_policy=base_policy), Problem.of(scenario())
    env, plain = ProcessedVecEnv(N, scenario(), processing), RedundantIKVecEnv(N, scenario(), processing.offsets)
    under = None
    if base_policy is not None:
        name, parameters = parse_policy(base_policy)
        under = baselines.make(name, scenario(), **parameters)

    def expected(observation, state, starting):
        batch, base = Batch(*[observation[key] for key in OBSERVED]), None
        if under is not None:
            shown = {**observation, "nominal": observation["nominal"][:, : under.preview]}
            action, state = under.predict(shown, state, starting)
            base = action.astype(np.float64)
        return batch, base, processing.features(problem, batch, base), state

    for each in (env, plain):
        each.seed(5)
    seen, observation = env.reset(), plain.reset()
    state, starting = None, np.ones(N, dtype=bool)
    rng = np.random.default_rng(0)
    ends = 0
    for _ in range(2 * STEPS + 1):
        batch, base, features, state = expected(observation, state, starting)
        np.testing.assert_array_equal(seen, features)
        assert seen.dtype == np.float32
        assert env.observation_space.contains(seen[0])
        answer = rng.uniform(-1.2, 1.2, (N, 7)).astype(np.float32)
        seen, rewards, ended, infos = env.step(answer)
        observation, wanted, starting, plain_infos = plain.step(processing.action(problem, batch, answer, base))
        np.testing.assert_array_equal(rewards, wanted)
        np.testing.assert_array_equal(ended, starting)
        for row in np.flatnonzero(ended):
            last = {key: value[None] for key, value in plain_infos[row]["terminal_observation"].items()}
            memory = None if state is None else tuple(array[row : row + 1] for array in state)
            np.testing.assert_array_equal(infos[row]["terminal_observation"], expected(last, memory, None)[2][0])
            assert infos[row]["episode"]["r"] == plain_infos[row]["episode"]["r"]
            ends += 1
    assert ends == 2 * N


@pytest.mark.parametrize("base_policy", UNDER)
def test_outputs_of_zero_are_the_base_policy(base_policy):
    """Bit for bit what an evaluation of that policy plays."""
    name, parameters = parse_policy(base_policy)
    env = ProcessedVecEnv(N, scenario(), Processing(base_policy=base_policy))
    env.seed(0)
    courses = [step[0] for step in played(env, [np.zeros((N, 7), np.float32)] * (STEPS - 1))]
    simulator = env.venv._envs._simulator
    wanted = rollouts(scenario(), baselines.make(name, scenario(), **parameters), range(N))
    np.testing.assert_array_equal(simulator._state.q, [episode.q[STEPS - 2] for episode in wanted])
    env.seed(0)
    env.reset()
    for _ in range(STEPS):
        *_, infos = env.step(np.zeros((N, 7), np.float32))
    costs = [float(np.sum(episode.tracking_cost + episode.velocity_cost)) for episode in wanted]
    np.testing.assert_allclose([-info["episode"]["r"] for info in infos], costs, rtol=1e-12, atol=1e-6)
    assert len(courses) == STEPS


def test_rewards():
    answers = np.random.default_rng(1).uniform(-1.0, 1.0, (STEPS, N, 7)).astype(np.float32)
    by_name = {}
    for reward, scale in (("cost", 1.0), ("log", 1.0), ("log", 0.25)):
        env = ProcessedVecEnv(N, scenario(), Processing(), reward, scale)
        env.seed(2)
        by_name[reward, scale] = played(env, answers)[1:]
    for (_, cost, infos), (_, log, others), (_, quarter, _) in zip(*by_name.values(), strict=True):
        np.testing.assert_allclose(log, -np.log1p(-cost.astype(np.float64)), rtol=1e-5)
        np.testing.assert_array_equal(quarter, np.float32(0.25) * log)
        assert quarter.dtype == np.float32
        for info, other in zip(infos, others, strict=True):
            assert info.get("episode", {}).get("r") == other.get("episode", {}).get("r")


def test_evaluation_of_stable_baselines3():
    """Without a warning; the returns are the environment's own."""
    env = ProcessedVecEnv(2, scenario(), Processing(base_policy="dls"), "log", 0.1)

    class Zero:
        def predict(self, observation, state=None, episode_start=None, deterministic=True):
            return np.zeros((len(observation), 7), np.float32), state

    env.seed(6)
    returns, lengths = evaluate_policy(Zero(), env, n_eval_episodes=2, return_episode_rewards=True)
    policy = baselines.make("dls", scenario())
    plain = RedundantIKVecEnv(2, scenario(), policy.preview)
    plain.seed(6)
    assert returns == evaluate_policy(policy, plain, n_eval_episodes=2, return_episode_rewards=True)[0]
    assert lengths == [STEPS] * 2


def test_as_a_vec_env():
    env = VecCheckNan(ProcessedVecEnv(2, scenario("zhang3-helix"), Processing(base_policy="dls")), raise_exception=True)
    env.seed(0)
    assert env.reset().shape == (2, Processing(base_policy="dls").size(Problem.of(scenario("zhang3-helix"))))
    assert env.action_space.shape == (3,)
    assert env.get_attr("scenario")[0].name == "zhang3-helix"
    assert env.env_is_wrapped(ikgym.sb3.Monitor) == [True, True]
    env.close()


def test_bad_arguments():
    with pytest.raises(UnknownNameError, match=r"no reward 'logg'\. Did you mean 'log'"):
        ProcessedVecEnv(2, scenario(), Processing(), "logg")
    with pytest.raises(InvalidInputError, match="scale"):
        ProcessedVecEnv(2, scenario(), Processing(), "log", 0.0)
    with pytest.raises(UnknownNameError, match="Did you mean 'dls'"):
        ProcessedVecEnv(2, scenario(), Processing(base_policy="dlss"))
    with pytest.raises(UnknownNameError, match="parameter of dls"):
        ProcessedVecEnv(2, scenario(), Processing(base_policy="dls:dampin=1"))
    with pytest.raises(InvalidInputError, match="reference 'oracle'"):
        ProcessedVecEnv(2, scenario(), Processing(base_policy="oracle"))
    with pytest.raises(InvalidInputError, match="num_envs"):
        ProcessedVecEnv(0, scenario(), Processing())


def test_actions_need_something_seen():
    with pytest.raises(ResetNeededError, match="call reset"):
        View(Processing(), scenario()).act(np.zeros((1, 7)))


def test_truncated_episodes_look_like_whole_ones():
    """An agent is not told that they are truncated; the return is that of the steps that were played."""
    whole, cut = (
        ProcessedVecEnv(N, scenario(steps=30), Processing(base_policy="mfac"), episode_steps=c) for c in (None, 5)
    )
    answers = np.random.default_rng(3).uniform(-1.0, 1.0, (6, N, 7)).astype(np.float32)
    courses = []
    for env in (whole, cut):
        env.seed(4)
        courses.append(played(env, answers))
    for step, (wanted, got) in enumerate(zip(*courses, strict=True)):
        if step < 5:
            np.testing.assert_array_equal(got[0], wanted[0])
        if step == 5:
            for row, info in enumerate(got[2]):
                np.testing.assert_array_equal(info["terminal_observation"], wanted[0][row])
                assert info["TimeLimit.truncated"]
                assert info["episode"]["l"] == 5
            assert not np.array_equal(got[0], wanted[0])
    assert ProcessedVecEnv(N, scenario(steps=30), Processing(), episode_steps=99).get_attr("scenario")[0].steps == 30
    with pytest.raises(InvalidInputError, match="episode_steps"):
        ProcessedVecEnv(N, scenario(), Processing(), episode_steps=0)
