"""Trainers of Stable-Baselines3: what a segment does follows from their state and its number."""

from __future__ import annotations

import copy

import numpy as np
import pytest
import torch

from baselines.training import methods
from baselines.training.groups import beside_the_others
from baselines.training.randomness import deterministic_torch, episode_seed, reseed
from baselines.training.trainers.models import algorithm_of, mean_network, network_outputs, weights_hash
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from tests.baselines.training.segments import made, play_segments
from tests.baselines.training.small import OVER, TINY, tiny
from tests.comparison import identical

METHODS = ["ppo", "sac", "td3"]
NOISY = [
    ("ppo", {}),
    ("ppo", {"use_sde": True, "sde_sample_freq": 4, "n_steps": 10, "episodes": 2, "target_kl": 0.5}),
    ("ppo", {"initial_episode_steps": 5, "segments": 5}),
    ("sac", {"learning_starts": 0}),
    ("sac", {"use_sde": True, "sde_sample_freq": 4}),
    ("td3", {"buffer_size": 64}),
    ("td3", {"action_noise_correlation": 4, "policy_delay": 3}),
]
BILINEAR = [(method, {"output": "bilinear", "scenario": "panda-random"}) for method in METHODS]
#: Ten actions of two steps an episode.
INVERSE = [
    (method, {"output": "inverse", "damping": 1e-2, "hold": 2, "scenario": "panda-random", **more})
    for method, more in [
        *((method, {}) for method in METHODS),
        ("ppo", {"privileged": True, "critic_epochs": 2, "null_noise": 0.2}),
        ("ppo", {"null_space_noise": True, "group_size": 2}),
        ("ppo", {"privileged": True, "group_size": 2, "critic_epochs": 2, "critic_group_weight": 3.0}),
        ("sac", {"privileged": True, "null_noise": 0.2}),
        ("td3", {"privileged": True, "null_noise": 0.2, "log_above": 5.0}),
    ]
]


@pytest.fixture(autouse=True)
def one_thread():
    with deterministic_torch():
        yield


@pytest.mark.parametrize(("method", "changes"), [*NOISY, *BILINEAR, *INVERSE], ids=str)
def test_a_segment_follows_from_state_and_number(method, changes, tmp_path):
    """A trainer that was put where another one stood goes on like that one: same metrics, same weights, same state."""
    config = tiny(method, **changes)
    undisturbed = made(config)
    play_segments(undisturbed, [0, 1])
    torch.save(undisturbed.state(), tmp_path / "state.pt")
    at_two = weights_hash(undisturbed.model)
    wanted = play_segments(undisturbed, [2, 3])

    other = made(config, seed=7)  # as if it were another one
    play_segments(other, [0], seed=7)
    other = made(config)
    other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
    assert weights_hash(other.model) == at_two
    assert other.steps == 2 * config.n_envs * config.episodes * config.steps
    assert play_segments(other, [2, 3]) == wanted
    assert weights_hash(other.model) == weights_hash(undisturbed.model) != at_two
    assert same(other.state(), undisturbed.state())


def test_the_critic_learns_by_itself_in_passes_of_its_own():
    """Its weights change, and those of the actor are the same whatever the passes are, until the critic judges."""
    changes = {"output": "inverse", "damping": 1e-2, "hold": 2, "scenario": "panda-random", "critic_warmup": 1}
    alone, with_actor = (made(tiny("ppo", **changes, critic_epochs=epochs, segments=1)) for epochs in (3, 0))
    before = {name: tensor.clone() for name, tensor in alone.model.policy.named_parameters()}
    for trainer in (alone, with_actor):
        play_segments(trainer, [0])
    for name, tensor in alone.model.policy.named_parameters():
        assert torch.equal(tensor, before[name]) != ("value_net" in name), name
    assert alone.model.vf_coef == 0.0
    assert with_actor.model.vf_coef == 0.5
    values = [trainer.model.policy.value_net.weight for trainer in (alone, with_actor)]
    assert not torch.equal(*values)


def test_advantages_are_those_beside_the_others_of_a_group():
    advantages = np.random.default_rng(0).normal(size=(3, 8)).astype(np.float32)
    beside = beside_the_others(advantages, 4)
    for t, row in np.ndindex(3, 8):
        group = range(row // 4 * 4, row // 4 * 4 + 4)
        others = [advantages[t, other] for other in group if other != row]
        assert beside[t, row] == pytest.approx(advantages[t, row] - np.mean(others), abs=1e-6)
    # What differs from group to group alone says nothing of actions.
    np.testing.assert_allclose(beside_the_others(np.arange(2.0).repeat(4)[None] * 100.0, 4), 0.0, atol=1e-5)


def test_a_critic_that_weighs_groups_tells_better_what_differs_in_them():
    """Of returns that differ by much from group to group and by little in them."""
    output = {"output": "inverse", "damping": 1e-2, "hold": 2, "scenario": "panda-random", "privileged": True}
    rng = np.random.default_rng(0)
    seen = rng.normal(size=(64, 4, 1)).repeat(2, axis=1) + 0.3 * rng.normal(size=(64, 8, 1))
    returns = (100.0 * np.sin(40.0 * seen.mean(1, keepdims=True)) + seen)[:, :, 0].astype(np.float32)

    def explained(weight):
        more = {"n_envs": 8, "group_size": 8, "critic_epochs": 1, "critic_group_weight": weight}
        trainer = made(tiny("ppo", **output, **more, n_steps=10, batch_size=40))
        observations = np.zeros((64, 8, *trainer._env.observation_space.shape), np.float32)
        observations[:, :, :1] = seen
        callback, policy = trainer._callback().callbacks[-1], trainer.model.policy
        callback.init_callback(trainer.model)
        torch.manual_seed(0)
        for _ in range(100):
            callback.fit(observations, torch.from_numpy(returns))
        with torch.no_grad():
            values = policy.predict_values(torch.from_numpy(observations).flatten(0, 1)).reshape(64, 8).numpy()
        inside = [array - array.mean(axis=1, keepdims=True) for array in (values, returns)]
        return 1.0 - np.var(inside[0] - inside[1]) / np.var(inside[1])

    assert explained(1000.0) > max(explained(0.0), 0.0)


@pytest.mark.parametrize(
    ("method", "changes"),
    [
        ("ppo", {"log_std_init": -1.0}),
        ("ppo", {"log_std_init": -1.0, "use_sde": True}),
        ("ppo", {"log_std_init": -4.0, "log_std_end": -1.0}),
        ("sac", {"log_std_init": -1.0}),
        ("sac", {"log_std_init": -1.0, "use_sde": True}),
        ("td3", {"action_noise": np.exp(-1.0)}),
        ("td3", {"action_noise": np.exp(-1.0) * np.sqrt(2.0), "action_noise_correlation": 4}),
    ],
)
def test_null_motion_has_noise_of_its_own(method, changes):
    output = {"output": "inverse", "damping": 1e-2, "hold": 2, "scenario": "panda-random", "null_noise": 0.1}
    trainer = made(tiny(method, **output, **changes, segments=2))
    if "log_std_end" in changes:
        play_segments(trainer, [1])
    if method == "td3":
        log_std = np.log(trainer.model.action_noise._sigma)
    elif method == "ppo":
        log_std = trainer.model.policy.log_std.detach().numpy()
    else:
        log_std = trainer.model.policy.actor.log_std
        log_std = (log_std if "use_sde" in changes else log_std.bias).detach().numpy()
    wanted = np.repeat([np.log(0.1) - 1.0, -1.0], [7, 8])
    np.testing.assert_allclose(log_std, np.broadcast_to(wanted, log_std.shape), atol=1e-6)


def same(a, b):
    """Whether two states are the same bit for bit."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    return identical(a.numpy(), b.numpy()) if isinstance(a, torch.Tensor) else a == b


@pytest.mark.parametrize(("method", "changes"), [*((method, {}) for method in METHODS), INVERSE[3]])
def test_every_part_of_the_state_matters(method, changes):
    """Without it, whatever it is, the segment to come is another one; but for counters that only count."""
    config = tiny(method, **changes)
    trainer = made(config)
    play_segments(trainer, [0, 1])
    state = trainer.state()
    play_segments(trainer, [2])
    wanted = weights_hash(trainer.model)
    start = made(config).state()
    for part in state:
        for name in state[part]:
            if name in {"_episode_num", "num_timesteps", "pos", "full"} or (name == "_n_updates" and method != "td3"):
                continue
            if name == "ent_coef_optimizer":  # with gradients that hardly change, Adam forgets little
                continue
            forgetful = copy.deepcopy(state)
            if part == "buffer":
                forgetful[part][name] = torch.zeros_like(state[part][name])
                if name in {"dones", "timeouts"}:  # all episodes end by the clock, so one makes up for the other
                    forgetful[part]["dones"], forgetful[part]["timeouts"] = torch.ones(()), torch.zeros(())
                    forgetful[part] |= {"dones": torch.ones_like(state[part]["dones"])}
                    forgetful[part] |= {"timeouts": torch.zeros_like(state[part]["dones"])}
            else:
                forgetful[part][name] = 1 if name == "_n_updates" else start[part][name]
            other = made(config)
            other.restore(forgetful)
            play_segments(other, [2])
            assert weights_hash(other.model) != wanted, (part, name)


def test_state_is_a_copy():
    trainer = made(tiny("sac"))
    play_segments(trainer, [0, 1])
    state = trainer.state()
    before = copy.deepcopy(state)
    play_segments(trainer, [2])
    assert same(state, before)
    assert not same(trainer.state(), before)


@pytest.mark.parametrize("method", METHODS)
def test_all_episodes_are_played_to_their_end(method):
    trainer = made(tiny(method, episodes=2))
    play_segments(trainer, [0])
    assert len(trainer.model.ep_info_buffer) == 2 * 4
    assert trainer.steps == 2 * 4 * 20
    assert (trainer._env.venv._envs._simulator.steps_made == 0).all()


def test_episodes_grow():
    """Over the first half of the segments, through what divides a segment; costs are those of whole episodes."""
    trainer = made(tiny("ppo", initial_episode_steps=5, segments=8, batch_size=80))
    lengths, costs = [], []
    for number in range(8):
        costs.append(play_segments(trainer, [number])[0]["train/cost"])
        lengths.append({episode["l"] for episode in trainer.model.ep_info_buffer})
        assert len(trainer.model.ep_info_buffer) == 4 * 20 / lengths[-1].copy().pop()
    assert lengths == [{5}, {5}, {10}, {20}, {20}, {20}, {20}, {20}]
    returns = [-episode["r"] for episode in trainer.model.ep_info_buffer]
    assert costs[-1] == pytest.approx(np.exp(np.mean(np.log(returns))))
    with pytest.raises(
        InvalidInputError, match="initial_episode_steps: expected a divisor of the 20 steps of an episode, got 7"
    ):
        made(tiny("ppo", initial_episode_steps=7))


@pytest.mark.parametrize("method", METHODS)
def test_first_outputs_are_almost_zero(method):
    trainer = made(tiny(method, **{**OVER, "hidden": (64, 64)}))
    trainer._env.seed(0)
    given = network_outputs(trainer.model, trainer._env.reset())
    assert 0.0 < np.abs(given).max() < 0.05


@pytest.mark.parametrize(("method", "changes"), NOISY, ids=str)
def test_network_outputs_are_those_of_the_model(method, changes):
    model = made(tiny(method, **changes)).model
    assert algorithm_of(model) == method
    features = np.random.default_rng(0).normal(0.0, 3.0, (50, model.observation_space.shape[0])).astype(np.float32)
    with torch.no_grad():
        mean_network(model)[-1].weight.mul_(300.0)
    wanted = model.predict(features, deterministic=True)[0]
    given = network_outputs(model, features)
    assert np.abs(given).max() > 0.9
    np.testing.assert_allclose(given, wanted, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_critics_warm_up_while_the_actor_rests(method):
    trainer = made(tiny(method, critic_warmup=2, **({} if method == "ppo" else {"learning_starts": 80})))
    parts = trainer.state()["parameters"]["policy"]
    rest = {name: tensor for name, tensor in parts.items() if resting(name)}
    assert rest
    play_segments(trainer, [0, 1])
    after = trainer.state()["parameters"]["policy"]
    assert all(after[name].equal(tensor) for name, tensor in rest.items())
    moved = [name for name, tensor in parts.items() if not after[name].equal(tensor)]
    assert any("value_net" in name or "critic" in name for name in moved)
    temperature = trainer.state()["others"].get("log_ent_coef")
    if temperature is not None:
        assert temperature.item() == pytest.approx(np.log(0.01), rel=1e-6)
    assert all(parameter.requires_grad for parameter in trainer._actor())
    play_segments(trainer, [2])
    finally_ = trainer.state()["parameters"]["policy"]
    assert not any(finally_[name].equal(tensor) for name, tensor in rest.items())


def resting(name):
    return name.startswith(("mlp_extractor.policy_net", "action_net", "log_std", "actor."))


def test_nothing_is_learned_while_memory_is_filled():
    trainer = made(tiny("td3", learning_starts=160))
    before = weights_hash(trainer.model)
    play_segments(trainer, [0, 1])
    assert weights_hash(trainer.model) == before
    assert trainer.model.replay_buffer.size() == 40
    play_segments(trainer, [2])
    assert weights_hash(trainer.model) != before


@pytest.mark.parametrize(("learning_starts", "updates"), [(None, 0), (0, 4), (20, 3), (79, 1), (80, 0)])
def test_learning_starts_after_steps_of_all_arms(learning_starts, updates):
    """As in Stable-Baselines3: an update, here each 5 steps of 4 arms, needs more steps than that before it. Until
    then the agent acts as it is; at random, its actions would fill the box."""
    trainer = made(tiny("td3", learning_starts=learning_starts, gradient_steps=1, action_noise=0.01))
    play_segments(trainer, [0])
    assert trainer.model._n_updates == updates
    assert np.abs(trainer.model.replay_buffer.actions[:20]).max() < 0.2
    play_segments(trainer, [1])
    assert trainer.model._n_updates == updates + 4


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({}, ("auto_0.01", -9.0)),  # three joints
        ({"target_entropy": -2.0, "ent_coef": "auto_0.5"}, ("auto_0.5", -2.0)),
    ],
)
def test_entropy_of_sac_is_that_of_all_joints(changes, wanted):
    model = made(tiny("sac", **changes)).model
    assert (model.ent_coef, model.target_entropy) == wanted
    assert model.log_ent_coef.exp().item() == pytest.approx(float(wanted[0].split("_")[1]))


def test_a_fixed_weight_of_the_entropy():
    trainer = made(tiny("sac", ent_coef=0.25, critic_warmup=2, learning_starts=0))
    play_segments(trainer, [0, 1, 2])
    assert trainer.state()["others"]["ent_coef_tensor"].item() == 0.25


def test_learning_rate_of_a_segment():
    trainer = made(tiny("sac", learning_rate=1e-3, learning_rate_end=1e-5))
    for number, wanted in enumerate([1e-3, 1e-4, 1e-5]):
        play_segments(trainer, [number])
        rates = {group["lr"] for group in trainer.model.actor.optimizer.param_groups}
        assert rates == {trainer.model.lr_schedule(0.5)} or number == 0  # at first it collects
        assert trainer.model.lr_schedule(0.5) == pytest.approx(wanted)


def test_training_noise_of_td3():
    """Both kinds have the standard deviation asked for; one forgets itself at once, the other as slowly as asked."""
    for steps in (1, 20):
        noise = made(tiny("td3", action_noise=0.3, action_noise_correlation=steps)).model.action_noise
        reseed(0, 0)
        noise.reset()
        drawn = np.array([noise() for _ in range(20_000)])[100:]
        assert drawn.std() == pytest.approx(0.3, rel=0.1)
        lag = (drawn[:-20] * drawn[20:]).mean() / drawn.var()
        assert lag == pytest.approx(0.0 if steps == 1 else np.exp(-1), abs=0.1)


@pytest.mark.parametrize(
    ("method", "changes", "message"),
    [
        ("ppo", {"n_steps": 15}, "n_steps: expected a divisor of the 20 steps of a segment, got 15"),
        ("ppo", {"batch_size": 33}, "batch_size: expected a divisor of the 80 transitions"),
        ("td3", {"train_freq": 3}, "train_freq: expected a divisor of the 20 steps"),
        ("ppo", {"base_policy": "oracle"}, "reference 'oracle'"),
    ],
)
def test_refused(method, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        made(tiny(method, **changes))


def test_episodes_are_of_the_split_for_training():
    split = scenarios.SPLITS["train"]
    drawn = [episode_seed(seed, segment, 100) for seed in range(5) for segment in range(50)]
    assert len(set(drawn)) == len(drawn)
    assert min(drawn) >= split.start
    assert max(drawn) + 100 <= split.stop
    assert max(drawn) - min(drawn) > len(split) / 2
    assert episode_seed(3, 4, len(split)) == split.start
    with pytest.raises(InvalidInputError, match="n_envs: expected at most"):
        episode_seed(3, 4, len(split) + 1)


def test_seeding_is_all_there_is():
    """The same for the same seed and segment, another for another; and what was drawn before does not matter."""

    def drawn(seed, segment):
        reseed(seed, segment)
        return torch.rand(3).tolist(), np.random.random(3).tolist()  # noqa: NPY002

    assert drawn(1, 2) == drawn(1, 2)
    several = [drawn(seed, segment) for seed in (0, 1) for segment in (None, 0, 1)]
    assert all(a != b for i, a in enumerate(several) for b in several[:i])


def test_torch_is_left_as_it_was():
    threads = torch.get_num_threads()
    assert threads == 1
    assert torch.are_deterministic_algorithms_enabled()
    torch.set_num_threads(2)
    with deterministic_torch():
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == 2
    torch.set_num_threads(1)


@pytest.mark.slow
def test_ppo_learns():
    """Tracking by itself, from nothing: within seconds it comes ten times closer than an arm that does not move, which
    a gradient with a wrong sign or scale would miss."""
    config = methods.get("ppo").config(
        **{
            **TINY,
            "steps": 100,
            "hidden": (32, 32),
            "segments": 30,
            "n_envs": 16,
            "batch_size": 200,
            "learning_rate": 3e-3,
            "learning_rate_end": 3e-4,
            "gamma": 0.9,
            "log_std_init": -1.0,
        }
    )
    trainer = made(config)
    costs = [metrics["train/cost"] for metrics in play_segments(trainer, range(30))]
    print(costs)
    assert costs[-1] < 0.1 * costs[0]
