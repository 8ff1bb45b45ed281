"""How commands end: exit codes, missing extras, closed pipes."""

import dataclasses
import os
import pathlib
import subprocess
import sys

import pytest
from tqdm import tqdm

from baselines.cli import shell
from baselines.files import reading
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


def played(words, *, environment=(), **streams):
    """The exit code and stderr of a command with streams of ours."""
    code = "import sys; from baselines.cli import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        env={**os.environ, **dict(environment)},
        check=False,
        **{"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **streams},
    )
    return done.returncode, done.stdout, done.stderr


@pytest.mark.skipif(not pathlib.Path("/dev/full").exists(), reason="this system has no device that is always full")
@pytest.mark.parametrize("words", [["--version"], ["policies", "dls"]])
def test_a_full_disk_is_one_line(words):
    with pathlib.Path("/dev/full").open("wb") as full:
        code, _, err = played(words, stdout=full)
        assert (code, err.count(b"\n")) == (2, 1)
        assert b"No space left" in err


@pytest.mark.skipif(os.name == "nt", reason="streams are closed by a shell of Unix")
def test_closed_streams_are_silent():
    code = "import sys; from baselines.cli import main; sys.exit(main(['policies', 'dls']))"
    done = subprocess.run(["sh", "-c", 'exec "$0" -c "$1" >&-', sys.executable, code], capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")


def test_characters_that_an_encoding_lacks_are_escaped():
    code, out, err = played(["policies", "dls"], environment={"PYTHONIOENCODING": "cp1252"})
    assert (code, err) == (0, b"")
    assert rb"\u03bb" in out


def test_control_characters_of_names_are_escaped_wherever_they_are_printed(capsys):
    name = "a\x1b]0;title\x07\x9b31m\u202e\r"

    def work(given, line):
        print(name)
        print(f"warning: {name}", file=sys.stderr)
        with tqdm(total=1, desc=f"{name}\n", file=sys.stderr) as bar:
            bar.update()
        raise InvalidInputError(name)

    assert shell.Command("evaluate", Options, lambda prog: "", work)([]) == 2
    out, err = capsys.readouterr()
    escaped = r"a\x1b]0;title\x07\x9b31m\u202e\r"
    assert out == f"{escaped}\n"
    assert not set("\x1b\x07\x9b\u202e") & set(err)
    assert f"warning: {escaped}\n" in err
    assert rf"{escaped}\n: 100%" in err
    assert err.endswith(rf"error: {escaped.removesuffix(chr(92) + 'r')}" + "\n")


def test_memory_and_disks_that_are_used_up_are_one_line(capsys, tmp_path):
    with pytest.raises(MemoryError), reading(tmp_path / "best_known.json"):
        raise MemoryError
    assert shell.run(failing(MemoryError())) == 2
    assert capsys.readouterr().err == "error: Out of memory.\n"
    assert shell.run(failing(OSError(28, "No space left on device", "results.csv"))) == 2
    assert capsys.readouterr().err == "error: results.csv: No space left on device.\n"


def test_names_of_programs(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["/somewhere/bin/ikgym", "evaluate"])
    assert shell.program("evaluate", "python -m baselines.evaluate") == "ikgym evaluate"
    monkeypatch.setattr(sys, "argv", ["/somewhere/baselines/evaluate.py"])
    assert shell.program("evaluate", "python -m baselines.evaluate") == "python -m baselines.evaluate"
