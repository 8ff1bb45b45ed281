"""The command line: ``python -m baselines.robustness``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, Any

import tyro

from baselines import command as shared
from baselines.evaluation.machine import describe
from baselines.evaluation.pages.robustness import measure
from baselines.evaluation.pages.robustness.measured import Measured
from baselines.evaluation.pages.robustness.page import drawn, page
from baselines.evaluation.plots.style import small_png
from baselines.evaluation.report import is_reference
from baselines.files import write
from baselines.files.locks import locked
from baselines.spec import parse_policy
from baselines.workers import Workers
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import imperfect
from ikgym.validation import known_name, known_names, number, whole_number

#: What the command is called where Python has run its module.
PROGRAM = "python -m baselines.robustness"
#: What is compared if nothing else is said.
POLICIES = ("dls", "rhc", "rhc_foresight", "told")


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the results. If left out nothing is played, and --write writes the page anew from what lies beside
    it."""
    write: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the page, such as docs; what was measured goes beside it as .json, pictures into images/. That of the
    results if left out."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = POLICIES
    """Policies as NAME or NAME:PARAMETER=VALUE,…, or LABEL@ one of these, which is called LABEL on the page."""
    scenario: Annotated[str, tyro.conf.arg(metavar="NAME|FILE.toml")] = imperfect.FIELD_NAME
    """Scenario of the map, whose plant stands for severity 1; of panda-field that is the worst one."""
    severities: Annotated[tuple[float, ...], tyro.conf.arg(metavar="S …")] = measure.SEVERITIES
    """Severities of knowledge and of drives, from 0. None for no map."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 4
    """Test episodes of each policy in each cell of the map."""
    mapped: Annotated[tuple[str, ...], tyro.conf.arg(metavar="LABEL …")] = ()
    """Policies of --policies that are on the map and play each part of the plant alone. All of them if left out."""
    sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets that are played to their ends, with an ideal plant beside each: panda-ideal panda-measured … for the
    tables. None if left out."""
    set_episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """The first episodes of each test set; all of them if left out."""
    whole: Annotated[tuple[str, ...], tyro.conf.arg(metavar="LABEL@SET …")] = ()
    """Policies of --policies that play all episodes of a test set of --sets, whatever --set-episodes says."""
    effects: bool = False
    """Measure what each part of the plant of --scenario costs alone, too; with --episodes episodes."""
    resume: bool = False
    """Continue with the results in the folder: what is done already is not done again."""
    overwrite: bool = False
    """Delete the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Play, and search best known costs, on a cluster: ray, at the address in RAY_ADDRESS."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Plays policies on imperfect plants: over two severities, what nobody knows of the arm (calibration, payload, camera) and
what its drives do (lag, delay), as a map; and on test sets, as tables.

Examples:
  {prog} --policies dls rhc told --out results/map
  {prog} --policies dls rhc told --out results/map --resume --write docs
  {prog} --severities --sets {" ".join(imperfect.SCENARIOS)} --out results/sets
  {prog} --severities --sets panda-bus --set-episodes 4 --whole told@panda-bus --out results/sets --resume
  {prog} --policies dls "mended@calibrated:policy=predicted,start=1e-5" --effects --out results/map
  {prog} --scenario lab.toml --severities 0 0.5 1 2 --episodes 8 --out results/lab
  {prog} --write docs

Files:
  DIR/SCENARIO/results.json, DIR/sets/results.json, DIR/effects/results.json   rows as those of evaluate
  robustness.md, robustness.json, images/*.png       the page, what it is made from, and its pictures"""


def measured(options: Options, command: str) -> Measured:
    """What the page is made from: played, or read from the file beside it.

    Raises:
        IkgymError: Something expected went wrong, see :func:`baselines.evaluation.pages.measure.play`.
    """
    if options.out is None:
        if options.write is None:
            raise InvalidInputError("Expected --out, where the results go, or --write, the folder of the page.")
        return Measured.load(options.write / "robustness.json")
    severities = sorted({number("severities", one, at_least=0.0) for one in options.severities})
    if not (severities or options.sets or options.effects):
        raise InvalidInputError("severities, sets, effects: expected one of them at least; got neither.")
    how: dict[str, Any] = {name: getattr(options, name) for name in ("resume", "overwrite")} | {
        "workers": Workers(options.workers, options.cluster),
        "progress": True,
    }
    policies = labelled(options.policies)
    place = options.scenario, some_of(policies, options.mapped), options.out
    sets = {"episodes": options.set_episodes, "whole": whole(options.whole, policies, options.sets), **how}
    entries = measure.entries(options.sets, policies, options.out, **sets) if options.sets else ()
    cells = measure.cells(*place, severities=severities, episodes=options.episodes, **how) if severities else ()
    effects = measure.effects(*place, episodes=options.episodes, **how) if options.effects else ()
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    references = tuple(label for label, policy in policies.items() if is_reference(parse_policy(policy)[0]))
    about = command, today, describe(), options.scenario, options.episodes, references
    return Measured(*about, entries, cells, policies, effects)


def labelled(policies: Sequence[str]) -> dict[str, str]:
    """What policies are called, and what they are.

    Raises:
        InvalidInputError: Two are called the same.
    """
    out: dict[str, str] = {}
    for given in policies:
        label, mark, policy = given.partition("@")
        if label in out:
            raise InvalidInputError(f"policies: expected a label of its own for each, got {label!r} twice.")
        out[label] = policy if mark else given
    return out


def some_of(policies: Mapping[str, str], labels: Sequence[str]) -> dict[str, str]:
    """The policies of some labels; all where none is given.

    Raises:
        UnknownNameError: There is no such label.
    """
    known_names("label", labels, policies)
    return {label: policies[label] for label in labels or policies}


def whole(given: Sequence[str], policies: Iterable[str], sets: Sequence[str]) -> frozenset[tuple[str, str]]:
    """Labels of policies, and the test sets that they play to their ends.

    Args:
        given: LABEL@SET, each.
        policies: All labels.
        sets: All test sets that are played.

    Raises:
        UnknownNameError: There is no such label, or the set is not played.
    """
    out = []
    for one in given:
        label, _, name = one.rpartition("@")
        known_name("label", label, policies)
        known_name("set among --sets", name, sets)
        out.append((label, name))
    return frozenset(out)


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    return shared.run_resumable(Options, arguments, shared.program("robustness", PROGRAM), manual, _work)


def _work(options: Options, command: str) -> None:
    if options.set_episodes is not None:
        whole_number("set_episodes", options.set_episodes, at_least=1)
    found = measured(options, command)
    folder = options.write or options.out or pathlib.Path()
    with locked(folder):
        found.save(folder / "robustness.json")
        for where, figure in drawn(found):
            write(folder / where, small_png(figure))
        write(folder / "robustness.md", page(found).encode())
    print(f"written to {folder / 'robustness.md'}")
