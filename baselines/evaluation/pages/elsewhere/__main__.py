"""The command line: ``python -m baselines.evaluation.pages.elsewhere``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
import sys
from typing import Annotated

import tyro
from tqdm import tqdm

from baselines import command as shared
from baselines.evaluation.machine import describe
from baselines.evaluation.pages.elsewhere.page import page
from baselines.evaluation.pages.elsewhere.played import Measured, everybody, run
from baselines.files import write
from baselines.files.locks import locked
from ikgym import problems
from ikgym.validation import whole_number

PROGRAM = "python -m baselines.evaluation.pages.elsewhere"
MANUAL = "Plays policies on the problems that others published, and writes docs/elsewhere.md and docs/elsewhere.json."
# Runs between two times that everything is written.
KEPT = 20


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder of the page, such as docs."""
    measure: bool = False
    """Play; if left out the page is written anew from what lies beside it."""
    paths: Annotated[int, tyro.conf.arg(metavar="N")] = problems.RANDOM
    """Random paths for policies that take long, the first ones; everybody else plays all of them."""
    resume: bool = False
    """Keep what was measured already."""


def work(options: Options) -> int:
    """Measures, if that is asked for, and writes the page.

    Raises:
        IkgymError: Something expected went wrong.
    """
    file = options.out / "elsewhere.json"
    with locked(options.out):
        if options.measure:
            _measure(file, whole_number("paths", options.paths, at_least=0), resume=options.resume)
        write(file.with_suffix(".md"), page(Measured.load(file)).encode())
    print(f"written to {file.with_suffix('.md')}")
    return 0


def _measure(file: pathlib.Path, paths: int, *, resume: bool) -> None:
    found = {(one.problem, one.who): one for one in (Measured.load(file).runs if resume else ())}
    wanted = list(everybody(paths))
    todo = [both for both in wanted if both not in found]
    command = f"{PROGRAM} --out docs --measure" + ("" if paths == problems.RANDOM else f" --paths {paths}")
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    for number, both in enumerate(tqdm(todo, unit="run"), 1):
        found[both] = run(*both)
        if number % KEPT == 0 or number == len(todo):
            Measured(command, today, describe(), tuple(found[key] for key in wanted if key in found)).save(file)


if __name__ == "__main__":
    given = shared.parse(Options, sys.argv[1:], prog=PROGRAM, description=MANUAL)
    sys.exit(shared.run(lambda: work(given), lambda: f"Stopped; go on with --resume, see {given.out}."))
