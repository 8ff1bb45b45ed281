"""The command line of training: presets, exit codes, several seeds, repetition."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import pathlib
import subprocess
import sys

import pytest

from baselines.cli import train
from baselines.cli.train import main, parse
from baselines.training import presets, run, seeds
from baselines.training.config.apg import APG
from baselines.training.config.reinforcement import PPO
from baselines.training.folder import FORMAT
from baselines.training.methods import METHODS, get
from baselines.training.seeds import RunOptions, Seed
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.training.small import about, timeless, tiny
from tests.spawning import dies_with_seed_7

ROOT = pathlib.Path(__file__).parents[3]
TINY = [
    "--scenario", "varga7-random", "--task", "pose", "--steps", "40", "--hidden", "8", "--offsets", "1", "2", "10",
    "--segments", "2", "--n-envs", "4", "--window", "16", "--segment-steps", "48", "--validation-episodes", "1",
    "--no-progress",
]  # fmt: skip


@pytest.fixture(scope="module")
def several(tmp_path_factory):
    """Two seeds in two processes."""
    folder = tmp_path_factory.mktemp("several")
    code = main(["apg", *TINY, "--seeds", "1", "5", "--workers", "2", "--out", str(folder)])
    return folder, code


def test_several_seeds(several, tmp_path, capsys):
    """Each in its folder, and the same as if it were alone."""
    folder, code = several
    assert code == 0
    assert sorted(path.name for path in folder.iterdir()) == ["seed-1", "seed-5"]
    assert len({about(folder / f"seed-{seed}")["weights_sha256"] for seed in (1, 5)}) == 2
    assert main(["apg", *TINY, "--seeds", "5", "--out", str(tmp_path)]) == 0
    assert about(tmp_path / "seed-5")["weights_sha256"] == about(folder / "seed-5")["weights_sha256"]
    assert timeless(tmp_path / "seed-5") == timeless(folder / "seed-5")
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split() == ["seed", "cost", "ratio", "cost", "worst", "lost"]
    assert printed[1].split()[:2] == ["5", "–"]


def test_a_seed_that_dies_does_not_end_the_others(several, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(seeds, "attempt", dies_with_seed_7)
    assert main(["apg", *TINY, "--seeds", "7", "1", "--workers", "1", "--out", str(tmp_path)]) == 2
    assert about(tmp_path / "seed-1")["weights_sha256"] == about(several[0] / "seed-1")["weights_sha256"]
    printed = capfd.readouterr()
    assert "   7  failed" in printed.out
    assert "error: seed 7: " in printed.err
    assert "--resume" in printed.err


def test_errors_of_a_seed_are_results(tmp_path, monkeypatch, capfd):
    (tmp_path / "seed-0").mkdir()
    (tmp_path / "seed-0" / "run.json").write_text("{")
    result = seeds.attempt(Seed(tiny("apg"), RunOptions(out=tmp_path, resume=True), "", 0))
    assert "run.json is damaged" in result.error
    monkeypatch.setattr(seeds, "train_seed", lambda *_: 1 / 0)
    assert seeds.attempt(Seed(PPO(), RunOptions(out=tmp_path), "", 3)).error == "ZeroDivisionError: division by zero"
    assert "Traceback" in capfd.readouterr().err


def test_repeat(several, tmp_path, capsys):
    folder, arguments = several[0] / "seed-1", ["--no-progress", "--out"]
    assert main(["repeat", str(folder / "run.json"), *arguments, str(tmp_path / "again")]) == 0
    assert "The same final weights, bit for bit" in capsys.readouterr().out
    assert timeless(tmp_path / "again" / "seed-1") == timeless(folder)
    content = about(folder)
    (tmp_path / "run.json").write_text(json.dumps({**content, "seed": 2, "machine": {"cpu": "another"}}))
    assert main(["repeat", str(tmp_path / "run.json"), *arguments, str(tmp_path / "other")]) == 1
    printed = capsys.readouterr().out
    assert f"Other final weights: expected {content['weights_sha256']}, got " in printed
    assert "  machine: {'cpu': 'another'} there, " in printed


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"weights_sha256": None}, "has not ended"),
        ({"method": "pp"}, "There is no method 'pp'"),
        ({"config": {"hidden": 3}}, "hidden: expected 1 to 10 layers, got 3"),
        ({"seed": -1}, "seed: expected a whole number of at least 0, got -1"),
        ({"format": 1}, f"expected the run.json of a training in format {FORMAT}"),
    ],
)
def test_files_that_cannot_be_repeated(content, message, tmp_path, capsys):
    usual = {"format": FORMAT, "method": "apg", "seed": 0, "config": {}, "weights_sha256": "0"}
    (tmp_path / "run.json").write_text(json.dumps(usual | content))
    assert main(["repeat", str(tmp_path / "run.json"), "--out", str(tmp_path / "out")]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["apg", "--preset", "smok"], "There is no preset 'smok'. Did you mean 'smoke'?"),
        (["ppo", "--preset", "quick"], "The preset quick is for apg, not for ppo"),
        (["apg", *TINY, "--scenario", "varga"], "There is no scenario 'varga'"),
        (["apg", *TINY, "--workers", "0"], "workers: expected a whole number of at least 1, got 0"),
        (["apg", *TINY, "--seeds", "-1"], "seeds: expected a whole number of at least 0, got -1"),
        (["apg", *TINY, "--window", "7"], "window: expected multiples of hold"),
        (["apg", *TINY, "--init", "nowhere.safetensors"], "Cannot read nowhere.safetensors"),
        (["repeat", "nowhere.json"], "Cannot read nowhere.json"),
        (["apg", *TINY, "--hidden", "1000000"], "hidden: expected a whole number from 1 to 2048"),
        (["apg", *TINY, "--n-envs", "10000000"], "n_envs: expected a whole number from 1 to 10000, got 10000000"),
        (["ppo", "--set", "n_steps"], "set: expected NAME=VALUE, got 'n_steps'"),
    ],
)
def test_errors_have_words_and_exit_code_2(arguments, message, tmp_path, capsys):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.startswith("error: ")
    assert len(error.splitlines()) == 1


@pytest.mark.parametrize("arguments", [["apg", "--windo", "3"], ["pp"], ["sac", "--window", "3"]])
def test_unknown_options_are_errors(arguments, tmp_path, capsys):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    assert arguments[min(len(arguments) - 1, 1)] in capsys.readouterr().err


def test_no_method(capsys):
    """The help, and one line that says what is missing."""
    assert main([]) == 2
    printed = capsys.readouterr()
    assert "Methods: ppo, sac, td3, apg, observe." in printed.out
    assert printed.err == "error: expected a method, one of ppo, sac, td3, apg, observe, or repeat; got none.\n"


@pytest.mark.parametrize("arguments", [[], *([name] for name in METHODS), ["repeat"]])
def test_help(arguments, capsys):
    with pytest.raises(SystemExit) as ended:
        main([*arguments, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    for word in ["ppo", "smoke", "varga7-random", "repeat"] if not arguments else ["--out", "--resume"]:
        assert word in text


def test_out_of_memory_is_named(tmp_path, monkeypatch, capsys):
    def fails(*_, **__):
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr(run, "train", fails)
    assert main(["apg", *TINY, "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr().err
    assert printed.startswith("error: seed 0: Out of memory: Unable to allocate 9 TiB")
    assert "fewer arms (--n-envs)" in printed


def test_ctrl_c(tmp_path, capsys, monkeypatch):
    def interrupted(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(train, "train_seeds", interrupted)
    assert main(["apg", *TINY, "--out", str(tmp_path)]) == 130
    assert f"is in {tmp_path}; continue with --resume" in capsys.readouterr().err


@pytest.mark.parametrize("package", ["torch", "stable_baselines3", "tensorboard"])
def test_a_missing_extra_is_named(package, tmp_path, monkeypatch, capsys):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == package else find(name))
    assert main(["apg", *TINY, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == f'error: Training needs {package}: pip install "ikgym[train]"\n'


def test_the_command_line_is_read_without_torch():
    """Which takes seconds to load, and is an extra."""
    code = (
        "import sys; from baselines.cli.train import parse\n"
        "parse(['sac', '--preset', 'smoke', '--out', 'x']); assert 'torch' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr


def test_from_the_shell(tmp_path):
    """As a program of its own, with warnings as errors."""
    done = subprocess.run(
        [sys.executable, "-W", "error", ROOT / "train.py", "td3", "--preset", "smoke", "--no-progress", "--out", "."],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert all(line.startswith("Compiling ") for line in done.stderr.splitlines())
    assert "written to ." in done.stdout
    assert about(tmp_path / "seed-0")["command"].startswith("python train.py td3 --preset smoke")


def test_the_command_line_takes_precedence_over_the_preset(tmp_path):
    (tmp_path / "mine.toml").write_text("hold = 4\nsegments = 7\n")
    asked = parse(["apg", "--preset", str(tmp_path / "mine.toml"), "--segments", "9", "--out", "x"])
    assert asked.config == APG(hold=4, segments=9)
    asked = parse(["ppo", "--set", "n_steps=8", "gamma=0.9", "--learning", "furthest=20", "--out", "x"])
    assert asked.config.algorithm_settings == {"n_steps": 8, "gamma": 0.9}
    assert asked.config.learning_settings == {"furthest": 20}


def test_nodes_of_a_cluster_have_to_share_the_folder(tmp_path):
    options, config = RunOptions(out=tmp_path, overwrite=True, progress=False), tiny("apg", segments=1)
    one = Seed(config, options, "", 1, mark="not-there")
    assert "expected a folder that all nodes of the cluster share" in seeds.train_seed(one).error
    with seeds._marked(tmp_path, True) as mark:
        first, again = (seeds.train_seed(Seed(config, options, "", 1, mark)) for _ in range(2))
        assert not first.error
        assert again == first  # resumed, as after the loss of a node
    assert not list(tmp_path.glob(".cluster-*"))


@pytest.mark.parametrize("kind", METHODS.values(), ids=METHODS)
def test_configurations_are_json(kind):
    config = tiny(kind.method)
    values = json.loads(json.dumps(config.to_json()))
    assert kind.from_json(values) == config
    assert kind.__doc__


@pytest.mark.parametrize(
    ("kind", "values", "error", "message"),
    [
        (APG, {"windo": 3}, UnknownNameError, "no option of apg 'windo'. Did you mean 'window'"),
        (APG, {"activation": "sili"}, UnknownNameError, "Did you mean 'silu'"),
        (APG, {"hidden": []}, InvalidInputError, "hidden: expected 1 to 10 layers"),
        (APG, {"hidden": [8, 0]}, InvalidInputError, "hidden: expected a whole number of at least 1, got 0"),
        (APG, {"offsets": [2, 5]}, InvalidInputError, "offsets: expected steps ahead that rise from 1"),
        (APG, {"segments": 0}, InvalidInputError, "segments: expected"),
        (APG, {"steps": 0}, InvalidInputError, "steps: expected"),
        (APG, {"keep_best": "yes"}, InvalidInputError, "keep_best: expected true or false"),
        (APG, {"learning_rate": -1}, InvalidInputError, "learning_rate: expected a finite number above 0"),
        (APG, {"window": 64}, InvalidInputError, "window: expected whole numbers, got 64"),
        (APG, {"window": (88,)}, InvalidInputError, "window: expected .* that divide segment_steps, 1920, got 88"),
        (APG, {"averaging": 1.5}, InvalidInputError, "averaging"),
        (APG, {"damping": 0.0}, InvalidInputError, "damping"),
        (APG, {"reset_distance": -1.0}, InvalidInputError, "reset_distance"),
    ],
)
def test_refused_configurations(kind, values, error, message):
    with pytest.raises(error, match=message):
        kind.from_json(values)


def test_values_of_segments():
    config = APG(segments=3, learning_rate=1e-2, learning_rate_end=1e-4)
    assert [config.learning_rate_of(n) for n in range(3)] == pytest.approx([1e-2, 1e-3, 1e-4], rel=1e-12)
    assert (APG(steps=50).make_scenario().steps, APG(steps=5000).make_scenario().steps) == (50, 1000)
    with pytest.raises(UnknownNameError, match=r"no method 'pp'\. Did you mean 'ppo'"):
        get("pp")


def test_presets(tmp_path):
    assert presets.names() == ("quick", "standard", "long", "smoke")
    for kind in METHODS.values():
        assert presets.configure(kind, "smoke").make_scenario()
        assert presets.configure(kind, None) == kind()
    for name in ("quick", "standard", "long"):
        assert presets.configure(APG, name).damping == 1e-2
    for text, error, message in [
        ("windo = 2\n", UnknownNameError, "no option of apg 'windo'"),
        ("window = \n", InvalidInputError, "Cannot read the preset .*mine.toml"),
    ]:
        (tmp_path / "mine.toml").write_text(text)
        with pytest.raises(error, match=message):
            presets.configure(APG, str(tmp_path / "mine.toml"))
    with pytest.raises(InvalidInputError, match="Cannot read the preset"):
        presets.configure(APG, str(tmp_path / "none.toml"))


def test_no_seeds(tmp_path, capsys):
    with contextlib.suppress(SystemExit):
        assert main(["apg", *TINY, "--out", str(tmp_path), "--seeds"]) == 2
