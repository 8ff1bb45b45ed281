"""How learning is measured, by a model that needs none."""

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
    followed, cost = learning.played(Transposed(0.5, 0.5), "panda-random", "validation", 8)
    lost, _ = learning.played(Transposed(0.0, 0.0), "panda-random", "validation", 8)
    exact, least = learning.yardstick("panda-random", "validation", 8)
    assert followed.shape == cost.shape == (8,)
    assert np.median(followed) < 0.03
    assert np.median(lost) > 0.15
    assert np.median(exact) < 1e-4
    assert (cost > least).all()


@pytest.mark.usefixtures("one_thread")
def test_training_stops_in_time_and_prints_errors(monkeypatch, capsys):
    given = []

    def short(policy, envs, **parameters):
        assert envs.action_space.high[0] == 4.0  # 2 / share
        return PPO(policy, envs, n_steps=8, batch_size=16, n_epochs=1, **parameters)

    monkeypatch.setattr(learning, "PPO", short)
    found = np.array([0.01, 0.03]), np.array([2.0, 8.0])
    monkeypatch.setattr(learning, "played", lambda *a: given.append(a[-1]) or found)
    monkeypatch.setattr(learning, "yardstick", lambda *a: (np.array([1e-5, 3e-5]), np.array([1.0, 1.0])))
    learning.main(learning.Command(minutes=0.001, episodes=2, every=1000, change=("share=0.5", "history=2")))
    assert given == 2 * [{"share": 0.5, "history": 2}]
    printed = capsys.readouterr().out
    assert printed.count("validation: median    20.00 mm") == 2
    assert printed.count("dls 0.0200 mm; cost × 4\n") == 2
