"""Training of agents with memory."""

from __future__ import annotations

import numpy as np
import pytest

from baselines.training.randomness import deterministic_torch
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.training.small import play_segments, tiny, trainer_of

TINY = tiny("observe")


@pytest.mark.slow
@pytest.mark.parametrize("estimator", ["analytic", "ppo"])
def test_it_learns(estimator):
    """Exact sensors and a payload: the network finds out that measurements are exact, and that arms change."""
    config = TINY.replace(hidden=(12,), n_envs=16, plants=8, measurements=8, gradient_steps=10, batch_size=16)
    with deterministic_torch():
        before, *_, after = play_segments(trainer_of(config.replace(estimator=estimator)), range(4))
    assert after["train/loss"] < before["train/loss"] - 0.1
    assert np.isfinite(after["train/loss"])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"n_envs": 7}, "n_envs: expected a multiple of 3 plants"),
        ({"measurements": 1}, "measurements: expected a whole number of at least 2"),
        ({"batch_size": 7}, "batch_size: expected a whole number from 1 to 6"),
        ({"step_cost": 0.0}, "step_cost"),
        ({"group_size": 1}, "group_size: expected a whole number of at least 2, got 1"),
        ({"gamma": 0.0}, "gamma"),
        ({"log_std_end": 3.0}, "log_std_end"),
    ],
)
def test_refused(values, message):
    with pytest.raises(InvalidInputError, match=message):
        TINY.replace(**values)


def test_refused_scenarios():
    with pytest.raises(UnknownNameError, match=r"estimator 'pppo'\. Did you mean 'ppo'\?"):
        TINY.replace(estimator="pppo")
    with pytest.raises(InvalidInputError, match=r"task: expected pose, .* got 'skew'"):
        trainer_of(TINY.replace(task="skew"))
    with pytest.raises(InvalidInputError, match="reference joint path"):
        play_segments(trainer_of(TINY.replace(scenario="panda-circle")), [0])
