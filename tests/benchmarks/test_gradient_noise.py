"""How noisy gradients are: of numbers whose noise is known, and of actors, small."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from baselines.training import presets
from baselines.training.config.ppo import PPO
from baselines.training.randomness import deterministic_torch
from baselines.training.trainers import rollout_end
from benchmarks import gradient_noise
from benchmarks.gradient_noise import noise_of
from ikgym.exceptions import InvalidInputError, UnknownNameError

PRESET = """
[ppo]
scenario = "panda-random"
steps = 20
output = "inverse"
damping = 1e-2
hold = 4
n_steps = 5
n_envs = 4
batch_size = 20
hidden = [8]
[apg]
scenario = "panda-random"
steps = 20
damping = 1e-2
hold = 4
n_envs = 4
window = [8]
segment_steps = 16
hidden = [8]
"""


@pytest.fixture(autouse=True)
def one_thread():
    with deterministic_torch():
        yield


@pytest.mark.parametrize("size", [0.3, 3.0])
def test_noise_of_known_numbers(size):
    """tr Σ / |G|², without the bias that the squared mean of few gradients has."""
    rng, weights = np.random.default_rng(0), 200
    mean = rng.normal(size=weights)
    found = [noise_of(mean + size * rng.normal(size=(16, weights))) for _ in range(50)]
    wanted = size**2 * weights / float(mean @ mean)
    assert np.mean([noise.scale for noise in found]) == pytest.approx(wanted, rel=0.1)
    assert all(noise.least <= noise.scale for noise in found)
    assert np.mean([noise.least <= wanted for noise in found]) >= 0.9


def test_gradients_that_say_nothing():
    """Noise alone: no scale is told, but a bound from which it is."""
    noise = noise_of(np.random.default_rng(1).normal(size=(16, 200)))
    assert noise.scale == math.inf
    assert 3.0 < noise.least < math.inf


def test_gradients_are_those_beside_the_others_of_a_group(tmp_path, monkeypatch):
    """As in training: where all of a group do equally well there is none."""
    file = tmp_path / "tiny.toml"
    file.write_text(PRESET)
    config = dataclasses.replace(presets.configure(PPO, str(file))[0], group_size=4)
    assert np.linalg.norm(gradient_noise.of_ppo(config, 0).take()) > 0.0
    monkeypatch.setattr(rollout_end, "beside_the_others", lambda advantages, group_size: 0.0 * advantages)
    assert np.linalg.norm(gradient_noise.of_ppo(config, 0).take()) == 0.0


def test_gradients_of_actors(tmp_path, capsys):
    file = tmp_path / "tiny.toml"
    file.write_text(PRESET)
    changed = f"ppo={file},n_steps=1,batch_size=4,group_size=2"
    command = [f"ppo={file}", changed, f"apg={file}", "--batches", "3", "--critic-segments", "1"]
    gradient_noise.main(command)
    printed = capsys.readouterr().out.splitlines()
    wanted = [[f" ppo={file} ", " 80 "], [f" {changed} ", " 16 "], [f" apg={file} ", " 32 "]]
    assert [line.split("|")[1:3] for line in printed[2:]] == wanted
    cells = [cell.strip().removeprefix("> ") for line in printed[2:] for cell in line.split("|")[3:6]]
    assert all(float(cell) >= 0.0 for cell in cells)


@pytest.mark.parametrize(
    ("command", "error", "message"),
    [
        (["ppo=quick", "--batches", "2"], InvalidInputError, "batches: expected at least 3, got 2"),
        (["td3=quick"], UnknownNameError, "method"),
        (["ppo=quik"], UnknownNameError, "quick"),
        (["ppo=quick,group_sise=1"], UnknownNameError, "Did you mean 'group_size'"),
        (["ppo=quick,group_size"], InvalidInputError, "expected name=value,…, got 'group_size'"),
        (["ppo=quick,group_size=one"], InvalidInputError, "group_size: expected a whole number"),
    ],
)
def test_bad_commands(command, error, message):
    with pytest.raises(error, match=message):
        gradient_noise.main(command)
