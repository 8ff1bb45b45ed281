"""The command ``ikgym compare``: which solver for an arm and a path."""

from __future__ import annotations

from collections.abc import Sequence

from baselines.cli import shell
from baselines.cli.own_path import RULES, OwnPath, scenario_of
from baselines.evaluation.compare.playing import compare


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays qp, sns, rhc_foresight, dls and, where installed, pink and mink on a path as it is, retimed and with late drives,
and recommends one of them: docs/evaluation.md has the rule.

Examples:
  {prog} arm.urdf weld.csv --tip tool0 --speed 0.2 --acceleration 5
  {prog} weld.csv --arm panda --speed 0.2 --dt 0.001
  {prog} weld.toml"""


def main(arguments: Sequence[str]) -> int:
    """The command line: a path, or a robot and a path, and options; returns the exit code."""
    words = list(arguments)
    if len(words) > 1 and not words[0].startswith("-") and not words[1].startswith("-"):
        words[:2] = [words[1], "--arm", words[0]]
    return shell.Command("compare", OwnPath, manual, _work, RULES)(words)


def _work(given: OwnPath, _: str) -> None:
    print(compare(scenario_of(given), reserve=given.reserve, progress=True).table(shell.width()))
