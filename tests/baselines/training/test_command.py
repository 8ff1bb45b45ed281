"""The command line of training: exit codes, several seeds, repetition."""

import dataclasses
import importlib.util
import pathlib
import subprocess
import sys

import pytest

from baselines.cli.commands.train import main, parse
from baselines.files import ResultsError
from baselines.training import run
from baselines.training.options import APG
from baselines.training.run import Job
from baselines.workers import Workers
from tests.baselines.losing import LosingCluster
from tests.baselines.training.small import about, timeless, tiny
from tests.spawning import dies_with_seed_7

ROOT = pathlib.Path(__file__).parents[3]
TINY = [
    "--scenario", "varga7-random", "--steps", "40", "--hidden", "8", "--offsets", "1", "2", "10",
    "--segments", "2", "--n-envs", "4", "--window", "16", "--segment-steps", "48", "--validation-episodes", "1",
    "--no-progress",
]  # fmt: skip


def job_of(config, out, seed=1, *, overwrite=False):
    options = {"resume": False, "overwrite": overwrite}
    return Job(config=config, seed=seed, folder=out / f"seed-{seed}", options=options)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Seed 1, in this process."""
    folder = tmp_path_factory.mktemp("alone")
    assert main(["apg", *TINY, "--seeds", "1", "--out", str(folder)]) == 0
    return folder


def test_several_seeds(alone, tmp_path, capsys, monkeypatch):
    """On nodes of a cluster: each has its folder, and ends as if it were alone, also after the loss of a node."""
    LosingCluster(monkeypatch, lost=[0])
    assert main(["apg", *TINY, "--seeds", "1", "5", "--cluster", "ray", "--out", str(tmp_path)]) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == ["seed-1", "seed-5"]
    assert about(tmp_path / "seed-1")["weights_sha256"] == about(alone / "seed-1")["weights_sha256"]
    assert about(tmp_path / "seed-5")["weights_sha256"] != about(alone / "seed-1")["weights_sha256"]
    assert timeless(tmp_path / "seed-1") == timeless(alone / "seed-1")
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split() == ["seed", "cost", "ratio", "cost", "worst", "lost"]
    assert [line.split()[:2] for line in printed[1:3]] == [["1", "–"], ["5", "–"]]


@pytest.mark.slow
def test_a_seed_that_fails_does_not_end_the_others(alone, tmp_path, monkeypatch, capfd):
    """Processes of this machine."""
    monkeypatch.setattr(run, "train_seed", dies_with_seed_7)
    assert main(["apg", *TINY, "--seeds", "7", "1", "--workers", "1", "--out", str(tmp_path)]) == 2
    assert about(tmp_path / "seed-1")["weights_sha256"] == about(alone / "seed-1")["weights_sha256"]
    printed = capfd.readouterr()
    assert "   7  failed" in printed.out
    assert "error: seed 7: " in printed.err
    assert "--resume" in printed.err


def test_an_error_of_the_program_is_said_and_ends_no_other_seed(tmp_path, monkeypatch, capfd):
    LosingCluster(monkeypatch)
    monkeypatch.setattr(run, "train_seed", lambda job: {"seed": 1 // (job.seed - 3)})
    jobs = [job_of(APG(), tmp_path, seed) for seed in (3, 4)]
    results = run.train_seeds(jobs, Workers(cluster="ray"))
    assert results == {3: "ZeroDivisionError: integer division or modulo by zero", 4: {"seed": 1}}
    assert "Traceback" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["apg", "--preset", "quck"], "There is no preset 'quck'. Did you mean 'quick'?"),
        (["apg", "--window", "1000000000"], "window: expected a whole number from 1 to 10000, got 1000000000."),
        (["apg", "--window", "7"], "window: expected multiples of hold"),
        (["apg", *TINY, "--init", "nowhere.safetensors"], "Cannot read nowhere.safetensors"),
        (["apg", *TINY[2:], "--scenario", "panda-field"], "expected an ideal plant with a known gradient"),
    ],
)
def test_errors_are_one_line_and_exit_code_2_and_replace_no_run(arguments, message, tmp_path, capsys):
    (tmp_path / "seed-0").mkdir()
    (tmp_path / "seed-0" / "run.json").write_text("{}")
    assert main([*arguments, "--overwrite", "--out", str(tmp_path)]) == 2
    printed = capsys.readouterr()
    assert message in printed.err
    assert "written to" not in printed.out
    assert printed.err.startswith("error: ")
    assert len(printed.err.splitlines()) == 1
    assert (tmp_path / "seed-0" / "run.json").read_text() == "{}"


def test_no_method(capsys):
    with pytest.raises(SystemExit) as ended:
        main([])
    assert ended.value.code == 0
    assert "Methods: apg, ppo, sac, td3, recurrent_ppo." in capsys.readouterr().out


@pytest.mark.parametrize(
    ("patched", "error", "code", "message"),
    [
        ((run, "train"), MemoryError("Unable to allocate 9 TiB"), 2, "Out of memory: Unable to allocate 9 TiB. Choose"),
        ((run, "train_seeds"), KeyboardInterrupt(), 130, "continue with --resume"),
    ],
)
def test_a_run_that_ends_early(patched, error, code, message, tmp_path, monkeypatch, capsys):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(*patched, fails)
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


def test_nodes_of_a_cluster_share_the_folder(tmp_path):
    config = tiny(segments=1)
    elsewhere = dataclasses.replace(job_of(config, tmp_path / "unseen"), remote=True)
    assert "expected a folder that all nodes of the cluster share" in run.train_seed(elsewhere)
    job = job_of(config, tmp_path, overwrite=True)
    assert run.train_seed(run._prepare(job))["status"] == "finished"
    with pytest.raises(ResultsError, match="already exists"):
        run._prepare(job_of(config, tmp_path))
    run._prepare(job)
    assert not (job.folder / "run.json").exists()
