"""The command ``ikgym compare``: which solver for an arm and a path."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Annotated

import tyro

from baselines.cli import shell
from baselines.cli.parsing import Rule, parse
from baselines.cli.robot import PATH_OPTIONS, URDF_OPTIONS, PathOptions
from baselines.evaluation.compare import compare
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario

PROGRAM = f"{shell.CONSOLE} compare"


@dataclasses.dataclass(frozen=True, kw_only=True)
class Arguments(PathOptions):
    """Arguments of the command line."""

    files: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="ROBOT PATH.csv | SCENARIO")] = ()
    """A robot, FILE.urdf or an arm of the catalogue, and its path; or a scenario, FILE.toml or its name."""

    def chosen(self) -> Scenario:
        """The scenario.

        Raises:
            InvalidInputError: There are more words than that, or one names nothing that can be read.
        """
        match self.files:
            case [name]:
                return scenarios.find(name)
            case [robot, path]:
                return self.scenario(robot, path)
        raise InvalidInputError(f"Expected a scenario, or a robot and a path, got {len(self.files)} words.")


RULES = (
    Rule(PATH_OPTIONS, lambda given: len(given.files) > 1, "with a scenario, which states it itself"),
    Rule(URDF_OPTIONS, lambda given: any(name.endswith(".urdf") for name in given.files), "without a URDF file"),
)


def manual() -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays qp, sns, rhc_foresight, dls and, where installed, pink and mink on a path as it is, retimed and with late drives,
and recommends one of them: docs/evaluation.md has the rule.

Examples:
  {PROGRAM} ur10.urdf circle.csv --tip tool0 --acceleration 8 --speed 0.1
  {PROGRAM} panda path.csv --dt 0.001
  {PROGRAM} weld.toml"""


def main(arguments: Sequence[str]) -> int:
    """The command line; returns the exit code."""
    return shell.run(lambda: _work(parse(Arguments, arguments, prog=PROGRAM, description=manual(), rules=RULES)))


def _work(given: Arguments) -> int:
    print(compare(given.chosen(), progress=True).table(shell.width()))
    return 0
