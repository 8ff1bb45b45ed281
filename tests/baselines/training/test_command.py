"""The command line of training: exit codes, several seeds, repetition."""

import importlib.util
import pathlib
import subprocess
import sys

import pytest

from baselines.cli.commands.train import main, parse
from baselines.training import run
from baselines.training.options import APG
from tests.baselines.training.small import about, timeless

ROOT = pathlib.Path(__file__).parents[3]
TINY = [
    "--scenario", "varga7-random", "--steps", "40", "--hidden", "8", "--offsets", "1", "2", "10",
    "--segments", "2", "--n-envs", "4", "--window", "16", "--segment-steps", "48", "--validation-episodes", "1",
]  # fmt: skip


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Seed 1, in this process."""
    folder = tmp_path_factory.mktemp("alone")
    assert main(["apg", *TINY, "--seeds", "1", "--out", str(folder)]) == 0
    return folder


def test_several_seeds(alone, tmp_path, capsys):
    """Each has its folder, and ends as if it were alone; the same command leaves those that have ended as they are."""
    words = ["apg", *TINY, "--seeds", "1", "5", "--out", str(tmp_path)]
    assert main(words) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["seed-1", "seed-5"]
    assert about(tmp_path / "seed-1")["weights_sha256"] == about(alone / "seed-1")["weights_sha256"]
    assert about(tmp_path / "seed-5")["weights_sha256"] != about(alone / "seed-1")["weights_sha256"]
    assert timeless(tmp_path / "seed-1") == timeless(alone / "seed-1")
    printed = capsys.readouterr().out.splitlines()
    assert [line.partition(", worst")[0].split(", cost")[0][:12] for line in printed[:2]] == [
        "seed 1: cost",
        "seed 5: cost",
    ]
    assert main(words) == 0
    assert capsys.readouterr().out.splitlines() == [f"{line}, already there" for line in printed[:2]] + printed[2:]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["apg", "--preset", "quck"], "There is no preset 'quck'. Did you mean 'quick'?"),
        (["apg", "--window", "1000000000"], "window: expected a whole number from 1 to 10000, got 1000000000."),
        (["apg", "--window", "7"], "window: expected multiples of hold"),
        (["apg", *TINY[2:], "--scenario", "panda-field"], "expected an ideal plant with a known gradient"),
    ],
)
def test_errors_are_one_line_and_exit_code_2_and_leave_no_run(arguments, message, tmp_path, capsys):
    assert main([*arguments, "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert "written to" not in printed.out
    assert printed.err.startswith("error: ")
    assert len(printed.err.splitlines()) == 1
    assert not list(tmp_path.glob("*/run.json"))


def test_no_method(capsys):
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 0
    assert "Methods: apg, ppo, sac, td3, recurrent_ppo." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (MemoryError("Unable to allocate 9 TiB"), 2, "Out of memory. Unable to allocate 9 TiB"),
        (KeyboardInterrupt(), 130, "Stopped. The same command continues."),
    ],
)
def test_a_run_that_ends_early(error, code, message, tmp_path, monkeypatch, capsys):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(run, "train", fails)
    assert main(["apg", *TINY, "--out", str(tmp_path)]) == code
    assert message in capsys.readouterr().err


def test_a_missing_extra_is_named(tmp_path, monkeypatch, capsys):
    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "tensorboard" else find(name))
    assert main(["apg", *TINY, "--out", str(tmp_path)]) == 2
    assert capsys.readouterr().err == 'error: This needs tensorboard: pip install "ikgym[train]"\n'


@pytest.mark.slow
def test_from_the_shell(tmp_path):
    """As a separate program, with warnings as errors."""
    arguments = [ROOT / "train.py", "apg", *TINY, "--out", "."]
    command = [sys.executable, "-W", "error", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert all(line.startswith("Compiling ") for line in done.stderr.splitlines())
    assert "written to ." in done.stdout
    assert about(tmp_path / "seed-0")["command"].startswith("python train.py apg --scenario varga7-random")


def test_the_command_line_takes_precedence_over_the_preset(tmp_path):
    (tmp_path / "mine.toml").write_text("hold = 4\nsegments = 7\n")
    given = parse(["apg", "--preset", str(tmp_path / "mine.toml"), "--segments", "9", "--out", "x"])
    assert given.config == APG(hold=4, segments=9)
