"""How commands end: exit codes, missing extras, closed pipes."""

import dataclasses
import subprocess
import sys

import pytest

from baselines.cli import shell
from ikgym.exceptions import InvalidInputError


def failing(error):
    def work():
        raise error

    return work


def test_exit_codes(capsys):
    assert shell.run(lambda: 0) == 0
    assert shell.run(lambda: 1) == 1
    assert shell.run(failing(InvalidInputError("Nothing\n  fits."))) == 2
    assert capsys.readouterr().err == "error: Nothing fits.\n"
    assert shell.run(failing(KeyboardInterrupt()), lambda: "Stopped; all is kept.") == 130
    assert capsys.readouterr().err == "\nStopped; all is kept.\n"


@dataclasses.dataclass(frozen=True)
class Options:
    """A folder that may be left out."""

    out: str | None = None


@pytest.mark.parametrize(
    ("words", "message"),
    [([], "Stopped."), (["--out", "x"], "Stopped. Finished work is in x; continue with --resume.")],
)
def test_ctrl_c_names_the_folder_if_there_is_one(words, message, capsys):
    def work(given, line):
        raise KeyboardInterrupt

    assert shell.Command("evaluate", Options, lambda prog: "", work, kept=shell.RESUMED)(words) == 130
    assert capsys.readouterr().err == f"\n{message}\n"


def test_a_missing_extra_is_named(capsys):
    assert shell.run(failing(ModuleNotFoundError("no", name="torch.nn"))) == 2
    assert capsys.readouterr().err == 'error: This needs torch: pip install "ikgym[train]"\n'
    with pytest.raises(ModuleNotFoundError):  # a module of ours that is missing is a defect, not a mistake
        shell.run(failing(ModuleNotFoundError("no", name="baselines.nowhere")))


def test_extras_exist():
    import tomllib
    from pathlib import Path

    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    assert set(shell.EXTRAS.values()) <= set(project["optional-dependencies"])


def test_a_closed_pipe_is_silent():
    code = (
        "import sys\nfrom baselines.cli import shell\n"
        "def work():\n    for _ in range(100000): print('a line')\n    return 0\n"
        "sys.exit(shell.run(work))"
    )
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout.readline() == b"a line\n"
        process.stdout.close()
        assert process.stderr.read() == b""
    assert process.returncode == 0


def test_names_of_programs(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/somewhere/bin/ikgym", "evaluate"])
    assert shell.program("evaluate", "python -m baselines.evaluate") == "ikgym evaluate"
    monkeypatch.setattr(sys, "argv", ["/somewhere/baselines/evaluate.py"])
    assert shell.program("evaluate", "python -m baselines.evaluate") == "python -m baselines.evaluate"
