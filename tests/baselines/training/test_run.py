"""Runs of apg: a segment depends on state and number alone, runs are resumed, replaced and refused."""

import io
import multiprocessing
import signal
import time

import numpy as np
import pytest
import torch
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import baselines
from baselines.episodes import rollouts
from baselines.files import ResultsError
from baselines.training import run as run_module
from baselines.training.config import TrainingError
from baselines.training.folder import FORMAT, sealed
from baselines.training.randomness import deterministic_torch
from baselines.training.run import train, weights_hash
from baselines.training.validation import validation_seeds
from tests.baselines.training.small import about, play_segments, timeless, tiny, trainer_of

CONFIG = tiny()
#: Processes begin at once: their server has loaded all that a run needs.
FORK = multiprocessing.get_context("forkserver")
FORK.set_forkserver_preload(["baselines.training.run"])

CASES = {
    "plain": CONFIG,
    "end within a segment": tiny(steps=20),
    "held for longer than it sees": tiny(offsets=(1, 2)),
}


@pytest.mark.parametrize("config", CASES.values(), ids=CASES)
def test_a_segment_depends_on_state_and_number(config, tmp_path):
    with deterministic_torch():
        undisturbed = trainer_of(config)
        before = weights_hash(undisturbed.policy)
        play_segments(undisturbed, [0])
        torch.save(undisturbed.state(), tmp_path / "state.pt")
        wanted = play_segments(undisturbed, [1, 2])
        other = trainer_of(config)
        other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
        assert play_segments(other, [1, 2]) == wanted
    assert weights_hash(other.policy) == weights_hash(undisturbed.policy) != before
    assert other.steps == undisturbed.steps > 0


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """The folder of a run from beginning to end, and its result."""
    folder = tmp_path_factory.mktemp("apg")
    return folder, train(CONFIG, 3, folder)


def assert_same_run(folder, other):
    assert about(other)["weights_sha256"] == about(folder)["weights_sha256"]
    assert about(other)["kept"] == about(folder)["kept"]
    assert timeless(other) == timeless(folder)


def test_a_run_that_was_stopped_ends_like_one_that_was_not(finished, tmp_path):
    """Also if it was stopped some segments after its last checkpoint; TensorBoard has each step once."""
    folder, result = finished

    def stop(done, score):
        if done == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(CONFIG, 3, tmp_path, checkpoint_every=1e9, on_segment=stop)
    assert about(tmp_path)["training"]["segments"] == 1  # the first one is written at once
    assert not (tmp_path / "agent.safetensors").exists()
    time.sleep(1.0 - time.time() % 1.0)  # TensorBoard orders files by the second of their beginning
    assert train(CONFIG, 3, tmp_path, resume=True)["kept"] == result["kept"]
    assert_same_run(folder, tmp_path)
    for each in (folder, tmp_path):
        events = EventAccumulator(str(each / "tensorboard")).Reload()
        steps = [row["steps"] for row in timeless(folder) if "validation" in row]
        assert [event.step for event in events.Scalars("validation/cost")] == steps


def test_run_json(finished):
    folder, result = finished
    content = about(folder)
    assert (content["status"], content["method"]) == ("finished", CONFIG.method)
    assert type(CONFIG).from_json(content["config"]) == CONFIG
    assert content == result
    assert content["training"]["segments"] == 3
    assert content["training"]["steps"] == timeless(folder)[-1]["steps"] > 0
    assert {"torch", "stable_baselines3", "numpy", "ikgym"} <= content["versions"].keys()
    assert [row["segment"] for row in content["validation"]] == [0, 2, 3]
    costs = [row["cost"] for row in content["validation"]]
    assert content["kept"]["segment"] == content["validation"][int(np.argmin(costs))]["segment"]
    assert content["kept"]["validation"]["cost"] == min(costs)


def test_the_agent_plays_as_in_validation(finished):
    folder, result = finished
    scenario = CONFIG.make_scenario()
    policy = baselines.make("agent", scenario, path=str(folder / "agent.safetensors"))
    episodes = rollouts(scenario, policy, validation_seeds(scenario, CONFIG.validation_episodes))
    costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
    assert np.exp(np.mean(np.log(costs))) == pytest.approx(result["kept"]["validation"]["cost"], rel=1e-12)


@pytest.mark.parametrize("kills", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_killed_at_random_moments(tmp_path, kills):
    """While it is trained: from the time on at which its folder is there."""
    config, rng = tiny(segments=8, evaluate_every=4), np.random.default_rng()
    begin = time.monotonic()
    train(config, 3, tmp_path / "undisturbed")
    longest, folder, killed = time.monotonic() - begin, tmp_path / "killed", 0
    while killed < kills:
        process = FORK.Process(target=train, args=(config, 3, folder), kwargs={"resume": True}, daemon=True)
        process.start()
        while process.is_alive() and not (folder / "run.json").exists():
            time.sleep(0.01)
        process.join(longest * rng.random())
        process.kill()
        process.join()
        assert process.exitcode in (0, -signal.SIGKILL)
        killed += process.exitcode != 0
        if process.exitcode == 0:  # it was quicker
            assert_same_run(tmp_path / "undisturbed", folder)
            folder, longest = tmp_path / f"{longest}", 0.5 * longest
    train(config, 3, folder, resume=True)
    assert_same_run(tmp_path / "undisturbed", folder)


def copied(folder, path):
    for file in ("run.json", "checkpoint.pt"):
        (path / file).write_bytes((folder / file).read_bytes())


def test_finished_runs_are_left_as_they_are(finished):
    folder, result = finished
    before = timeless(folder)
    assert train(CONFIG, 3, folder, resume=True)["weights_sha256"] == result["weights_sha256"]
    assert timeless(folder) == before
    assert {file.name for file in folder.iterdir() if file.is_file()} - {".lock"} == {
        "run.json",
        "history.json",
        "checkpoint.pt",
        "agent.safetensors",
    }


def test_a_run_killed_between_its_last_checkpoint_and_the_history_is_complete(finished, tmp_path, monkeypatch):
    write_json = run_module.write_json

    def killed(file, content):
        if file.name == "history.json" and content[-1]["segment"] == CONFIG.segments:
            raise KeyboardInterrupt
        write_json(file, content)

    with monkeypatch.context() as patched:
        patched.setattr(run_module, "write_json", killed)
        with pytest.raises(KeyboardInterrupt):
            train(CONFIG, 3, tmp_path)
    assert train(CONFIG, 3, tmp_path, resume=True)["weights_sha256"] == finished[1]["weights_sha256"]
    assert timeless(tmp_path) == timeless(finished[0])


def test_seeds_differ_and_validation_changes_nothing(finished, tmp_path):
    assert train(CONFIG, 4, tmp_path / "4")["weights_sha256"] != finished[1]["weights_sha256"]
    seldom = CONFIG.replace(evaluate_every=3, validation_episodes=1)
    assert train(seldom, 3, tmp_path / "3")["weights_sha256"] == finished[1]["weights_sha256"]


def test_folders_are_not_overwritten(finished, tmp_path):
    folder, _ = finished
    with pytest.raises(ResultsError, match="already exists: continue with --resume"):
        train(CONFIG, 3, folder)
    with pytest.raises(ResultsError, match="choose one"):
        train(CONFIG, 3, folder, resume=True, overwrite=True)
    (tmp_path / "mine.txt").write_text("stays")
    (tmp_path / ".checkpoint.pt.123.tmp").write_text("of a run that was killed")
    short = CONFIG.replace(segments=1)
    train(short, 3, tmp_path)
    first = about(tmp_path)
    train(short, 4, tmp_path, overwrite=True)
    assert about(tmp_path)["seed"] == 4
    assert about(tmp_path)["weights_sha256"] != first["weights_sha256"]
    assert (tmp_path / "mine.txt").exists()
    assert not list(tmp_path.glob(".*"))
    assert len(list((tmp_path / "tensorboard").iterdir())) == 1


def test_another_run_is_not_resumed(finished, monkeypatch):
    with pytest.raises(ResultsError, match="differs in config"):
        train(CONFIG.replace(learning_rate=1e-2), 3, finished[0], resume=True)
    with pytest.raises(ResultsError, match=r"differs in seed \(3 there, 4 here\)"):
        train(CONFIG, 4, finished[0], resume=True)
    monkeypatch.setattr(run_module, "versions", lambda: {**about(finished[0])["versions"], "torch": "1.0"})
    with pytest.raises(ResultsError, match="differs in versions"):
        train(CONFIG, 3, finished[0], resume=True)


def saved(content):
    """A checkpoint with any content."""
    stream = io.BytesIO()
    torch.save(content, stream)
    return sealed(stream.getvalue())


class Evil:
    """A pickle that would call something."""

    def __reduce__(self):
        return print, ("called",)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("checkpoint.pt", b"nothing", "checkpoint.pt is damaged.* it is no checkpoint"),
        ("checkpoint.pt", saved({"format": 99}), "it has another format"),
        ("checkpoint.pt", saved({"format": FORMAT, "segments": Evil()}), "checkpoint.pt is damaged"),
        ("checkpoint.pt", saved({"format": FORMAT})[:-1] + b"?", "expected the SHA-256"),  # one byte is another
        ("run.json", b"{", "run.json is damaged"),
        ("run.json", b'{"format": 2}', f"differs in format \\(2 there, {FORMAT} here\\)"),
    ],
)
def test_damaged_files(finished, tmp_path, name, content, message):
    copied(finished[0], tmp_path)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ResultsError, match=message):
        train(CONFIG, 3, tmp_path, resume=True)


def test_weights_that_diverge(tmp_path):
    with pytest.raises(TrainingError, match="The weights diverged in segment"):
        train(CONFIG.replace(learning_rate=1e12, learning_rate_end=1e12), 3, tmp_path)
