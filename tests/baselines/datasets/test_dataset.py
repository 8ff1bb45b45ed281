"""Data sets of Minari: the environment plays them again, and a process that is killed costs what was not written."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import gymnasium as gym
import minari
import numpy as np
import pytest

import ikgym
from baselines.datasets import dataset, record
from baselines.datasets.command import main
from baselines.datasets.dataset import planned, write
from baselines.evaluate import evaluate
from baselines.files import ResultsError
from ikgym import scenarios

ROOT = Path(__file__).parents[3]
EPISODES = 3


@pytest.fixture(scope="module")
def short():
    return scenarios.get("varga7-random").replace(name="short", steps=40)


@pytest.fixture(scope="module")
def written(short, tmp_path_factory):
    folder = tmp_path_factory.mktemp("sets") / "dls-v0"
    write(planned(short, "dls:damping=1e-2", episodes=EPISODES), folder)
    return folder


def contents(folder):
    data = minari.MinariDataset(folder / "data")
    return [data[number] for number in range(data.total_episodes)], data


def equal(one, other):
    """Whether two trees of arrays are the same, bit for bit."""
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(equal(one[key], other[key]) for key in one)
    return np.asarray(one).tobytes() == np.asarray(other).tobytes()


def same(folder, other):
    """Whether two data sets have the same episodes, bit for bit."""
    parts = ("observations", "actions", "rewards", "terminations", "truncations", "infos")
    pairs = zip(contents(folder)[0], contents(other)[0], strict=True)
    return all(equal(getattr(a, part), getattr(b, part)) for a, b in pairs for part in parts)


def test_the_environment_plays_it_again_bit_for_bit(written, short):
    episodes, data = contents(written)
    env = gym.make("RedundantIK-v0", scenario=short, preview=1)
    assert data.observation_space == env.observation_space
    assert data.action_space == env.action_space
    for seed, episode in enumerate(episodes):
        seen, _ = env.reset(seed=seed)
        for k, action in enumerate(episode.actions):
            assert equal({key: values[k] for key, values in episode.observations.items()}, seen)
            seen, reward, terminated, truncated, info = env.step(action)
            assert equal({key: values[k] for key, values in episode.infos.items()}, info)
            assert (reward, terminated, truncated) == (
                episode.rewards[k], episode.terminations[k], episode.truncations[k],
            )  # fmt: skip
        assert truncated
        assert equal({key: values[-1] for key, values in episode.observations.items()}, seen)


def test_costs_are_those_of_an_evaluation_and_say_where_they_come_from(written, short):
    _, data = contents(written)
    rows = evaluate(short, "dls:damping=1e-2", episodes=EPISODES, split="train")
    found = list(data.storage.get_episode_metadata(range(EPISODES)))
    assert [one["seed"] for one in found] == [row.seed for row in rows] == list(scenarios.SPLITS["train"][:EPISODES])
    for name in ("total_cost", "tracking_cost", "velocity_cost"):
        assert [one[name] for one in found] == [getattr(row, name) for row in rows]
    about = data.storage.metadata["ikgym"]
    assert about["parameters"] == rows[0].parameters
    assert (about["policy"], about["split"], about["fingerprint"]) == ("dls", "train", rows[0].fingerprint)
    assert about["versions"]["ikgym"] == ikgym.__version__
    assert "damping=0.01" in data.storage.metadata["algorithm_name"]
    assert scenarios.load(written / "scenario.toml").steps == short.steps


def test_it_is_found_by_name_and_has_its_environment(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "sets")
    arguments = ["--scenario", "varga7-random", "--policy", "dls", "--episodes", "1", "--out", "sets/dls-v1"]
    assert main([*arguments, "--split", "validation", "--preview", "3"]) == 0
    assert 'minari.load_dataset("dls-v1")' in capsys.readouterr().out
    data = minari.load_dataset("dls-v1")
    seen, _ = data.recover_environment().reset(seed=scenarios.SPLITS["validation"].start)
    assert equal(seen, {key: values[0] for key, values in data[0].observations.items()})
    assert seen["nominal"].shape == (3, 6)


class Interrupted(Exception):  # noqa: N818  # stands for the end of a process
    """The process ends here."""


@pytest.fixture
def one_a_block(monkeypatch):
    monkeypatch.setattr(record, "MOST_EPISODES", 1)


@pytest.mark.parametrize("done", [0, 2, EPISODES])
def test_what_was_interrupted_is_resumed(short, written, tmp_path, monkeypatch, one_a_block, done):
    """While it plays, and, after the last episode, while it is put together."""
    wanted, folder, played = planned(short, "dls:damping=1e-2", episodes=EPISODES), tmp_path / "dls-v0", []

    def play(jobs, tick=None):
        played.extend(job.seed for job in jobs)
        return record.record(jobs, tick)

    def stop(*_):
        if len(played) == done:
            raise Interrupted
        return play(*_)

    with monkeypatch.context() as patched:
        patched.setattr(dataset, "record", stop)
        patched.setattr(dataset.MinariStorage, "update_metadata", stop)
        with pytest.raises(Interrupted):
            write(wanted, folder)
    assert played == list(range(done))
    assert not (folder / "data").exists()
    monkeypatch.setattr(dataset, "record", play)
    for _ in range(2):  # the second time there is nothing left to do
        write(wanted, folder, resume=True)
        assert played == list(range(EPISODES))
        assert sorted(file.name for file in folder.iterdir()) == ["data", "dataset.json", "scenario.toml"]
    assert same(folder, written)


def test_what_a_killed_process_leaves_hinders_nobody(short, written, tmp_path, monkeypatch):
    """Files that were not written to their end, and a data set that was about to be replaced."""
    folder, wanted = tmp_path / "dls-v0", planned(short, "dls:damping=1e-2", episodes=EPISODES)
    (folder / ".data.tmp").mkdir(parents=True)
    for name in (".dataset.json.7.tmp", ".scenario.toml.7.tmp", ".data.tmp/main_data.hdf5"):
        (folder / name).write_text("hal")
    write(wanted, folder)
    assert same(folder, written)

    def stop(path):
        raise Interrupted

    with monkeypatch.context() as patched:
        patched.setattr("shutil.rmtree", stop)
        with pytest.raises(Interrupted):
            write(wanted, folder, overwrite=True)
    assert not (folder / "data").exists()
    write(wanted, folder, resume=True)
    assert same(folder, written)
    assert sorted(file.name for file in folder.iterdir()) == ["data", "dataset.json", "scenario.toml"]


@pytest.mark.slow
def test_a_process_that_is_killed_is_resumed(tmp_path):
    """The same data set as that of a process that nobody killed."""
    wanted, killed, whole = planned("varga7-random", "dls", episodes=24), tmp_path / "killed-v0", tmp_path / "whole-v0"
    code = (
        "import sys; from baselines.datasets import record; record.MOST_EPISODES = 1\n"
        "from baselines.datasets.command import main; sys.exit(main())"
    )
    arguments = ["--scenario", "varga7-random", "--policy", "dls", "--episodes", "24", "--out", str(killed), "--resume"]
    process = subprocess.Popen([sys.executable, "-c", code, *arguments], cwd=ROOT, stderr=subprocess.DEVNULL)
    while process.poll() is None and len(list(killed.glob("blocks/*.npz"))) < 5:
        time.sleep(0.001)
    process.kill()
    assert process.wait() < 0
    assert not (killed / "data").exists()
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(record, "MOST_EPISODES", 1)
        write(wanted, killed, resume=True)
    write(wanted, whole)
    assert same(killed, whole)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"policy": "dls:damping=1e-3"}, "parameters"),
        ({"policy": "moore_penrose"}, "'dls' there, 'moore_penrose' here"),
        ({"scenario": "varga7-random"}, "'short' there, 'varga7-random' here"),
        ({"episodes": 4}, "episodes (3 there, 4 here)"),
        ({"split": "validation"}, "split"),
    ],
)
def test_another_data_set_in_the_folder(written, short, changes, message):
    given = {"scenario": short, "policy": "dls:damping=1e-2", "episodes": EPISODES} | changes
    with pytest.raises(ResultsError) as refused:
        write(planned(**given), written, resume=True)
    assert "has another data set" in str(refused.value)
    assert message in str(refused.value)


def test_what_is_in_the_folder_stays(written, short, tmp_path):
    wanted = planned(short, "dls:damping=1e-2", episodes=EPISODES)
    with pytest.raises(ResultsError, match=r"has a data set already: go on with it by --resume"):
        write(wanted, written)
    with pytest.raises(ResultsError, match="choose one"):
        write(wanted, written, resume=True, overwrite=True)
    folder = tmp_path / "mine-v0"
    folder.mkdir()
    (folder / "thesis.txt").write_text("mine")
    for flag in ({}, {"resume": True}, {"overwrite": True}):
        with pytest.raises(ResultsError, match=r"expected an empty folder, or that of a data set, got thesis\.txt"):
            write(wanted, folder, **flag)
    assert (folder / "thesis.txt").read_text() == "mine"
    (folder / "thesis.txt").rename(folder / "dataset.json")
    with pytest.raises(ResultsError, match="is damaged"):
        write(wanted, folder, resume=True)
    write(wanted, folder, overwrite=True)
    assert same(folder, written)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"--scenario": "varga7-randm"}, "There is no scenario 'varga7-randm'. Did you mean 'varga7-random"),
        ({"--policy": "dlss"}, "There is no policy 'dlss'. Did you mean 'dls'?"),
        ({"--policy": "all"}, "one policy in one scenario"),
        ({"--policy": "full_orientation", "--scenario": "varga7-pose-random"}, "full_orientation"),
        ({"--episodes": "0"}, "episodes: expected a whole number of at least 1, got 0."),
        ({"--scenario": "varga7-fast"}, "varga7-fast is the same at every reset: expected one episode, got episodes=2"),
        ({"--scenario": "panda-same-arm"}, "sequences of episodes"),
        ({"--split": "tset"}, "Did you mean 'test'?"),
        ({"--out": "dls"}, "with a version behind, such as dls-v0; got 'dls'"),
        ({"--out": "a.b-v0"}, "got 'a.b-v0'"),
    ],
)
def test_mistakes_are_one_line_before_anything_is_played(changes, message, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    given = {"--scenario": "varga7-random", "--policy": "dls", "--episodes": "2", "--out": "dls-v0"} | changes
    assert main([part for pair in given.items() for part in pair]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_without_its_extra_it_says_so(tmp_path):
    code = (
        "import sys; sys.modules['h5py'] = None\n"
        "from baselines.console import main\n"
        "sys.exit(main(['dataset', *'--scenario varga7-random --policy dls --episodes 1 --out x-v0'.split()]))"
    )
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert ended.returncode == 2
    assert 'This needs h5py: pip install "ikgym[data]"' in ended.stderr


class Lazy:
    """A policy of somebody else, for one arm at a time, in float64 and beyond its box."""

    preview = 1

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        count = 0 if state is None else state
        return np.full(7, 2.0 if count == 3 else 0.01 * np.sin(count)), count + 1


def test_policies_of_others_and_references_are_recorded(short, tmp_path):
    write(planned(short, Lazy(), episodes=2), tmp_path / "lazy-v0")
    episodes, _ = contents(tmp_path / "lazy-v0")
    assert [episode.infos["clipped"].tolist() for episode in episodes] == [[k == 3 for k in range(40)]] * 2
    assert (episodes[1].actions[3] == 1.0).all()
    write(planned(short, "follow_nominal", episodes=2), tmp_path / "told-v0")
    found, _ = contents(tmp_path / "told-v0")
    assert max(episode.infos["position_error"].max() for episode in found) < 1e-4


def test_blocks_are_bounded(short):
    jobs = planned(scenarios.get("varga7-random"), "dls", episodes=200).jobs
    sizes = [len(block) for block in record.blocks(jobs)]
    assert sum(sizes) == 200
    assert max(sizes) == record.MOST_EPISODES
    long = planned(short.replace(steps=10**6), "dls", episodes=3).jobs
    assert [len(block) for block in record.blocks(long)] == [1, 1, 1]


def test_provenance_is_plain_json(written):
    assert json.loads((written / "dataset.json").read_text())["episodes"] == EPISODES
