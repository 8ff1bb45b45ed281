"""The command line: ``python -m baselines.pareto``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
import shlex
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from baselines.evaluation import test_sets
from baselines.evaluation.machine import describe
from baselines.evaluation.pareto.contenders import HORIZONS, SEEDS, contenders
from baselines.evaluation.pareto.measure import fixed, measure
from baselines.evaluation.pareto.page import page, pictures
from baselines.evaluation.pareto.points import Measurement
from baselines.evaluation.plots.style import small_png
from baselines.files import write
from ikgym.exceptions import IkgymError, InvalidInputError


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the results. If left out nothing is played, and --write draws up the page from what lies beside it."""
    write: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The page, such as docs/pareto.md; what was measured goes beside it as .json, plots into images/. DIR/pareto.md if
    left out."""
    sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Test sets and scenarios. If left out all test sets, and the fixed scenarios but for those that hold their
    points."""
    episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """The first so many episodes of each set, for trials."""
    quick: bool = False
    """A trial: one test set and one scenario, two episodes, short horizons, one seed of each policy."""
    resume: bool = False
    """Go on with the results in the folder: what is done already is not done again."""
    overwrite: bool = False
    """Throw away the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play what is not timed. What is timed is played in one, after that."""


MANUAL = """\
Plays all policies, the receding horizon by horizon and effort, and its presets; writes who is worth what time.

Examples:
  python -m baselines.pareto --out results/pareto --workers 2 --write docs/pareto.md
  python -m baselines.pareto --out results/quick --quick
  python -m baselines.pareto --write docs/pareto.md

Files:
  DIR/SET/results.json  rows as python -m baselines.evaluate has them
  FILE.md               how to choose, plots and tables
  FILE.json             what they are made from
  images/pareto-*.png   the plots, beside FILE.md"""

#: The horizons of a quick trial.
SHORT = (3, 10, 30)


def measured(options: Options, command: str) -> Measurement:
    """Plays what the options ask for.

    Raises:
        IkgymError: Something expected went wrong, see :func:`baselines.evaluation.pareto.measure.measure`.
    """
    if options.out is None:
        if options.write is None:
            raise InvalidInputError("Expected --out, where the results go, or --write, the page to be drawn up again.")
        written = Measurement.load(options.write.with_suffix(".json"))
        if changed := [one.name for one in written.sets if one.stale]:
            raise InvalidInputError(f"{', '.join(changed)}: changed since it was measured; measure again with --out.")
        return written
    usual = ("varga7-random", "varga7-fast") if options.quick else (*test_sets.names(), *fixed())
    everyone = contenders(
        SHORT if options.quick else HORIZONS,
        seeds=SEEDS[:1] if options.quick else SEEDS,
    )
    sets = [
        measure(
            name,
            everyone,
            options.out,
            episodes=2 if options.quick and options.episodes is None else options.episodes,
            workers=options.workers,
            resume=options.resume,
            overwrite=options.overwrite,
            progress=True,
        )
        for name in options.sets or usual
    ]
    date = datetime.datetime.now(datetime.UTC).date().isoformat()
    return Measurement(command, date, describe(), tuple(sets))


def draw_up(measurement: Measurement, file: pathlib.Path) -> None:
    """Writes the page, its plots, and what they are made from.

    Raises:
        ResultsError: A file cannot be written.
    """
    measurement.save(file.with_suffix(".json"))
    for place, figure in pictures(measurement):
        write(file.parent / place, small_png(figure))
    write(file, page(measurement).encode())


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    options = tyro.cli(Options, prog="python -m baselines.pareto", description=MANUAL, args=arguments)
    file = options.write or (options.out or pathlib.Path()) / "pareto.md"
    try:
        draw_up(measured(options, shlex.join(["python", "-m", "baselines.pareto", *arguments])), file)
    except IkgymError as e:
        print(f"error: {' '.join(str(e).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"\nStopped. What was finished is in {options.out}; go on with --resume.", file=sys.stderr)
        return 130
    print(f"written to {file}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
