"""Data sets of Minari, which the environment plays again bit for bit."""

import pathlib

import gymnasium as gym
import numpy as np
import pytest

pytest.importorskip("minari", reason='needs Minari: pip install "ikgym[data]"')

import minari

from baselines.cli.commands.dataset import main
from baselines.datasets import write
from baselines.evaluate import evaluate
from baselines.files import ResultsError
from ikgym import scenarios

SHORT = scenarios.get("varga7-random").replace(name="short", steps=40)
GIVEN = {"scenario": SHORT, "policy": "dls:damping=1e-2", "episodes": 3}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets") / "dls-v0"
    write(**GIVEN, out=folder)
    return folder


def contents(folder):
    data = minari.MinariDataset(folder / "data")
    return list(data.iterate_episodes()), data


def equal(one, other):
    """Whether two trees of arrays are the same, bit for bit."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    return np.asarray(one).tobytes() == np.asarray(other).tobytes()


def test_the_environment_plays_it_again_bit_for_bit(written):
    episodes, data = contents(written)
    env = gym.make("RedundantIK-v0", scenario=SHORT, preview=1)
    assert (data.observation_space, data.action_space) == (env.observation_space, env.action_space)
    for seed, episode in enumerate(episodes):
        seen, _ = env.reset(seed=seed)
        for k, action in enumerate(episode.actions):
            assert equal({key: values[k] for key, values in episode.observations.items()}, seen)
            seen, reward, terminated, truncated, _ = env.step(action)
            assert (reward, terminated, truncated) == (
                episode.rewards[k], episode.terminations[k], episode.truncations[k],
            )  # fmt: skip
        assert truncated
        assert equal({key: values[-1] for key, values in episode.observations.items()}, seen)


def test_costs_are_those_of_an_evaluation(written):
    data = contents(written)[1]
    rows = evaluate(SHORT, GIVEN["policy"], episodes=3, split="train")
    found = list(data.storage.get_episode_metadata(range(3)))
    assert [one["seed"] for one in found] == [row.seed for row in rows] == list(scenarios.SPLITS["train"][:3])
    for name in ("total_cost", "tracking_cost", "velocity_cost"):
        assert [one[name] for one in found] == [getattr(row, name) for row in rows]
    about = data.storage.metadata["ikgym"]
    assert (about["policy"], about["split"], about["fingerprint"]) == ("dls", "train", rows[0].fingerprint)
    assert about["parameters"] == rows[0].parameters
    assert scenarios.load(written / "scenario.toml").steps == SHORT.steps


def test_the_command(tmp_path, monkeypatch, capsys):
    """Minari finds the data set by name and makes its environment."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "sets")
    arguments = ["--scenario", "varga7-random", "--policy", "dls", "--episodes", "1", "--out", "sets/dls-v1"]
    assert main([*arguments, "--split", "validation", "--preview", "3"]) == 0
    assert 'minari.load_dataset("dls-v1")' in capsys.readouterr().out
    data = minari.load_dataset("dls-v1")
    seen, _ = data.recover_environment().reset(seed=scenarios.SPLITS["validation"].start)
    assert equal(seen, {key: values[0] for key, values in data[0].observations.items()})
    assert seen["nominal"].shape == (3, 6)
    assert [file.name for file in (tmp_path / "sets" / "dls-v1").iterdir()] == ["data"]


def test_a_run_that_breaks_off_leaves_the_data_set_of_before(tmp_path, monkeypatch):
    folder = tmp_path / "dls-v0"
    write(**GIVEN | {"episodes": 1}, out=folder)
    with pytest.raises(ResultsError, match="already exists: replace it with --overwrite"):
        write(**GIVEN, out=folder)
    with monkeypatch.context() as broken:
        broken.setattr("baselines.datasets.add_up", lambda costs: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            write(**GIVEN, out=folder, overwrite=True)
    assert len(contents(folder)[0]) == 1
    write(**GIVEN, out=folder, overwrite=True)
    assert len(contents(folder)[0]) == 3
    assert sorted(file.name for file in folder.iterdir()) == ["data", "scenario.toml"]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"--episodes": "2", "--scenario": "varga7-fast"}, "with 2 different and independent episodes"),
        ({"--policy": "all"}, "one policy in one scenario"),
        ({"--out": "dls"}, "expected a name with a version, such as dls-v0; got 'dls'"),
        ({"--out": "loop/dls-v0"}, "Cannot write into loop/dls-v0: Too many levels of symbolic links."),
    ],
)
def test_mistakes_are_reported_before_anything_is_written(changes, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    pathlib.Path("loop").symlink_to("loop")
    given = {"--scenario": "varga7-random", "--policy": "dls", "--episodes": "1", "--out": "dls-v0"} | changes
    assert main([part for pair in given.items() for part in pair]) == 2
    assert message in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["loop"]
