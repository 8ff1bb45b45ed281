"""How learning is measured, by a model that needs none."""

from __future__ import annotations

import numpy as np
import pytest
from stable_baselines3 import PPO

from benchmarks import learning
from ikgym.rl import Learning


class Transposed:
    """Joint velocities along the gradient of the error, which agents are shown: two gains and no network."""

    def __init__(self, position, orientation):
        self.gains = np.repeat([position, orientation], 7) / Learning.share

    def predict(self, features, deterministic):
        assert deterministic
        along = features[:, 7:21] * self.gains
        return (along[:, :7] + along[:, 7:]).astype(np.float32), None


def test_a_linear_law_of_the_features_follows_paths_to_centimetres():
    followed = learning.largest_errors(Transposed(0.5, 0.5), "panda-random", "validation", 8)
    lost = learning.largest_errors(Transposed(0.0, 0.0), "panda-random", "validation", 8)
    assert followed.shape == (8,)
    assert np.median(followed) < 0.03
    assert np.median(lost) > 0.15


@pytest.mark.usefixtures("one_thread")
def test_training_stops_in_time_and_prints_errors(monkeypatch, capsys):
    given = []

    def short(policy, envs, **parameters):
        assert envs.action_space.high[0] == 4.0  # 2 / share
        return PPO(policy, envs, n_steps=8, batch_size=16, n_epochs=1, **parameters)

    monkeypatch.setattr(learning, "PPO", short)
    monkeypatch.setattr(learning, "largest_errors", lambda *a: given.append(a[-1]) or np.array([0.01, 0.03]))
    learning.main(learning.Command(minutes=0.001, episodes=2, every=1000, change=("share=0.5", "history=2")))
    assert given == 2 * [{"share": 0.5, "history": 2}]
    assert capsys.readouterr().out.count("validation: median    20.00 mm") == 2
