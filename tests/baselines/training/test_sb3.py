"""PPO, SAC and TD3 by Stable-Baselines3: settings, exported agents, and the callback."""

import numpy as np
import pytest
from stable_baselines3 import A2C, DDPG, PPO, SAC, TD3
from torch import nn

import baselines
import ikgym.sb3
from baselines.agents.relative import Relative
from baselines.training.callback import ValidationCallback
from baselines.training.exporting import export
from baselines.training.validation import score
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.training.small import tiny, trainer_of

SCENARIO = scenarios.get("panda-random").replace(steps=20)
MODELS = {
    "ppo": (PPO, {"n_steps": 8, "batch_size": 16}),
    "a2c, silu": (A2C, {"policy_kwargs": {"activation_fn": nn.SiLU, "net_arch": [5]}}),
    "sac": (SAC, {}),
    "sac, gSDE": (SAC, {"use_sde": True}),
    "td3": (TD3, {"policy_kwargs": {"net_arch": [6, 5, 4]}}),
    "ddpg": (DDPG, {}),
}


def envs_of(**changes):
    return ikgym.sb3.make_vec(SCENARIO, 2, **changes)


@pytest.mark.parametrize(("kind", "options"), MODELS.values(), ids=MODELS)
def test_exported_agents_act_as_their_models(kind, options, tmp_path):
    envs = envs_of(share=0.5)
    extra = {} if kind in (PPO, A2C) else {"learning_starts": 4, "buffer_size": 100}
    model = kind("MlpPolicy", envs, seed=1, device="cpu", **extra, **options).learn(32)
    digits = export(model, envs, tmp_path / "a.safetensors", {"steps": 32})
    policy = baselines.make("agent", SCENARIO, path=str(tmp_path / "a.safetensors"))
    assert (policy.hash, policy.preview) == (digits[:12], (10, 40, 100))
    assert isinstance(policy.file.processing, Relative)
    plain, shown = ikgym.sb3.RedundantIKVecEnv(2, SCENARIO, policy.preview), envs_of(share=0.5, lost_distance=None)
    for env in (plain, shown):
        env.seed(7)
    observation, features = plain.reset(), shown.reset()
    for _ in range(5):
        unbounded, _ = model.predict(features, deterministic=True)
        action, _ = policy.predict(observation)
        features, rewards, *_ = shown.step(unbounded)
        observation, costs, *_ = plain.step(action)
        wanted = 0.05 * np.maximum(1.0 - np.log1p(-costs.astype(float)) / 12.0, 0.0)
        np.testing.assert_allclose(rewards, wanted, rtol=1e-3, atol=1e-6)


def test_models_that_cannot_be_exported(tmp_path):
    for changes in ({"history": 2}, {"commands": 3}):
        envs = envs_of(**changes)
        model = PPO("MlpPolicy", envs, n_steps=8, batch_size=16, device="cpu")
        with pytest.raises(InvalidInputError, match=r"expected a network from .* agents see no history"):
            export(model, envs, tmp_path / "a.safetensors")
    envs = envs_of()
    mixed = PPO("MlpPolicy", envs, n_steps=8, batch_size=16, device="cpu")
    mixed.policy.mlp_extractor.policy_net[1] = nn.ReLU()
    with pytest.raises(InvalidInputError, match="model: expected linear layers with one of"):
        export(mixed, envs, tmp_path / "a.safetensors")
    scaled = PPO("MlpPolicy", envs, n_steps=8, batch_size=16, device="cpu")
    scaled.policy.features_extractor.flatten = nn.Sequential(nn.Flatten(), nn.Tanh())
    with pytest.raises(InvalidInputError, match="its actions are not those of its layers"):
        export(scaled, envs, tmp_path / "a.safetensors")
    assert not list(tmp_path.iterdir())


def test_settings_reach_the_algorithm():
    trainer = trainer_of(tiny("td3", settings=("tau=0.25", "action_noise=0.2", "policy_kwargs={'net_arch':[5]}")))
    assert (trainer.model.tau, trainer.model.action_noise._sigma.tolist()) == (0.25, [0.2] * 7)
    assert trainer.model.buffer_size == 240
    assert trainer.model.policy.actor.mu[0].out_features == 5
    assert trainer_of(tiny("ppo", learning=("furthest=20.0", "preview=(1,5)"))).model.env.learning.furthest == 20.0


@pytest.mark.parametrize(
    ("setting", "message"), [("n_step=3", "Did you mean 'n_steps'"), ("device=cuda", "setting of ppo 'device'")]
)
def test_settings_that_the_algorithm_does_not_have(setting, message):
    with pytest.raises(UnknownNameError, match=message):
        trainer_of(tiny("ppo", settings=(setting,)))


@pytest.mark.parametrize("learning", [True, False])
def test_the_callback_logs_scores(learning):
    envs = envs_of() if learning else ikgym.sb3.RedundantIKVecEnv(2, SCENARIO, preview=(1, 5))
    policy = "MlpPolicy" if learning else "MultiInputPolicy"
    model, logged = PPO(policy, envs, n_steps=8, batch_size=16, device="cpu"), []
    callback = ValidationCallback(every=16, episodes=2)
    measured = callback._measured
    callback._measured = lambda: logged.append(measured()) or logged[-1]
    model.learn(48, callback=callback)
    assert len(logged) == 3
    if not learning:
        assert logged[-1] == score(model, SCENARIO, 2, (1, 5)).to_json() or len({r["cost"] for r in logged}) > 1
    with pytest.raises(InvalidInputError, match="every"):
        ValidationCallback(every=0)
