"""Reading the words after a command: whatever is wrong is refused in one line."""

import dataclasses

import pytest

from baselines.cli.parsing import Rule, parse
from ikgym.exceptions import InvalidInputError


@dataclasses.dataclass(frozen=True)
class Options:
    """What a command takes."""

    number: int = 1
    share: float | None = None
    name: str = ""
    several: tuple[float, ...] = ()
    plots: bool = True


@dataclasses.dataclass(frozen=True)
class Needy:
    """What a command takes that needs something."""

    out: str
    """A folder."""


SIZE = "expected 0, or an absolute value from 1e-12 to 1e+12"
RULES = (Rule(("--plots",), lambda given: bool(given.name), "without --name"),)


@pytest.mark.parametrize(
    ("kind", "arguments", "message"),
    [
        (Options, ["--numbr", "2"], "Unrecognized options: --numbr, 2. Did you mean '--number'? See it --help."),
        (Options, ["--number", "x"], "Error parsing --number: expected a whole number, got 'x'. See it --help."),
        (Options, ["--share", "x"], "Error parsing --share: expected FLOAT, got 'x'. See it --help."),
        (Options, ["--name"], "Missing value for argument '--name'. Expected one. See it --help."),
        (Options, ["all"], "Unrecognized options: all. See it --help."),
        (Needy, [], "Missing from it: --out. See it --help."),
        (
            Options,
            ["--name", "a", "--name", "b"],
            "--name is given twice: expected each option once, with all of its values.",
        ),
        (
            Options,
            ["--plots", "--no-plots"],
            "--no-plots is given twice: expected each option once, with all of its values.",
        ),
        (Options, ["--name", ""], "--name: expected a value, got an empty text."),
        (Options, ["--name="], "--name: expected a value, got an empty text."),
        (Options, ["--number", "9" * 23], f"number: {SIZE}, got {'9' * 23}."),
        (Options, ["--share", "1e300"], f"share: {SIZE}, got 1e+300."),
        (Options, ["--share", "-1e-300"], f"share: {SIZE}, got -1e-300."),
        (Options, ["--share", "nan"], f"share: {SIZE}, got nan."),
        (Options, ["--several", "1", "inf"], f"several: {SIZE}, got inf."),
        (Options, ["--no-plots"], "--no-plots has no effect without --name."),
        (Options, ["--plots", "--share", "0.5"], "--plots has no effect without --name."),
    ],
)
def test_a_mistake_is_one_line(kind, arguments, message, monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    with pytest.raises(InvalidInputError) as refused:
        parse(kind, arguments, prog="it", description="Does something.", rules=RULES)
    assert str(refused.value) == message


def test_help_and_good_arguments(capsys):
    words = ["--number", "3", "--no-plots", "--name", "x", "--share", "0", "--several", "-1", "2"]
    wanted = Options(3, 0.0, "x", (-1.0, 2.0), plots=False)
    assert parse(Options, words, prog="it", description="", rules=RULES) == wanted
    with pytest.raises(SystemExit) as ended:
        parse(Options, ["--help"], prog="it", description="Does something.")
    assert ended.value.code == 0
    assert "Does something." in capsys.readouterr().out
