"""Policies of Stable-Baselines3 with a bilinear actor: they learn, and act the same from their file."""

from __future__ import annotations

import copy
import pathlib
import re

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO, SAC, TD3

import baselines
import ikgym
import ikgym.sb3
from baselines.agents.bilinear.processing import Bilinear
from baselines.training.environment.inverse_env import SEEN, InverseVecEnv
from baselines.training.environment.view import View
from baselines.training.exporting import export
from baselines.training.policies import (
    AsymmetricPPOPolicy,
    AsymmetricSACPolicy,
    AsymmetricTD3Policy,
    BilinearPPOPolicy,
    BilinearSACPolicy,
    BilinearTD3Policy,
    NullSpacePPOPolicy,
)
from baselines.training.policies.null_space import NullSpaceGaussian
from baselines.training.trainers.rollout_end import GroupBaseline
from ikgym import rl
from ikgym.exceptions import InvalidInputError
from ikgym.rl.feature_kernels import jacobian_rows

pytestmark = pytest.mark.usefixtures("one_thread")

SHORT = {"n_steps": 8, "batch_size": 16, "n_epochs": 1}
LATE = {"learning_starts": 8, "batch_size": 8, "buffer_size": 100}


def scenario():
    return ikgym.scenarios.get("panda-random").replace(steps=20)


#: Of policies that begin as a damped inverse.
DAMPED = {"policy_kwargs": {"damping": 4e-4}}


@pytest.mark.parametrize(("kind", "policy", "parameters"), [
    (PPO, "MlpPolicy", SHORT),
    (SAC, "MlpPolicy", LATE),
    (TD3, "MlpPolicy", LATE),
    (PPO, BilinearPPOPolicy, SHORT),
    (SAC, BilinearSACPolicy, LATE),
    (TD3, BilinearTD3Policy, LATE),
    (PPO, BilinearPPOPolicy, SHORT | DAMPED),
    (SAC, BilinearSACPolicy, LATE | DAMPED),
    (TD3, BilinearTD3Policy, LATE | DAMPED),
])  # fmt: skip
def test_models_learn_and_act_the_same_from_their_file(tmp_path, kind, policy, parameters):
    jacobian = "policy_kwargs" in parameters
    envs = ikgym.sb3.make_vec(scenario(), 2, jacobian=jacobian)
    model = kind(policy, envs, device="cpu", seed=0, **copy.deepcopy(parameters)).learn(32)  # which SAC adds to
    model.save(tmp_path / "model.zip")
    model = kind.load(tmp_path / "model.zip", device="cpu")
    export(model, envs, tmp_path / "agent.safetensors")
    agent = baselines.make("agent", scenario(), path=str(tmp_path / "agent.safetensors"))
    env = rl.make(scenario(), jacobian=jacobian)
    features, _ = env.reset(seed=1)
    plain = ikgym.RedundantIKEnv(scenario(), preview=agent.preview)
    seen, _ = plain.reset(seed=1)
    for _ in range(20):
        said, _ = model.predict(features, deterministic=True)
        action, _ = agent.predict(seen)
        features, *_, info = env.step(said)
        seen, *_, same = plain.step(action)
        assert info["position_error"] == pytest.approx(same["position_error"], rel=1e-5)


@pytest.mark.parametrize(("kind", "policy", "parameters"), [
    (PPO, "MlpPolicy", SHORT),
    (SAC, "MlpPolicy", LATE),
    (TD3, "MlpPolicy", LATE),
    (PPO, AsymmetricPPOPolicy, SHORT),
    (SAC, AsymmetricSACPolicy, LATE),
    (TD3, AsymmetricTD3Policy, LATE),
    (PPO, NullSpacePPOPolicy, SHORT),
])  # fmt: skip
def test_models_that_weigh_an_inverse_act_the_same_from_their_file(tmp_path, kind, policy, parameters):
    """What the model says of the features that the agent sees is what the agent does."""
    privileged = policy != "MlpPolicy"
    null_map = policy is NullSpacePPOPolicy
    envs = InverseVecEnv(2, scenario(), hold=4, privileged=privileged, null_map=null_map)
    kwargs = {"net_arch": [8, 8]} | ({"seen": envs.seen} if privileged else {})
    kwargs |= {"freedom": envs.freedom} if null_map else {}
    model = kind(policy, envs, device="cpu", seed=0, policy_kwargs=kwargs, **parameters).learn(32)
    model.save(tmp_path / "model.zip")
    model = kind.load(tmp_path / "model.zip", device="cpu")
    export(model, envs, tmp_path / "agent.safetensors")
    agent = baselines.make("agent", scenario(), path=str(tmp_path / "agent.safetensors"))
    view = View(envs.processing, scenario())
    env = ikgym.RedundantIKEnv(scenario(), preview=agent.preview)
    seen, _ = env.reset(seed=1)
    for _ in range(5):
        batch = {key: value[None] for key, value in seen.items()}
        shown = np.zeros((1, *envs.observation_space.shape), dtype=np.float32)
        shown[:, : envs.seen] = view.see(batch, np.zeros(1, dtype=np.bool_))
        said, _ = model.predict(shown, deterministic=True)
        action, _ = agent.predict(seen)
        np.testing.assert_allclose(action, view.act(said)[0], rtol=1e-5, atol=1e-7)
        seen, *_ = env.step(action)


@pytest.mark.parametrize(
    ("kind", "policy", "parameters"),
    [(PPO, AsymmetricPPOPolicy, SHORT), (SAC, AsymmetricSACPolicy, LATE), (TD3, AsymmetricTD3Policy, LATE)],
)
def test_only_critics_see_what_is_behind_the_features(kind, policy, parameters):
    envs = InverseVecEnv(2, scenario(), hold=4, privileged=True)
    model = kind(policy, envs, device="cpu", seed=0, policy_kwargs={"seen": envs.seen}, **parameters)
    seen = envs.reset()
    more = seen.copy()
    more[:, envs.seen :] += 1.0
    first, second = (torch.from_numpy(observed) for observed in (seen, more))
    with torch.no_grad():
        actions = [model.predict(observed.numpy(), deterministic=True)[0] for observed in (first, second)]
        assert np.array_equal(*actions)
        given = torch.from_numpy(actions[0])
        values = [
            model.policy.predict_values(observed) if kind is PPO else model.critic(observed, given)[0]
            for observed in (first, second)
        ]
    assert not torch.allclose(*values)


@pytest.mark.parametrize(
    ("kind", "policy", "parameters"), [(PPO, BilinearPPOPolicy, SHORT), (SAC, BilinearSACPolicy, LATE)]
)
def test_weights_of_the_bilinear_actor_are_trained(kind, policy, parameters):
    model = kind(policy, ikgym.sb3.make_vec(scenario(), 2), device="cpu", seed=0, **parameters)
    before = {name: tensor.clone() for name, tensor in model.policy.named_parameters()}
    model.learn(64)
    changed = {name for name, tensor in model.policy.named_parameters() if not torch.equal(tensor, before[name])}
    assert any("network.0.weight" in name for name in changed)
    assert any("value_net" in name or "critic" in name for name in changed)


def test_policies_with_an_inverse_begin_as_damped_least_squares():
    """Before they have learned anything: the error of 20 steps stays below a tenth of a millimetre."""
    envs = ikgym.sb3.make_vec(scenario(), 2, jacobian=True, preview=(1, 10, 40))
    model = PPO(BilinearPPOPolicy, envs, device="cpu", seed=0, **SHORT, **copy.deepcopy(DAMPED))
    env = rl.make(scenario(), jacobian=True, preview=(1, 10, 40))
    features, _ = env.reset(seed=1)
    for _ in range(20):
        features, *_, info = env.step(model.predict(features, deterministic=True)[0])
    assert info["position_error"] < 2e-5


def test_actions_are_homogeneous_in_what_is_due():
    """Twice as far from the path, the velocity that takes it back is twice as large: G does not change."""
    model = PPO(BilinearPPOPolicy, ikgym.sb3.make_vec(scenario(), 2), device="cpu", seed=0, **SHORT)
    actor = model.policy.mlp_extractor.policy_net[0]
    features = torch.from_numpy(rl.make(scenario()).reset(seed=0)[0])[None]
    n, w = actor.joints, actor.twist
    assert (n, w) == (7, 6)
    rows = actor.network(features).reshape(n, w + 1)
    wanted = rows[:, :w] @ features[0, :w] + rows[:, w] * features[0, w] / 0.2
    assert torch.allclose(actor(features)[0], wanted, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "changes", "size"),
    [("planar2-bent", {}, 3), ("panda-camera-slow", {"history": 2, "commands": 2}, 6), ("tiago-turn", {}, 6)],
)
def test_the_space_says_how_many_features_are_due(name, changes, size):
    """Bilinear actors suit all arms and tasks, and whatever else is observed."""
    envs = ikgym.sb3.make_vec(name, 2, **changes)
    model = PPO(BilinearPPOPolicy, envs, device="cpu", seed=0, **SHORT).learn(16)
    actor = model.policy.mlp_extractor.policy_net[0]
    assert (actor.twist, actor.joints) == (size, envs.scenario.joints)


def test_exploration_that_depends_on_the_state_is_refused():
    with pytest.raises(InvalidInputError, match="use_sde"):
        SAC(BilinearSACPolicy, ikgym.sb3.make_vec(scenario(), 2), device="cpu", use_sde=True, **LATE)


def test_agents_with_a_history_are_not_exported(tmp_path):
    envs = ikgym.sb3.make_vec(scenario(), 2, history=2)
    model = PPO("MlpPolicy", envs, device="cpu", **SHORT)
    with pytest.raises(InvalidInputError, match="no history"):
        export(model, envs, tmp_path / "agent.safetensors")


def test_a_lost_track_is_no_truncation():
    envs = ikgym.sb3.make_vec(scenario().replace(steps=400), 2, lost_distance=0.01)
    envs.seed(0)
    envs.reset()
    for _ in range(400):
        _, _, ended, infos = envs.step(np.full((2, 7), 4.0, dtype=np.float32))
        if ended.any():
            break
    info = infos[np.flatnonzero(ended)[0]]
    assert info["TimeLimit.truncated"] is False
    assert info["episode"]["l"] < 400
    assert info["terminal_observation"].shape == envs.observation_space.shape


@pytest.mark.parametrize(
    ("name", "word", "preview"),
    [
        ("agents.md", "make_vec", (10, 40, 100)),
        ("agents_rewards.md", "TD3(", SEEN.offsets),
        ("agents_rewards.md", "GroupBaseline", SEEN.offsets),
    ],
)
def test_the_snippets_of_the_pages_run(name, word, preview, tmp_path, monkeypatch):
    page = (pathlib.Path(__file__).parents[3] / "docs" / name).read_text(encoding="utf-8")
    (snippet,) = (text for text in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if word in text)
    monkeypatch.chdir(tmp_path)
    exec(compile(snippet, name, "exec", dont_inherit=True), {})
    agent = baselines.make("agent", "panda-random", path="mine.safetensors")
    assert agent.preview == preview


@pytest.mark.parametrize(
    ("changes", "more", "message"),
    [
        ({}, {}, r"expected 7 or 15 numbers behind the \d+ features, as InverseVecEnv shows with null_map=True"),
        ({"privileged": True}, {}, "expected 7 or 15 numbers behind"),
        ({"null_map": True}, {"use_sde": True}, "use_sde: expected false"),
    ],
)
def test_noise_in_the_null_space_needs_its_maps(changes, more, message):
    envs = InverseVecEnv(2, scenario(), hold=4, **changes)
    policy_kwargs = {"seen": envs.seen, "freedom": envs.freedom}
    with pytest.raises(InvalidInputError, match=message):
        PPO(NullSpacePPOPolicy, envs, device="cpu", policy_kwargs=policy_kwargs, **more, **SHORT)


@pytest.mark.parametrize(
    "make", [lambda: InverseVecEnv(2, scenario(), hold=4), lambda: ikgym.sb3.make_vec(scenario(), 2)]
)
def test_a_baseline_of_groups_needs_groups(make):
    envs = make()
    model = PPO("MlpPolicy", envs, device="cpu", **SHORT)
    with pytest.raises(InvalidInputError, match="expected an environment in which arms play the same episodes"):
        model.learn(8, callback=GroupBaseline())


def test_noise_in_the_null_space():
    """Density and samples are those of a normal distribution of (M h, ln λ); ln U has none."""
    rng, batch, r, n = np.random.default_rng(0), 4000, 2, 5
    maps = torch.from_numpy(rng.normal(size=(1, r, n))).float().expand(batch, r, n)
    mean, log_std = (
        torch.from_numpy(rng.normal(size=(1, 2 * n + 1))).float().expand(batch, -1),
        torch.tensor([0.1, -1.0, 0.5]),
    )
    noise = NullSpaceGaussian().proba_distribution(mean, maps, log_std)
    torch.manual_seed(0)
    actions = noise.sample()

    def done(said):
        return torch.cat([torch.einsum("brn,bn->br", maps, said[:, :n]), said[:, n : n + 1]], dim=1)

    wanted = torch.distributions.MultivariateNormal(done(mean), torch.diag((2.0 * log_std).exp()))
    torch.testing.assert_close(noise.log_prob(actions), wanted.log_prob(done(actions)))
    torch.testing.assert_close(noise.entropy(), wanted.entropy())
    moved = done(actions) - done(mean)
    np.testing.assert_allclose(np.cov(moved.numpy().T), np.diag(np.exp(2.0 * log_std.numpy())), atol=0.15)
    assert torch.equal(actions[:, n + 1 :], mean[:, n + 1 :])
    assert torch.equal(noise.get_actions(deterministic=True), mean)
    # What changes nothing has no density of its own, and no gradient.
    basis = torch.linalg.svd(maps[0])[2][r:]
    across = torch.nn.functional.pad(basis[:1].expand(batch, -1), (0, n + 1))
    torch.testing.assert_close(noise.log_prob(actions + across), noise.log_prob(actions))


def test_noise_in_the_null_space_leaves_the_tool_where_it_is():
    """Where the inverse is hardly damped: samples of h move the joints, and the tool as the mean does."""
    envs = InverseVecEnv(16, scenario(), Bilinear(damping=1e-9, matrix=False), 4, null_map=True)
    seen = torch.from_numpy(envs.reset())
    policy_kwargs = {"seen": envs.seen, "freedom": envs.freedom, "log_std_init": -1.0}
    model = PPO(NullSpacePPOPolicy, envs, device="cpu", seed=0, policy_kwargs=policy_kwargs, **SHORT)
    assert model.policy.log_std.shape == (2,)
    with torch.no_grad():
        moved = (model.policy(seen)[0] - model.policy.get_distribution(seen).mode())[:, :7].double()
    jacobians = np.empty((16, 42))
    jacobian_rows(envs._law.task.kind, envs._law.chain, envs._arms.q.numpy(), jacobians)
    tool = np.einsum("bwn,bn->bw", jacobians.reshape(16, 6, 7), moved.numpy())
    weighted = envs._law.held(envs._arms.q, envs._features, torch.nn.functional.pad(moved, (0, 8)))
    left = np.einsum("bwn,bn->bw", jacobians.reshape(16, 6, 7), weighted.reshape(16, 7, 7)[:, :, -1].numpy())
    assert np.linalg.norm(moved.numpy(), axis=1).min() > 1e-3
    assert np.abs(left).max() < 1e-5 < np.abs(tool).max()
