"""Training of agents with memory: it learns, and what a segment does follows from state and number."""

from __future__ import annotations

import numpy as np
import pytest
import torch

import baselines
from baselines.agents.recurrent.files import load_recurrent
from baselines.training.config.observe import Observe
from baselines.training.randomness import deterministic_torch
from baselines.training.run import train
from baselines.training.trainers.models import weights_hash
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.training.segments import made, play_segments
from tests.baselines.training.small import about, timeless

TINY = Observe(
    base_policy="dls:damping=1e-2", steps=60, hidden=(6,), n_envs=6, plants=3, measurements=8, gradient_steps=2,
    batch_size=4, segments=3, evaluate_every=2, validation_episodes=2,
)  # fmt: skip


@pytest.fixture(autouse=True)
def one_thread():
    with deterministic_torch():
        yield


@pytest.mark.parametrize("estimator", ["analytic", "ppo"])
def test_a_segment_follows_from_state_and_number(tmp_path, estimator):
    config = TINY.replace(estimator=estimator)
    undisturbed = made(config)
    play_segments(undisturbed, [0])
    torch.save(undisturbed.state(), tmp_path / "state.pt")
    wanted = play_segments(undisturbed, [1, 2])
    other = made(config)
    other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
    assert play_segments(other, [1, 2]) == wanted
    assert weights_hash(other.model) == weights_hash(undisturbed.model)
    assert other.steps == undisturbed.steps > 0


def test_a_run_repeats_and_its_agent_plays(tmp_path):
    once, again = (train(TINY, 3, tmp_path / name) for name in ("once", "again"))
    assert once.weights_sha256 == again.weights_sha256 == about(tmp_path / "once")["weights_sha256"]
    assert timeless(tmp_path / "once") == timeless(tmp_path / "again")
    assert once.score == again.score
    assert weights_hash(made(TINY, seed=4).model) != weights_hash(made(TINY, seed=3).model)
    file = load_recurrent(tmp_path / "once" / "agent.safetensors")
    assert file.about["training"]["seed"] == 3
    policy = baselines.make("recurrent", TINY.make_scenario(), path=file.source)
    assert (policy.policy, policy.options["damping"]) == ("dls", 1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["analytic", "ppo"])
def test_it_learns(estimator):
    """Exact sensors and a payload: the network finds out that they are to be believed, and arms change."""
    config = TINY.replace(hidden=(12,), n_envs=16, plants=8, measurements=8, gradient_steps=10, batch_size=16)
    trainer = made(config.replace(estimator=estimator))
    before, *_, after = play_segments(trainer, range(4))
    assert after["train/loss"] < before["train/loss"] - 0.1
    assert np.isfinite(after["train/loss"])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"offsets": (1, 2)}, "no offsets"),
        ({"activation": "silu"}, "no activation"),
        ({"init": "agent.safetensors"}, "begin anew"),
        ({"n_envs": 7}, "n_envs: expected a multiple of 3 plants"),
        ({"measurements": 1}, "measurements: expected a whole number of at least 2"),
        ({"batch_size": 7}, "batch_size: expected a whole number from 1 to 6"),
        ({"step_cost": 0.0}, "step_cost"),
        ({"gamma": 0.9}, "gamma: expected 0.95 for an estimator that is analytic, got 0.9"),
        ({"estimator": "ppo", "group_size": 1}, "group_size: expected a whole number of at least 2, got 1"),
        ({"estimator": "ppo", "gamma": 0.0}, "gamma"),
        ({"estimator": "ppo", "log_std_end": 3.0}, "log_std_end: expected a number from -20 to 2, got 3"),
    ],
)
def test_refused(values, message):
    with pytest.raises(InvalidInputError, match=message):
        TINY.replace(**values)


def test_a_base_policy_has_to_be_one():
    with pytest.raises(UnknownNameError, match="dls"):
        made(TINY.replace(base_policy="dlss")).score(1)


def test_an_estimator_has_to_be_one():
    with pytest.raises(UnknownNameError, match=r"estimator 'pppo'\. Did you mean 'ppo'\?"):
        TINY.replace(estimator="pppo")


def test_poses_have_to_be_whole():
    with pytest.raises(InvalidInputError, match=r"task: expected pose, .* got 'skew'"):
        made(TINY.replace(task="skew"))


def test_there_has_to_be_a_path_to_follow():
    with pytest.raises(InvalidInputError, match="reference joint path"):
        play_segments(made(TINY.replace(scenario="panda-circle")), [0])
