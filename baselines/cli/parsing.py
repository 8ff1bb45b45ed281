"""Reading the words after a command; whatever is wrong with them is refused in one line, before anything is done."""

from __future__ import annotations

import contextlib
import dataclasses
import io
import pathlib
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from typing import Annotated, Any, TypeVar

import tyro

from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.scenarios import Scenario
from ikgym.validation import Bounds, Seed, check_sizes

#: Patterns in messages of tyro, and plainer texts.
PLAINER: tuple[tuple[str, str | Callable[[re.Match[str]], str]], ...] = (
    (r"no type matching (?:\{None\}\|)?(\S+) could be instantiated from \['(.*?)'\].*", r"expected \1, got '\2'"),
    (r"invalid literal for int\(\) with base 10: ", "expected a whole number, got "),
    (r"could not convert string to float: ", "expected a number, got "),
    (r"Expected 1 values", "Expected one"),
    (r"Error parsing [A-Z]\w+: ", ""),
    (r"^(\w+): expected", lambda found: f"--{found[1].replace('_', '-')}: expected"),
    (r" Arguments are applied to the directly preceding subcommand.*", ""),
    (r"(Missing from .*?: --\S+).*", r"\1"),
)


T = TypeVar("T")

#: Options that are a number of at least 1, and a seed.
Count = Annotated[int, tyro.conf.arg(metavar="N"), Bounds(at_least=1)]
SeedOption = Annotated[Seed, tyro.conf.arg(metavar="N")]


@dataclasses.dataclass(frozen=True)
class Rule:
    """Options that have an effect only together with others."""

    names: tuple[str, ...]  # the options, such as ``"--resume"``
    used: Callable[[Any], bool]  # whether they have an effect, given all options of the command
    otherwise: str  # when they have none, such as "without --out", for the message


def parse(kind: type[T], arguments: Sequence[str], *, prog: str, description: str, rules: Iterable[Rule] = ()) -> T:
    """Reads the words after a command. Modules in the current folder can be imported from then on.

    Raises:
        InvalidInputError: An option is unknown, missing, repeated, refused or without effect, or its value is empty or
            far beyond any sensible size; the message is one line.
        UnknownNameError: A rule looks at a scenario that does not exist.
        SystemExit: With 0 after ``--help``.
    """
    given = _read_spellings(arguments)
    find_own_modules()
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            options = tyro.cli(kind, prog=prog, description=description, args=list(arguments))
    except SystemExit as e:
        if e.code:
            raise InvalidInputError(f"{_in_one_line(said.getvalue())} See {prog} --help.") from None
        raise
    check_sizes("", options)
    for name, word in given.items():
        if getattr(options, name.lstrip("-").replace("-", "_"), None) == ():
            raise InvalidInputError(f"{word}: expected a value, got none.")
    for rule in rules:
        for name in rule.names:
            if name in given and not rule.used(options):
                raise InvalidInputError(f"{given[name]} has no effect {rule.otherwise}.")
    return options


def if_random(name: str, scenario: Callable[[Any], str] = lambda given: given.scenario) -> Rule:
    """The rule for an option that chooses among the episodes of a scenario."""
    unchanging = "on a scenario that is the same at every reset"
    return Rule((name,), lambda given: scenarios.find(scenario(given)).varies, unchanging)


@dataclasses.dataclass(frozen=True, kw_only=True)
class EpisodeOptions(Frozen):
    """The episode that a command shows."""

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "varga7-fast"
    """Name of a scenario, FILE.toml or MODULE:ATTRIBUTE."""
    policy: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ()
    """Policies side by side, as evaluate takes them; the one that the scenario names if left out, else qp."""
    seed: SeedOption = 0
    """Reset seed of the episode."""
    steps: Count | None = None
    """Number of steps; all of the scenario if left out."""

    def policies(self, scenario: Scenario) -> tuple[str, ...]:
        """The policies that are shown in a scenario."""
        return self.policy or (scenario.policy or "qp",)


def find_own_modules() -> None:
    """Lets modules in the current folder be imported, which a console command does not search."""
    if (here := str(pathlib.Path.cwd())) not in sys.path:
        sys.path.append(here)


def _read_spellings(arguments: Sequence[str]) -> dict[str, str]:
    """The options as they are spelt in the help, and as they were given."""
    out: dict[str, str] = {}
    last = "the command"
    for word in arguments:
        option, equals, value = word.partition("=")
        if not word or (option.startswith("--") and equals and not value):
            raise InvalidInputError(f"{option or last}: expected a value, got an empty text.")
        if not option.startswith("--"):
            continue
        name = option.replace("_", "-").replace("--no-", "--", 1)
        if name in out:
            raise InvalidInputError(f"{option} is given twice: expected each option once, with all of its values.")
        out[name], last = option, option
    return out


def _in_one_line(box: str) -> str:
    """The message in a box of tyro's: the mistake, and the names that are available."""
    sections: list[list[str]] = [[]]
    for line in re.sub(r"\x1b\[[0-9;]*m", "", box).splitlines():
        row = line.strip("│ ")
        if not row.strip("─-"):
            sections.append([])
        elif not row.startswith(("╭", "╰")):
            sections[-1].append(row)
    # Where nothing but ASCII can be printed there is no frame that holds the title: it is a section.
    texts = [" ".join(section) for section in sections if section][0 if "╭" in box else 1 :]
    message, more = (*texts, "", "")[:2]
    for pattern, plain in PLAINER:
        message = re.sub(pattern, plain, message)
    if listed := re.match(r"Available subcommands: ([\w, -]+)", more):
        message += f". Available: {listed[1].strip()}"
    if near := re.match(r"Perhaps you meant:? (\S+)", more):
        message += f". Did you mean {near[1]!r}?"
    return message if message.endswith(("?", ".")) else f"{message}."
