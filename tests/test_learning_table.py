"""The scores of Stable-Baselines3 on the page of agents are those of the settings that are published."""

import pytest

from baselines.evaluation.table import from_csv, to_csv
from baselines.training.options import Rewards
from baselines.training.zoo import read_settings
from benchmarks import learning
from ikgym import rl
from ikgym.exceptions import UnknownNameError

CURVES = from_csv(learning.CURVES.read_text(encoding="utf-8"))
PUBLISHED = [line for line in CURVES if line["settings"] in ("published", "inverse")]


def test_curves_are_of_the_published_settings(tmp_path):
    runs = {tuple(line[name] for name in learning.RUN) for line in PUBLISHED}
    for env, algorithm, settings, _, seed in runs:
        imitates = algorithm == "regression"
        config = Rewards(algorithm="sac" if imitates else algorithm, env=env, inverse=settings == "inverse")
        training = learning.Training(config, int(seed), tmp_path, imitates)
        assert tuple(learning.about(training).values()) in runs


def test_the_table_is_that_of_the_curves():
    assert to_csv(learning.table(CURVES)) == learning.TABLE.read_text(encoding="utf-8")


def test_what_agents_learn_within_ten_minutes():
    for line in learning.table(CURVES):
        assert line["score"] >= 0.4
        assert line["seeds"] == 5
        assert line["core_minutes"] <= 10.0


def test_algorithms_are_trained_where_settings_are_published():
    trainings = learning.Command(algorithms=("ppo", "recurrent_ppo"), seeds=(0, 1)).trainings()
    pairs = [(one.config.env, one.config.algorithm, one.seed) for one in trainings]
    recurrent = [(env, "recurrent_ppo") for env in ("ikgym/Camera-v0", "ikgym/Payload-v0")]
    assert set(pairs) == {(*one, seed) for one in [*((env, "ppo") for env in rl.IDS), *recurrent] for seed in (0, 1)}
    [other] = learning.Command(("recurrent_ppo",), ("ikgym/Track-v0",), seeds=(0,)).trainings()
    with pytest.raises(UnknownNameError, match="Available: ikgym/Camera-v0, ikgym/Payload-v0"):
        read_settings(other.config)


def test_another_training_replaces_its_lines(tmp_path, monkeypatch):
    small = tmp_path / "curves.csv"
    monkeypatch.setattr(learning, "EPISODES", 2)
    training = learning.Training(Rewards(env="ikgym/Track-v0", total_timesteps=2048, episodes=2), 0, tmp_path)
    lines = learning.curve(training)
    small.write_text(to_csv(lines), encoding="utf-8")
    assert from_csv(small.read_text(encoding="utf-8"))[-1]["test_log_cost"]
    assert [bool(line["test_log_cost"]) for line in lines] == [*[False] * (len(lines) - 1), True]
    [row] = learning.table(lines, seeds=1)
    assert row["seeds"] == 1
    assert row["best"] == pytest.approx(
        rl.score({"ikgym/Track-v0": [[1.0] * learning.EPISODES]}, "test")["ikgym/Track-v0"].best, abs=1e-3
    )
    assert read_settings(training.config)["n_envs"] == 64
    [panel] = learning.picture(lines).axes
    assert len(panel.lines) == 1


def test_regression_learns_the_policy_with_score_1_within_seconds(tmp_path, monkeypatch):
    monkeypatch.setattr(learning, "EPISODES", 4)
    settings = {**read_settings(Rewards(algorithm="sac", env="ikgym/Track-v0")), "n_timesteps": 12_800}
    monkeypatch.setattr(learning, "read_settings", lambda config: settings)
    [training] = learning.Command(
        environments=("ikgym/Track-v0",), seeds=(0,), kind="regression", runs=tmp_path
    ).trainings()
    [line] = learning.curve(training)
    assert line["algorithm"] == "regression"
    assert float(line["score"]) > 0.4
