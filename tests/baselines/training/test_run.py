"""The folder of a run: what is resumed, replaced and refused."""

import io

import numpy as np
import pytest
import torch

from baselines.files import ResultsError
from baselines.training import folder as folder_module
from baselines.training import run as run_module
from baselines.training.config import TrainingError
from baselines.training.folder import FORMAT, MAGIC
from baselines.training.run import train
from tests.baselines.training.small import about, timeless, tiny

CONFIG = tiny()


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    folder = tmp_path_factory.mktemp("apg")
    return folder, train(CONFIG, 3, folder)


def copied(folder, path):
    for file in ("run.json", "checkpoint.pt"):
        (path / file).write_bytes((folder / file).read_bytes())


def test_finished_runs_are_left_as_they_are(finished):
    folder, result = finished
    before = timeless(folder)
    assert train(CONFIG, 3, folder, resume=True) == result
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
    assert train(CONFIG, 3, tmp_path, resume=True).weights_sha256 == finished[1].weights_sha256
    assert timeless(tmp_path) == timeless(finished[0])


def test_seeds_differ_and_validation_changes_nothing(finished, tmp_path):
    assert train(CONFIG, 4, tmp_path / "4").weights_sha256 != finished[1].weights_sha256
    seldom = CONFIG.replace(evaluate_every=3, validation_episodes=1, keep_best=False)
    assert train(seldom, 3, tmp_path / "3").weights_sha256 == finished[1].weights_sha256
    kept = about(tmp_path / "3")["kept"]
    assert (kept["by"], kept["weights_sha256"]) == ("end", finished[1].weights_sha256)


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


def sealed(content):
    """A checkpoint with the right digest and any content."""
    stream = io.BytesIO()
    torch.save(content, stream)
    return folder_module.sealed(stream.getvalue())


class Evil:
    """A pickle that would call something."""

    def __reduce__(self):
        return print, ("called",)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("checkpoint.pt", b"nothing", "checkpoint.pt is damaged.* it is no checkpoint"),
        ("checkpoint.pt", sealed({"format": 99}), "it has another format"),
        ("checkpoint.pt", sealed({"format": FORMAT, "segments": Evil()}), "checkpoint.pt is damaged"),
        ("run.json", b"{", "run.json is damaged"),
        ("run.json", b'{"format": 2}', f"differs in format \\(2 there, {FORMAT} here\\)"),
    ],
)
def test_damaged_files(finished, tmp_path, name, content, message):
    copied(finished[0], tmp_path)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ResultsError, match=message):
        train(CONFIG, 3, tmp_path, resume=True)


def test_a_flipped_byte_of_a_checkpoint_is_noticed(finished, tmp_path):
    """PyTorch would read it without an error."""
    damaged = bytearray((finished[0] / "checkpoint.pt").read_bytes())
    damaged[np.random.default_rng().integers(len(MAGIC) + 65, len(damaged))] ^= 64
    copied(finished[0], tmp_path)
    (tmp_path / "checkpoint.pt").write_bytes(damaged)
    with pytest.raises(ResultsError, match="it is damaged: expected the SHA-256"):
        train(CONFIG, 3, tmp_path, resume=True)


def test_weights_that_diverge(tmp_path):
    with pytest.raises(TrainingError, match="The weights diverged in segment"):
        train(CONFIG.replace(learning_rate=1e12, learning_rate_end=1e12), 3, tmp_path)
