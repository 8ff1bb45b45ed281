"""A run can be killed at any moment, gone on with, and repeated: it ends with the very same weights."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO, SAC, TD3
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import baselines
from baselines.episodes import rollouts
from baselines.files import ResultsError
from baselines.training import checkpoint
from baselines.training import run as run_module
from baselines.training.errors import TrainingError
from baselines.training.folder import Folder, read_run
from baselines.training.run import train
from baselines.training.trainers.models import weights_hash
from baselines.training.validation import validation_seeds
from ikgym.exceptions import InvalidInputError
from tests.baselines.training.killing import run_until_done, run_with_kills
from tests.baselines.training.small import OVER, TINY, about, timeless, tiny

METHODS = ["ppo", "sac", "td3"]
#: Long enough to be killed on the way.
LONGER = {"segments": 12, "evaluate_every": 3}


class StoppedError(Exception):
    """Raised in the middle of a run."""


def stop_after(segments):
    def on_segment(done, score):
        if done == segments:
            raise StoppedError

    return on_segment


@pytest.fixture(scope="module", params=METHODS)
def finished(request, tmp_path_factory):
    """A run of each method, from beginning to end."""
    folder = tmp_path_factory.mktemp(request.param)
    config = tiny(request.param, **OVER)
    return config, folder, train(config, 3, folder)


def assert_same_run(folder, other):
    assert about(other)["weights_sha256"] == about(folder)["weights_sha256"]
    assert about(other)["kept"] == about(folder)["kept"]
    assert timeless(other) == timeless(folder)


def test_a_run_that_was_stopped_ends_like_one_that_was_not(finished, tmp_path):
    config, folder, result = finished
    for segments in (1, 2):
        with pytest.raises(StoppedError):
            train(config, 3, tmp_path, resume=True, on_segment=stop_after(segments))
        assert about(tmp_path)["status"] == "running"
        assert about(tmp_path)["training"]["segments"] == segments
        assert not (tmp_path / "model.zip").exists()
    assert train(config, 3, tmp_path, resume=True).weights_sha256 == result.weights_sha256
    assert_same_run(folder, tmp_path)


def test_a_run_killed_between_its_last_checkpoint_and_the_history_is_complete(finished, tmp_path, monkeypatch):
    config, folder, _ = finished
    write_json = Folder.write_json

    def killed(self, file, content):
        if file.name == "history.json" and content[-1]["segment"] == config.segments:
            raise StoppedError
        write_json(self, file, content)

    with monkeypatch.context() as patched:
        patched.setattr(Folder, "write_json", killed)
        with pytest.raises(StoppedError):
            train(config, 3, tmp_path)
    assert train(config, 3, tmp_path, resume=True)
    assert_same_run(folder, tmp_path)


@pytest.fixture(scope="module")
def gone_on_with(finished, tmp_path_factory):
    """The same run with rare checkpoints, stopped after more than its last one, and gone on with."""
    config, _, _ = finished
    folder = tmp_path_factory.mktemp("gone-on-with")
    with pytest.raises(StoppedError):
        train(config, 3, folder, checkpoint_every=1e9, on_segment=stop_after(2))
    assert about(folder)["training"]["segments"] == 1  # the first one is written at once
    train(config, 3, folder, resume=True, checkpoint_every=1e9)
    return folder


def test_rare_checkpoints_change_nothing(finished, gone_on_with):
    assert_same_run(finished[1], gone_on_with)


def test_seeds_differ(finished, tmp_path):
    config, _, result = finished
    assert train(config, 4, tmp_path).weights_sha256 != result.weights_sha256


def test_finished_runs_are_left_as_they_are(finished):
    config, folder, result = finished
    before = timeless(folder)
    assert train(config, 3, folder, resume=True) == result
    assert timeless(folder) == before


def test_what_run_json_says(finished):
    config, folder, result = finished
    content = about(folder)
    assert content["status"] == "finished"
    assert content["method"] == config.method
    assert type(config).from_json(content["config"]) == config
    assert content["processing"] == config.processing.to_json()
    assert content["scenario"]["name"] == "varga7-random"
    assert content["weights_sha256"] == result.weights_sha256
    assert content["training"]["segments"] == 3
    assert content["training"]["steps"] == 3 * 4 * 20
    assert 0.0 < content["training"]["core_minutes"] < 2.0
    assert 0.0 < content["training"]["wall_minutes"] < 10.0
    assert {"torch", "stable_baselines3", "numpy", "ikgym"} <= content["versions"].keys()
    assert [row["segment"] for row in content["validation"]] == [0, 2, 3]
    scores = [row["cost"] for row in content["validation"]]
    best = int(np.argmin(scores))
    assert content["kept"]["by"] == "validation"
    assert content["kept"]["segment"] == content["validation"][best]["segment"]
    assert content["kept"]["validation"]["cost"] == min(scores) == result.score.cost
    rows = timeless(folder)
    assert [row["segment"] for row in rows] == [0, 1, 2, 3]
    assert all("train/cost" in row for row in rows[1:])


def test_files_hold_the_kept_agent(finished):
    """Played by the evaluation, it costs what the validation said; Stable-Baselines3 loads the same weights."""
    config, folder, result = finished
    scenario = config.make_scenario()
    seeds = validation_seeds(scenario, config.validation_episodes)
    for file, trust in (("agent.safetensors", False), ("model.zip", True)):
        policy = baselines.make("agent", scenario, path=str(folder / file), trust=trust)
        costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in rollouts(scenario, policy, seeds)]
        # Networks in torch and in numba round differently.
        assert np.exp(np.mean(np.log(costs))) == pytest.approx(result.score.cost, rel=1e-3)
    kind = {"ppo": PPO, "sac": SAC, "td3": TD3}[config.method]
    loaded = kind.load(folder / "model.zip", device="cpu")
    assert weights_hash(loaded) == about(folder)["kept"]["weights_sha256"]


@pytest.mark.parametrize(
    ("method", "changes"),
    [
        ("sac", {"use_sde": True}),
        *((method, {"output": "bilinear"}) for method in ("ppo", "sac", "td3")),
        ("ppo", {"output": "bilinear", "scenario": "panda-random", "damping": 4e-4, "log_std_end": -3.0}),
        *(
            (method, {"output": "inverse", "scenario": "panda-random", "damping": 1e-2, "hold": 4})
            for method in ("ppo", "sac", "td3")
        ),
    ],
    ids=str,
)
def test_what_is_exported_plays_as_in_validation(method, changes, tmp_path):
    config = tiny(method, **changes, segments=1, evaluate_every=1)
    cost = train(config, 3, tmp_path).score.cost
    scenario = config.make_scenario()
    policy = baselines.make("agent", scenario, path=str(tmp_path / "agent.safetensors"))
    episodes = rollouts(scenario, policy, validation_seeds(scenario, config.validation_episodes))
    costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
    assert np.exp(np.mean(np.log(costs))) == pytest.approx(cost, rel=1e-3)


def test_tensorboard_holds_each_step_once(finished, gone_on_with):
    """Also where a run was stopped after it had written more than its checkpoint knows of."""
    for each in (finished[1], gone_on_with):
        events = EventAccumulator(str(each / "tensorboard")).Reload()
        assert [event.step for event in events.Scalars("train/cost")] == [80, 160, 240]
        assert [event.step for event in events.Scalars("rollout/ep_rew_mean")] == [80, 160, 240]
        for name in ("cost", "position_error_max_mm", "orientation_error_max_mrad"):
            assert [event.step for event in events.Scalars(f"validation/{name}")] == [0, 160, 240]


def test_the_last_agent_is_kept_on_request(tmp_path):
    config = tiny("ppo", keep_best=False, evaluate_every=2)
    result = train(config, 3, tmp_path)
    content = about(tmp_path)
    assert content["kept"]["by"] == "end"
    assert content["kept"]["weights_sha256"] == content["weights_sha256"] == result.weights_sha256


def test_validation_does_not_disturb_training(tmp_path):
    often, seldom = (
        train(tiny("ppo", evaluate_every=n, validation_episodes=n), 3, tmp_path / str(n)).weights_sha256 for n in (1, 3)
    )
    assert often == seldom


def test_folders_are_not_written_over(finished, tmp_path):
    config, folder, _ = finished
    with pytest.raises(TrainingError, match=r"is there already: go on with it by --resume"):
        train(config, 3, folder)
    with pytest.raises(TrainingError, match="choose one"):
        train(config, 3, folder, resume=True, overwrite=True)
    (tmp_path / "mine.txt").write_text("stays")
    short = config.replace(segments=1)
    train(short, 3, tmp_path)
    first = about(tmp_path)
    train(short, 4, tmp_path, overwrite=True)
    assert about(tmp_path)["seed"] == 4
    assert about(tmp_path)["weights_sha256"] != first["weights_sha256"]
    assert (tmp_path / "mine.txt").exists()
    assert len(list((tmp_path / "tensorboard").iterdir())) == 1


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"learning_rate": 1e-2}, r"another config: learning_rate \(0.0003 there, 0.01 here\)"),
        (
            {"segments": 9, "gamma": 0.5},
            r"another config: segments \(3 there, 9 here\), gamma \(0.98 there, 0.5 here\)",
        ),
    ],
)
def test_another_configuration_is_not_gone_on_with(finished, changes, message):
    config, folder, _ = finished
    with pytest.raises(TrainingError, match=message):
        train(config.replace(**changes), 3, folder, resume=True)
    with pytest.raises(TrainingError, match=r"another seed: \(3 there, 4 here\)"):
        train(config, 4, folder, resume=True)


def test_other_versions_are_not_gone_on_with(finished, monkeypatch):
    config, folder, _ = finished
    monkeypatch.setattr(run_module, "versions", lambda: {**about(folder)["versions"], "torch": "1.0"})
    with pytest.raises(TrainingError, match=r"another versions: torch \('.*' there, '1.0' here\)"):
        train(config, 3, folder, resume=True)


def test_damaged_files(finished, tmp_path):
    config, folder, _ = finished
    for name, content, message in [
        ("checkpoint.pt", b"nothing", "Cannot go on from .*checkpoint.pt"),
        ("run.json", b"{", "run.json is damaged"),
        ("run.json", b"[]", "is no run.json of a training"),
        ("run.json", b'{"format": 2, "method": "ppo", "seed": 3, "config": []}', "run.json is damaged"),
    ]:
        for file in ("run.json", "checkpoint.pt"):
            (tmp_path / file).write_bytes((folder / file).read_bytes())
        (tmp_path / name).write_bytes(content)
        with pytest.raises(TrainingError, match=message):
            train(config, 3, tmp_path, resume=True)
    save_sealed({"format": 99}, tmp_path / "checkpoint.pt")
    (tmp_path / "run.json").write_bytes((folder / "run.json").read_bytes())
    with pytest.raises(TrainingError, match="written by another version"):
        train(config, 3, tmp_path, resume=True)


def save_sealed(content, file):
    """A checkpoint whose digest is right, whatever is in it."""
    stream = io.BytesIO()
    torch.save(content, stream)
    file.write_bytes(checkpoint.sealed(stream.getvalue()))


def test_a_flipped_byte_of_a_checkpoint_is_noticed(finished, tmp_path):
    """PyTorch reads it without a word: another weight is a weight, too."""
    config, folder, _ = finished
    whole = (folder / "checkpoint.pt").read_bytes()
    begin = len(checkpoint.MAGIC) + 65
    for place in np.random.default_rng(0).integers(begin, len(whole), 20):
        damaged = bytearray(whole)
        damaged[place] ^= 64
        (tmp_path / "checkpoint.pt").write_bytes(damaged)
        (tmp_path / "run.json").write_bytes((folder / "run.json").read_bytes())
        with pytest.raises(TrainingError, match=r"Cannot go on from .*it is damaged: expected the SHA-256"):
            train(config, 3, tmp_path, resume=True)


def test_checkpoints_unpack_to_no_more_than_they_have(tmp_path):
    """PyTorch believes the directory of an archive, and asks for the memory that it claims."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"0" * 2**20)
    (tmp_path / "checkpoint.pt").write_bytes(checkpoint.sealed(stream.getvalue()))
    with pytest.raises(TrainingError, match="its members claim more bytes than it has"):
        checkpoint.load(tmp_path / "checkpoint.pt")


def test_runs_of_the_first_version_are_refused(finished, tmp_path):
    """Its options have other names."""
    config, folder, _ = finished
    old = {name: value for name, value in about(folder).items() if name != "format"}
    old["versions"]["ikgym"] = "0.1.0"
    (tmp_path / "run.json").write_text(json.dumps(old))
    wanted = r'written by ikgym 0.1.0, whose options have other names: .* pip install "ikgym==0.1.0", or train anew'
    with pytest.raises(TrainingError, match=wanted):
        train(config, 3, tmp_path, resume=True)
    with pytest.raises(TrainingError, match=wanted):
        read_run(tmp_path / "run.json")
    train(config.replace(segments=1), 3, tmp_path, overwrite=True)
    assert read_run(tmp_path / "run.json")["status"] == "finished"


def test_checkpoints_run_nothing(finished, tmp_path):
    """A pickle that would call something is refused."""

    class Evil:
        def __reduce__(self):
            return print, ("called",)

    config, folder, _ = finished
    (tmp_path / "run.json").write_bytes((folder / "run.json").read_bytes())
    save_sealed({"format": checkpoint.FORMAT, "segments": Evil()}, tmp_path / "checkpoint.pt")
    with pytest.raises(TrainingError, match="Cannot go on from"):
        train(config, 3, tmp_path, resume=True)


def test_a_folder_that_is_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises((TrainingError, ResultsError), match="Cannot write"):
        train(tiny("ppo"), 3, tmp_path / "file" / "run")


def test_weights_that_run_away_are_named(tmp_path):
    with pytest.raises(TrainingError, match="no longer finite in segment"):
        train(tiny("ppo", learning_rate=1e30, learning_rate_end=1e30), 3, tmp_path)


def test_errors_of_the_method_are_passed_on(tmp_path):
    with pytest.raises(InvalidInputError, match="n_steps: expected a divisor"):
        train(tiny("ppo", n_steps=7), 3, tmp_path)


def test_drafts_of_killed_runs_are_removed(tmp_path):
    config = tiny("ppo", segments=1)
    (tmp_path / ".checkpoint.pt.123.tmp").write_text("half")
    train(config, 3, tmp_path)
    assert not list(tmp_path.glob(".*"))
    assert json.loads((tmp_path / "history.json").read_text())


def check_kills(method, kills, tmp_path, rng):
    """Kills runs of a method at random moments until there were enough, and compares where they end."""
    config = tiny(method, **TINY | LONGER)
    duration = run_until_done(config, tmp_path / "undisturbed")
    killed = runs = 0
    while killed < kills:
        killed += run_with_kills(config, tmp_path / f"{runs}", kills - killed, duration, rng)
        assert_same_run(tmp_path / "undisturbed", tmp_path / f"{runs}")
        runs += 1


def test_killed_at_a_random_moment(tmp_path):
    check_kills("td3", 1, tmp_path, np.random.default_rng())


@pytest.mark.slow
@pytest.mark.parametrize("method", ["ppo", "sac", "td3", "imitate", "apg"])
def test_any_method_may_be_killed_at_random_moments(method, tmp_path):
    check_kills(method, 2, tmp_path, np.random.default_rng())
