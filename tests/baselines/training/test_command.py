"""The command line: presets, exit codes, several seeds, repetition."""

from __future__ import annotations

import base64
import contextlib
import importlib.util
import json
import pathlib
import pickle
import subprocess
import sys
import zipfile

import pytest

from baselines.training import command, methods, run, seeds
from baselines.training.command import main, parse
from baselines.training.config.ppo import PPO
from baselines.training.errors import TrainingError
from baselines.training.folder import FORMAT
from baselines.training.seeds import SeedRuns
from tests.baselines.losing import LosingCluster
from tests.baselines.training.small import about, timeless
from tests.spawning import dies_with_seed_7

ROOT = pathlib.Path(__file__).parents[3]
TINY = [
    "--scenario", "faitli3-regular", "--steps", "20", "--hidden", "8", "--offsets", "1", "2", "10",
    "--segments", "2", "--n-envs", "4", "--batch-size", "20", "--validation-episodes", "1", "--no-progress",
]  # fmt: skip


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """Two seeds in two processes; that seeds wait their turn is seen where one dies."""
    folder = tmp_path_factory.mktemp("several")
    code = main(["ppo", *TINY, "--seeds", "1", "5", "--workers", "2", "--out", str(folder)])
    return folder, code


def test_several_seeds(several, tmp_path, capsys):
    """Each in its folder, and the same as if it were alone."""
    folder, code = several
    assert code == 0
    assert sorted(path.name for path in folder.iterdir()) == ["seed-1", "seed-5"]
    assert len({about(folder / f"seed-{seed}")["weights_sha256"] for seed in (1, 5)}) == 2
    assert main(["ppo", *TINY, "--seeds", "5", "--out", str(tmp_path)]) == 0
    assert about(tmp_path / "seed-5")["weights_sha256"] == about(folder / "seed-5")["weights_sha256"]
    assert timeless(tmp_path / "seed-5") == timeless(folder / "seed-5")
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split() == ["seed", "cost", "ratio", "cost", "worst", "lost"]
    assert printed[1].split()[:2] == ["5", "–"]


def test_a_seed_that_dies_takes_no_other_with_it(several, tmp_path, monkeypatch, capfd):
    """Nor do those that wait for its process to end."""
    monkeypatch.setattr(seeds, "attempt", dies_with_seed_7)
    assert main(["ppo", *TINY, "--seeds", "7", "1", "--workers", "1", "--out", str(tmp_path)]) == 2
    assert about(tmp_path / "seed-1")["weights_sha256"] == about(several[0] / "seed-1")["weights_sha256"]
    printed = capfd.readouterr()
    assert "   7  failed" in printed.out
    assert "error: seed 7: its process has died (signal SIGKILL); go on with --resume" in printed.err


@pytest.mark.slow
def test_seeds_that_fail_or_die_side_by_side_take_no_other_with_them(tmp_path, monkeypatch, capfd):
    for seed in (0, 1):
        (tmp_path / f"seed-{seed}").mkdir()
    (tmp_path / "seed-0" / "run.json").write_text("{")
    monkeypatch.setattr(seeds, "attempt", dies_with_seed_7)
    code = main(["ppo", *TINY, "--seeds", "7", "0", "1", "--workers", "2", "--resume", "--out", str(tmp_path)])
    assert code == 2
    assert about(tmp_path / "seed-1")["status"] == "finished"
    printed = capfd.readouterr()
    assert "   0  failed" in printed.out
    assert "   7  failed" in printed.out
    assert "error: seed 0: " in printed.err
    assert "run.json is damaged" in printed.err
    assert "error: seed 7: its process has died (signal SIGKILL); go on with --resume" in printed.err


def test_repeat(several, tmp_path, capsys):
    run = several[0] / "seed-1" / "run.json"
    arguments = ["--no-progress", "--out"]
    assert main(["repeat", str(run), *arguments, str(tmp_path / "again")]) == 0
    assert "The same final weights, bit for bit" in capsys.readouterr().out
    assert timeless(tmp_path / "again" / "seed-1") == timeless(run.parent)

    content = about(run.parent)
    changed = {**content, "seed": 2, "machine": {"cpu": "another"}}
    (tmp_path / "run.json").write_text(json.dumps(changed))
    assert main(["repeat", str(tmp_path / "run.json"), *arguments, str(tmp_path / "other")]) == 1
    printed = capsys.readouterr().out
    assert f"Other final weights: expected {content['weights_sha256']}, got " in printed
    assert "  machine: {'cpu': 'another'} there, " in printed

    del content["weights_sha256"]
    (tmp_path / "run.json").write_text(json.dumps(content))
    assert main(["repeat", str(tmp_path / "run.json"), *arguments, str(tmp_path / "third")]) == 2
    assert "has not ended" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["ppo", "--preset", "smok"], "There is no preset 'smok'. Did you mean 'smoke'?"),
        (["ppo", *TINY, "--base-policy", "dlss"], "There is no policy 'dlss'. Did you mean 'dls'?"),
        (["ppo", *TINY, "--base-policy", "oracle"], "got the reference 'oracle'"),
        (
            ["ppo", *TINY, "--base-policy", "dls:dampin=1"],
            "There is no parameter of dls 'dampin'. Did you mean 'damping'?",
        ),
        (["ppo", *TINY, "--scenario", "varga"], "There is no scenario 'varga'"),
        (["ppo", *TINY, "--workers", "0"], "workers: expected a whole number of at least 1, got 0"),
        (["ppo", *TINY, "--seeds", "-1"], "seeds: expected a whole number of at least 0, got -1"),
        (["ppo", *TINY, "--n-steps", "7"], "n_steps: expected a divisor"),
        (["ppo", *TINY, "--init", "nowhere.safetensors"], "nowhere.safetensors does not exist"),
        (["repeat", "nowhere.json"], "Cannot read nowhere.json"),
        (["ppo", *TINY, "--batch-size", "1"], "batch_size: expected a whole number of at least 2, got 1"),
        (["ppo", *TINY, "--log-std-init", "-1000"], "log_std_init: expected a number from -20 to 2, got -1000"),
        (["sac", *TINY, "--buffer-size", "10000000000000"], "buffer_size: expected a whole number from 1 to 10000000"),
        (["ppo", *TINY, "--hidden", "1000000", "1000000"], "hidden: expected a whole number from 1 to 2048"),
        (["ppo", *TINY, "--hidden", *["9"] * 11], "hidden: expected at least one hidden layer, at most 10, got 11"),
        (["ppo", *TINY, "--n-envs", "10000000"], "n_envs: expected a whole number from 1 to 10000, got 10000000"),
        (["ppo", *TINY, "--offsets", "1", "1000000000"], "offsets: expected a whole number from 1 to 100000"),
        (["ppo", *TINY, "--sde-sample-freq", "4"], "sde_sample_freq: expected use_sde beside it, got 4"),
        (["sac", *TINY, "--ent-coef", "auto_x"], "ent_coef: expected auto, auto_X or a number"),
        (["ppo", *TINY, "--init", "model.zip"], "model.zip: a .zip of Stable-Baselines3 can run code"),
    ],
)
def test_errors_have_words_and_exit_code_2(arguments, message, tmp_path, capsys):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith("error: ")
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    "arguments", [["ppo", "--n-epoch", "3"], ["pp"], ["sac", "--n-epochs", "3"], ["ppo", "--gamma", "no"]]
)
def test_unknown_options_are_errors(arguments, tmp_path, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--out", str(tmp_path)])
    assert ended.value.code == 2
    assert arguments[1 if len(arguments) > 1 else 0] in capsys.readouterr().err


def test_values_out_of_range_on_the_command_line(tmp_path, capsys):
    try:
        code = main(["ppo", "--gamma", "2", "--out", str(tmp_path)])
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    assert "gamma" in capsys.readouterr().err


def test_no_method(capsys):
    """The help, and one line that says what is missing."""
    assert main([]) == 2
    printed = capsys.readouterr()
    assert "Methods: ppo, sac, td3, imitate, apg, observe." in printed.out
    assert printed.err.splitlines() == [
        "error: expected a method, one of ppo, sac, td3, imitate, apg, observe, or repeat; got none."
    ]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"method": []}, "expected a method"),
        ({"method": "pp"}, "There is no method 'pp'"),
        ({"config": []}, "its config by name"),
        ({"config": {"hidden": 3}}, "hidden: expected whole numbers, got 3"),
        ({"seed": -1}, "seed: expected a whole number of at least 0, got -1"),
        ({"format": 1, "versions": {"ikgym": "0.1.0"}}, 'pip install "ikgym==0.1.0"'),
    ],
)
def test_files_that_cannot_be_repeated(content, message, tmp_path, capsys):
    usual = {"format": 2, "method": "ppo", "seed": 0, "config": {}, "weights_sha256": "0"}
    (tmp_path / "run.json").write_text(json.dumps(usual | content))
    assert main(["repeat", str(tmp_path / "run.json"), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize(
    "error",
    [
        MemoryError("Unable to allocate 9 TiB"),
        RuntimeError("[enforce fail] DefaultCPUAllocator: can't allocate memory: you tried to allocate 9 bytes."),
    ],
)
def test_out_of_memory_is_named(error, tmp_path, monkeypatch, capsys):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(run, "train", fails)
    assert main(["ppo", *TINY, "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("error: seed 0: Out of memory: ")
    assert "fewer arms (--n-envs)" in printed
    assert len(printed.splitlines()) == 1


@pytest.mark.parametrize("package", ["torch", "stable_baselines3", "tensorboard"])
def test_a_missing_extra_is_named(package, tmp_path, monkeypatch, capsys):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else find(name))
    assert main(["ppo", *TINY, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f'error: Training needs {package}: pip install "ikgym[train]"\n'


def test_the_command_line_is_read_without_torch():
    """Which takes seconds to load, and is an extra."""
    code = (
        "import sys; from importlib.machinery import PathFinder\n"
        "def find(name, *others, found=PathFinder.find_spec):\n"
        "    return None if name.partition('.')[0] in ('torch', 'stable_baselines3') else found(name, *others)\n"
        "PathFinder.find_spec = find\n"
        "from baselines.training.command import main, parse\n"
        "parse(['sac', '--preset', 'sac', '--out', 'x']); sys.exit(main(['ppo', '--preset', 'smoke', '--out', 'x']))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 2, done.stderr
    assert "Training needs torch, stable_baselines3: pip install" in done.stderr


@pytest.mark.parametrize("arguments", [[], *([name] for name in methods.METHODS), ["repeat"]])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    for word in ["ppo", "smoke", "varga7-random", "repeat"] if not arguments else ["--out", "--resume"]:
        assert word in text


def test_the_command_line_takes_precedence_over_the_preset(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text("action_scale = 0.25\nsegments = 7\n")
    asked, given = parse(["ppo", "--preset", str(file), "--segments", "9", "--null-space", "0.1", "--out", "x"])
    assert asked.config == PPO(action_scale=0.25, segments=9, null_space=0.1)
    assert given == {"action_scale", "segments", "null_space"}
    assert parse(["ppo", f"--preset={file}", "--hidden=3", "--out", "x"])[1] == {"action_scale", "segments", "hidden"}
    assert parse(["td3", "--out", "x"])[1] == frozenset()


def test_ctrl_c(tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "train_seeds", interrupted)
    assert main(["ppo", *TINY, "--out", str(tmp_path)]) == 130
    assert f"is in {tmp_path}; go on with --resume" in capsys.readouterr().err


def silent(said):
    """Takes what a worker says on its way."""


def test_expected_errors_of_a_seed_are_told(tmp_path):
    (tmp_path / "seed-0").mkdir()
    (tmp_path / "seed-0" / "run.json").write_text("{")
    result = seeds.attempt(seeds.Seed(SeedRuns(PPO(), tmp_path, resume=True), 0), silent)
    assert result.seed == 0
    assert "run.json is damaged" in result.error


def test_unexpected_errors_of_a_seed_are_told(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(seeds, "train_seed", lambda *_: 1 / 0)
    result = seeds.attempt(seeds.Seed(SeedRuns(PPO(), tmp_path), 3), silent)
    assert result.error == "ZeroDivisionError: division by zero"
    assert "Traceback" in capfd.readouterr().err


def test_from_the_shell(tmp_path):
    """As a program of its own, with warnings as errors."""
    arguments = [*TINY, "--out", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-W", "error", ROOT / "train.py", "td3", *arguments, "--learning-starts", "80"],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert f"written to {tmp_path}" in done.stdout
    assert about(tmp_path / "seed-0")["command"].startswith("python train.py td3 --scenario faitli3-regular")


def test_no_seeds(tmp_path):
    asked, given = parse(["ppo", *TINY, "--out", str(tmp_path)])
    options = asked.options
    object.__setattr__(options, "seeds", ())
    with pytest.raises(TrainingError, match="seeds: expected at least one"):
        command._train(asked, given, "")


@pytest.mark.parametrize(
    "expert",
    [
        "agent:path={zip},trust=True",
        "smoothed:policy=agent,options={{'path': '{zip}', 'trust': True}}",
    ],
)
def test_a_run_json_grants_no_trust(tmp_path, capsys, expert):
    """Whoever repeats the run of somebody else runs none of their code."""

    class Evil:
        def __reduce__(self):
            return pathlib.Path.touch, (tmp_path / "ran",)

    with zipfile.ZipFile(tmp_path / "evil.zip", "w") as archive:
        serialized = base64.b64encode(pickle.dumps(Evil())).decode()
        archive.writestr("data", json.dumps({"policy_class": {":type:": "x", ":serialized:": serialized}}))
    config = {**methods.get("imitate").config().to_json(), "expert": expert.format(zip=tmp_path / "evil.zip")}
    about = {"format": FORMAT, "method": "imitate", "seed": 0, "config": config, "weights_sha256": "0" * 64}
    (tmp_path / "run.json").write_text(json.dumps(about))
    assert main(["repeat", str(tmp_path / "run.json"), "--out", str(tmp_path / "again"), "--no-progress"]) == 2
    said = capsys.readouterr().err
    assert "run.json: expert: trust is given on the command line or by the caller, never by a file" in said
    assert not (tmp_path / "ran").exists()


def test_a_seed_whose_node_is_lost_goes_on_elsewhere(several, tmp_path, monkeypatch, capsys):
    pool = LosingCluster(monkeypatch, lost=[0])
    assert main(["ppo", *TINY, "--seeds", "1", "--cluster", "ray", "--overwrite", "--out", str(tmp_path)]) == 0
    assert about(tmp_path / "seed-1")["weights_sha256"] == about(several[0] / "seed-1")["weights_sha256"]
    assert len(pool.units) == 2
    assert not list(tmp_path.glob(".cluster-*"))
    capsys.readouterr()


def test_nodes_have_to_share_the_folder(tmp_path, monkeypatch, capsys):
    LosingCluster(monkeypatch)
    monkeypatch.setattr(seeds, "_marked", lambda folder, wanted: contextlib.nullcontext("not-there"))
    assert main(["ppo", *TINY, "--seeds", "1", "--cluster", "ray", "--out", str(tmp_path)]) == 2
    assert "expected a folder that all nodes of the cluster share" in capsys.readouterr().err
