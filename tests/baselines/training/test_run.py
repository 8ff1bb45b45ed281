"""Runs of apg: a segment depends on state and number alone, runs are resumed, replaced and refused."""

import errno
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
from baselines.training.options import TrainingError
from baselines.training.run import FORMAT, save_checkpoint, train, weights_hash
from ikgym import files, scenarios
from tests.baselines.training.small import about, timeless, tiny, trainer_of

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
    undisturbed = trainer_of(config)
    before = weights_hash(undisturbed.policy)
    undisturbed.segment(0)
    torch.save(undisturbed.state(), tmp_path / "state.pt")
    expected = [undisturbed.segment(number) for number in (1, 2)]
    other = trainer_of(config)
    other.restore(torch.load(tmp_path / "state.pt", weights_only=True))
    assert [other.segment(number) for number in (1, 2)] == expected
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
        train(CONFIG, 3, tmp_path, on_segment=stop)
    assert about(tmp_path)["training"]["segments"] == 1  # the first one is written at once
    assert not (tmp_path / "agent.safetensors").exists()
    assert train(CONFIG, 3, tmp_path)["kept"] == result["kept"]
    assert_same_run(folder, tmp_path)
    for each in (folder, tmp_path):
        events = EventAccumulator(str(each)).Reload()
        costs = {row["steps"]: row["validation/cost"] for row in timeless(folder) if "validation/cost" in row}
        assert {event.step: event.value for event in events.Scalars("validation/cost")} == pytest.approx(costs)
        assert len(events.Scalars("train/loss")) == CONFIG.segments


def test_run_json(finished):
    folder, result = finished
    content = about(folder)
    assert (content["status"], content["method"]) == ("finished", "apg")
    assert type(CONFIG).from_json(content["config"]) == CONFIG
    assert content == result
    assert content["training"]["segments"] == 3
    assert content["training"]["steps"] == timeless(folder)[-1]["steps"] > 0
    assert {"torch", "stable_baselines3", "numpy", "ikgym"} <= content["versions"].keys()
    rows = [row for row in content["history"] if "validation/cost" in row]
    assert [row["segment"] for row in rows] == [0, 2, 3]
    best = min(rows, key=lambda row: row["validation/cost"])
    assert (content["kept"]["segment"], content["kept"]["cost"]) == (best["segment"], best["validation/cost"])


def test_the_agent_plays_as_in_validation(finished):
    folder, result = finished
    scenario = CONFIG.make_scenario()
    policy = baselines.make("agent", scenario, path=str(folder / "agent.safetensors"))
    episodes = rollouts(scenario, policy, scenarios.seeds("validation", CONFIG.validation_episodes))
    costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
    assert np.exp(np.mean(np.log(costs))) == pytest.approx(result["kept"]["cost"], rel=1e-12)


@pytest.mark.parametrize("kills", [1, pytest.param(4, marks=pytest.mark.slow)])
def test_killed_at_random_moments(tmp_path, kills):
    """While it is trained: from the time on at which its folder is there."""
    config, rng = tiny(segments=8, evaluate_every=4), np.random.default_rng()
    begin = time.monotonic()
    train(config, 3, tmp_path / "undisturbed")
    longest, folder, killed = time.monotonic() - begin, tmp_path / "killed", 0
    while killed < kills:
        process = FORK.Process(target=train, args=(config, 3, folder), daemon=True)
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
    train(config, 3, folder)
    assert_same_run(tmp_path / "undisturbed", folder)


def copied(folder, path):
    for file in ("run.json", "checkpoint.pt"):
        (path / file).write_bytes((folder / file).read_bytes())


def test_finished_runs_are_left_as_they_are(finished):
    folder, result = finished
    before = timeless(folder)
    assert train(CONFIG, 3, folder)["weights_sha256"] == result["weights_sha256"]
    assert timeless(folder) == before
    assert {file.name for file in folder.iterdir() if file.is_file()} - {".lock"} == {
        "run.json",
        "checkpoint.pt",
        "events.out.tfevents.apg",
        "agent.safetensors",
    }


def test_a_run_killed_between_its_last_checkpoint_and_its_description_is_complete(finished, tmp_path, monkeypatch):
    write_json = run_module.write_json

    def killed(file, content):
        if len(content["history"]) > CONFIG.segments:
            raise KeyboardInterrupt
        write_json(file, content)

    with monkeypatch.context() as patched:
        patched.setattr(run_module, "write_json", killed)
        with pytest.raises(KeyboardInterrupt):
            train(CONFIG, 3, tmp_path)
    assert train(CONFIG, 3, tmp_path)["weights_sha256"] == finished[1]["weights_sha256"]
    assert timeless(tmp_path) == timeless(finished[0])


@pytest.mark.parametrize("part", ["checkpoint.pt", "run.json", "events.out.tfevents.apg", "agent.safetensors"])
def test_a_full_disk_ends_a_run_with_a_message_and_it_is_resumed(part, finished, tmp_path, monkeypatch):
    """From the second segment on."""
    write, segments = files.write, []

    def write_if_there_is_space(file, content):
        if segments and file.name == part:
            raise OSError(errno.ENOSPC, "No space left on device")
        write(file, content)

    with monkeypatch.context() as patched:
        patched.setattr(files, "write", write_if_there_is_space)
        with pytest.raises(ResultsError, match=f"^Cannot write .*{part}: No space left on device\\.$"):
            train(CONFIG, 3, tmp_path, on_segment=lambda done, cost: segments.append(done))
    train(CONFIG, 3, tmp_path)
    assert_same_run(finished[0], tmp_path)


def test_links_are_replaced_and_not_followed(tmp_path):
    (tmp_path / "elsewhere").mkdir()
    theirs = tmp_path / "elsewhere" / "events.out.tfevents.1"
    theirs.write_text("of somebody else")
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "tensorboard").symlink_to(tmp_path / "elsewhere")
    for file in ("checkpoint.pt", "events.out.tfevents.apg", "agent.safetensors"):
        (tmp_path / "run" / file).symlink_to(theirs)
    train(CONFIG.replace(segments=1), 3, tmp_path / "run")
    assert [file.read_text() for file in (tmp_path / "elsewhere").iterdir()] == ["of somebody else"]


def test_seeds_differ_and_validation_changes_nothing(finished, tmp_path):
    assert train(CONFIG, 4, tmp_path / "4")["weights_sha256"] != finished[1]["weights_sha256"]
    seldom = CONFIG.replace(evaluate_every=3, validation_episodes=1)
    assert train(seldom, 3, tmp_path / "3")["weights_sha256"] == finished[1]["weights_sha256"]


def test_other_files_of_a_folder_stay(tmp_path):
    (tmp_path / "mine.txt").write_text("stays")
    (tmp_path / ".checkpoint.pt.123.tmp").write_text("of a run that was killed")
    train(CONFIG.replace(segments=1), 3, tmp_path)
    assert (tmp_path / "mine.txt").exists()
    assert not list(tmp_path.glob(".*"))


def test_another_run_is_not_resumed(finished, monkeypatch):
    with pytest.raises(ResultsError, match="differs in config"):
        train(CONFIG.replace(learning_rate=1e-2), 3, finished[0])
    with pytest.raises(ResultsError, match=r"differs in seed \(3 there, 4 here\)"):
        train(CONFIG, 4, finished[0])
    monkeypatch.setattr(run_module, "versions", lambda: {**about(finished[0])["versions"], "torch": "1.0"})
    with pytest.raises(ResultsError, match="differs in versions"):
        train(CONFIG, 3, finished[0])


class Evil:
    """A pickle that would call something."""

    def __reduce__(self):
        return print, ("called",)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("checkpoint.pt", b"nothing", "checkpoint.pt is damaged.* its SHA-256 is another"),
        ("checkpoint.pt", {"format": 99}, "it has another format"),
        ("checkpoint.pt", {"segments": Evil()}, "checkpoint.pt is damaged"),
        ("run.json", b"{", "run.json is damaged"),
        ("run.json", b'{"format": 2}', f"differs in format \\(2 there, {FORMAT} here\\)"),
    ],
)
def test_damaged_files(finished, tmp_path, name, content, message):
    copied(finished[0], tmp_path)
    if isinstance(content, bytes):
        (tmp_path / name).write_bytes(content)
    else:
        save_checkpoint(tmp_path / name, content)
    with pytest.raises(ResultsError, match=message):
        train(CONFIG, 3, tmp_path)


def test_a_checkpoint_with_one_other_byte_is_damaged(finished, tmp_path):
    copied(finished[0], tmp_path)
    content = bytearray((tmp_path / "checkpoint.pt").read_bytes())
    content[len(content) // 2] ^= 1
    (tmp_path / "checkpoint.pt").write_bytes(content)
    with pytest.raises(ResultsError, match="its SHA-256 is another"):
        train(CONFIG, 3, tmp_path)


def test_weights_that_diverge(tmp_path):
    with pytest.raises(TrainingError, match="The weights diverged in segment"):
        train(CONFIG.replace(learning_rate=1e12, learning_rate_end=1e12), 3, tmp_path)
