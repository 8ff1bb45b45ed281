"""Imitation and analytic policy gradient: what a segment does follows from state and number, and it is learning."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines.training.config.actor_only import APG, Imitate
from baselines.training.randomness import deterministic_torch
from baselines.training.trainers.apg import APGTrainer
from baselines.training.trainers.models import ALGORITHMS, network_outputs, weights_hash
from baselines.training.validation import play, validation_seeds
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.training.segments import made, play_segments
from tests.baselines.training.small import TINY

SMALL = {name: TINY[name] for name in ("scenario", "steps", "hidden", "offsets", "segments", "n_envs")}
OVER = {**SMALL, "scenario": "varga7-random", "base_policy": "dls", "null_space": 1e-2}
CONFIGS = {
    "apg": APG(**SMALL, window=7, windows=4),
    "apg over dls": APG(**OVER, window=7, windows=4, algorithm="td3"),
    "apg, whole poses": APG(**{**OVER, "base_policy": None}, task="pose", window=30, windows=1, algorithm="sac"),
    "imitate": Imitate(**SMALL, expert="dls", gradient_steps=5, batch_size=16, example_every=2, buffer_size=70),
    "imitate over dls": Imitate(**OVER, expert="rhc:horizon=5", gradient_steps=5, batch_size=16, algorithm="sac"),
}


@pytest.fixture(autouse=True)
def one_thread():
    with deterministic_torch():
        yield


def cost(trainer, config, episodes=8):
    """Geometric mean over validation episodes."""
    scenario = config.make_scenario()
    seeds = validation_seeds(scenario, episodes)
    costs, *_ = play(lambda features: network_outputs(trainer.model, features), config.processing, scenario, seeds)
    return np.exp(np.log(costs).mean())


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_a_segment_follows_from_state_and_number(config, tmp_path):
    undisturbed = made(config)
    play_segments(undisturbed, [0])
    torch.save(undisturbed.state(), tmp_path / "state.pt")
    wanted = play_segments(undisturbed, [1, 2])

    other = made(config, seed=7)  # as if it were another one
    play_segments(other, [0], seed=7)
    other = made(config)
    other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
    assert play_segments(other, [1, 2]) == wanted
    assert weights_hash(other.model) == weights_hash(undisturbed.model)
    assert other.steps == undisturbed.steps


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS.keys())
def test_ordinary_models_come_out(config):
    trainer = made(config)
    before = weights_hash(trainer.model)
    play_segments(trainer, [0])
    assert type(trainer.model) is ALGORITHMS[config.algorithm]
    assert weights_hash(trainer.model) != before
    played = config.window * config.windows if isinstance(config, APG) else config.steps
    assert trainer.steps == config.n_envs * played


def test_gradient_of_a_window_is_that_of_its_loss():
    """Along a direction in the space of weights, against central differences: through arm, policy under it and all."""
    # So long a prior makes the weights of the costs constant; they are not differentiated.
    config = APG(
        **{**OVER, "hidden": (16,), "n_envs": 6, "activation": "tanh"},
        window=15,
        max_gradient_share=1e9,
        cost_prior_steps=1e12,
    )
    losses, slope = {}, 0.0
    for along in (0.0, 0.002, -0.002):
        trainer = made(config)
        assert isinstance(trainer, APGTrainer)
        parameters, generator = list(trainer._actor.parameters()), torch.Generator().manual_seed(5)
        direction = [torch.randn(parameter.shape, generator=generator) for parameter in parameters]
        with torch.no_grad():
            for parameter, part in zip(parameters, direction, strict=True):
                parameter.add_(part, alpha=0.1 + along)
        loss, _ = trainer._window(np.random.default_rng(0))
        losses[along] = loss.item()
        if along == 0.0:
            gradients = torch.autograd.grad(loss, parameters)
            slope = sum((g * part).sum().item() for g, part in zip(gradients, direction, strict=True))
    assert slope == pytest.approx((losses[0.002] - losses[-0.002]) / 0.004, rel=0.02)


def test_analytic_policy_gradient_learns():
    """From rest to within a few centimetres: a gradient of the wrong sign, or none, stays at 4e8."""
    config = APG(
        scenario="varga7-random",
        steps=60,
        hidden=(32, 32),
        offsets=(1, 2, 10, 30),
        action_scale=5.0,
        n_envs=32,
        window=10,
        windows=40,
        segments=3,
        learning_rate=3e-3,
    )
    trainer = made(config)
    before = cost(trainer, config)
    play_segments(trainer, range(3))
    assert cost(trainer, config) < 0.05 * before


def test_imitation_learns():
    """A residual agent comes to do what another setting of the policy under it does."""
    config = Imitate(
        scenario="varga7-random",
        steps=60,
        base_policy="dls:gain=0.02",
        hidden=(32, 32),
        offsets=(1, 2, 10, 30),
        expert="dls:gain=0.3,damping=1e-2",
        n_envs=32,
        example_every=1,
        segments=3,
        gradient_steps=300,
        batch_size=256,
        learning_rate=3e-3,
    )
    trainer = made(config)
    play_segments(trainer, range(3))
    features, wanted = trainer._examples
    missed = network_outputs(trainer.model, features.numpy()) - wanted.numpy()
    # Outputs of 0 would miss as much as the targets are, and a wrong gradient more.
    assert np.median(np.abs(missed)) < 0.7 * np.median(np.abs(wanted.numpy()))


def test_episodes_are_of_the_split_for_training():
    trainer = made(CONFIGS["apg"])
    play_segments(trainer, [0, 1])
    assert set(trainer._arms.seed.tolist()) <= set(scenarios.SPLITS["train"])


@pytest.mark.parametrize(
    ("kind", "changes", "error", "message"),
    [
        (APG, {"window": 0}, InvalidInputError, "window"),
        (APG, {"reset_distance": -1.0}, InvalidInputError, "reset_distance"),
        (APG, {"algorithm": "ddpg"}, UnknownNameError, "algorithm"),
        (Imitate, {"beta": 1.5}, InvalidInputError, "beta: expected a number from 0 to 1, got 1.5"),
        (Imitate, {"tolerance": 0.0}, InvalidInputError, "tolerance"),
        (Imitate, {"gradient_steps": 0}, InvalidInputError, "gradient_steps"),
    ],
)
def test_bad_configurations_are_refused(kind, changes, error, message):
    with pytest.raises(error, match=message):
        kind(**changes)


def test_unknown_experts_are_refused():
    with pytest.raises(UnknownNameError, match="Did you mean 'dls'"):
        made(Imitate(**SMALL, expert="dlss"))
