"""Models of Stable-Baselines3 as agents: the same actions, without a learning library."""

import numpy as np
import pytest
from stable_baselines3 import A2C, PPO, SAC, TD3
from torch import nn

import baselines
import ikgym.sb3
from baselines.agents.policy import Agent
from baselines.agents.track import Track
from baselines.policy import Problem
from baselines.training.exporting import agent_of_model, export
from ikgym import rl
from ikgym.exceptions import InvalidInputError

TRACK = "ikgym/Track-v0"
MODELS = {
    "ppo": (PPO, {"n_steps": 8, "batch_size": 16}),
    "a2c, silu": (A2C, {"policy_kwargs": {"activation_fn": nn.SiLU, "net_arch": [5]}}),
    "sac": (SAC, {}),
    "sac, gSDE": (SAC, {"use_sde": True}),
    "td3": (TD3, {"policy_kwargs": {"net_arch": [6, 5, 4]}}),
}


def model_of(kind, envs, **options):
    extra = {} if kind in (PPO, A2C) else {"learning_starts": 4, "buffer_size": 100}
    return kind("MlpPolicy", envs, seed=1, device="cpu", **extra, **options).learn(32)


def compare(model, policy, learned, scenario, steps):
    """Plays a model in a learning environment and its agent in the bare one; the number of actions beyond ±0.5."""
    plain = ikgym.RedundantIKVectorEnv(3, scenario, policy.preview)
    features, observation = learned.reset(seed=7)[0], plain.reset(seed=7)[0]
    share = learned.scenario.largest_qdot / plain.scenario.velocity_limit * rl.Task.share
    large, state = 0, None
    for _ in range(steps):
        wanted, _ = model.predict(features, deterministic=True)
        action, state = policy.predict(observation, state)
        np.testing.assert_allclose(action, wanted * share, rtol=0.0, atol=1e-5)
        features, *_, info = learned.step(wanted)
        observation, *_, other = plain.step(action)
        np.testing.assert_allclose(info["position_error"], other["position_error"], rtol=0.0, atol=1e-6)
        large += (np.abs(wanted) > 0.5).sum()
    return large


@pytest.mark.parametrize(("kind", "options"), MODELS.values(), ids=MODELS)
def test_exported_agents_act_as_their_models(kind, options, tmp_path):
    envs = ikgym.sb3.make_vec(TRACK, 2)
    model = model_of(kind, envs, **options)
    digits = export(model, envs, tmp_path / "a.safetensors", {"steps": 32})
    policy = baselines.make("agent", "learning-track", path=str(tmp_path / "a.safetensors"))
    assert (policy.hash, policy.preview) == (digits[:12], (1, 5))
    assert isinstance(policy.file.processing, Track)
    compare(model, policy, rl.IDS[TRACK].arms(3, lost_distance=None), "learning-track", 40)


@pytest.mark.parametrize("name", ["ppo", "sac", "td3"])
def test_large_actions_are_clipped_or_squashed_alike(name):
    kind, options = MODELS[name]
    envs = ikgym.sb3.make_vec(TRACK, 2)
    model = model_of(kind, envs, **options)
    last = {"ppo": lambda: model.policy.action_net, "sac": lambda: model.actor.mu, "td3": lambda: model.actor.mu[-2]}
    last[name]().weight.data.mul_(100.0)
    policy = Agent(Problem.of(envs.scenario), given=agent_of_model(model, envs))
    assert compare(model, policy, rl.IDS[TRACK].arms(3, lost_distance=None), "learning-track", 10) > 50


def test_an_agent_trained_at_100_hz_sees_as_far_ahead_at_500_hz(tmp_path):
    envs = ikgym.sb3.make_vec(TRACK, 2)
    model = model_of(PPO, envs, n_steps=8, batch_size=16)
    export(model, envs, tmp_path / "a.safetensors")
    policy = baselines.make("agent", "panda-random", path=str(tmp_path / "a.safetensors"))
    assert policy.preview == (5, 25)
    compare(model, policy, rl.make_vec("panda-random", 3, lost_distance=None), "panda-random", 20)


def test_models_that_cannot_be_exported(tmp_path):
    file, small = tmp_path / "a.safetensors", {"n_steps": 8, "batch_size": 16, "device": "cpu"}
    for changes in ({"history": 2}, {"commands": 3}):
        envs = ikgym.sb3.make_vec(TRACK, 2, **changes)
        with pytest.raises(InvalidInputError, match=r"expected a network from .* agents see no history"):
            export(PPO("MlpPolicy", envs, **small), envs, file)
    envs = ikgym.sb3.make_vec(TRACK, 2)
    mixed = PPO("MlpPolicy", envs, **small)
    mixed.policy.mlp_extractor.policy_net[1] = nn.ReLU()
    with pytest.raises(InvalidInputError, match="model: expected linear layers with one of"):
        export(mixed, envs, file)
    scaled = PPO("MlpPolicy", envs, **small)
    scaled.policy.features_extractor.flatten = nn.Sequential(nn.Flatten(), nn.Tanh())
    with pytest.raises(InvalidInputError, match="its actions are not those of its layers"):
        export(scaled, envs, file)
    bare = ikgym.sb3.RedundantIKVecEnv(2, "learning-track")
    with pytest.raises(InvalidInputError, match=r"envs: expected arms of ikgym\.sb3\.make_vec, got RedundantIKVecEnv"):
        export(PPO("MultiInputPolicy", bare, **small), bare, file)
    assert not file.exists()
