"""The command line: ``python -m baselines.leaderboard``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
import shlex
import sys
from collections.abc import Sequence
from typing import Annotated

import tyro

from baselines.evaluation.leaderboard import places
from baselines.evaluation.leaderboard.board import Board
from baselines.evaluation.leaderboard.entries import FORESIGHT, HORIZONS, Entry, agents, solvers
from baselines.evaluation.leaderboard.measure import measure
from baselines.evaluation.leaderboard.page import page, pictures
from baselines.evaluation.leaderboard.tuning import DATA, EPISODES, Tuning, tune
from baselines.evaluation.machine import describe
from baselines.evaluation.markdown import table
from baselines.evaluation.plots.style import small_png
from baselines.evaluation.report import number
from baselines.files import write
from ikgym.exceptions import IkgymError, InvalidInputError


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    out: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Folder for the results. If left out nothing is played, and --write draws up the page from what lies beside it."""
    write: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The page, such as docs/leaderboard.md; what was measured goes beside it as .json, plots into images/.
    DIR/leaderboard.md if left out."""
    agents: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=DIR …")] = ()
    """Agents: what to call each, and the folder of its training seeds, with DIR/seed-N/agent.safetensors and
    DIR/seed-N/run.json."""
    tune: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """Search the settings of all solvers on validation episodes, and write them here; nothing else is done. The
    leaderboard reads baselines/data/tuned.json."""
    episodes: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """The first so many episodes of each set, or of the search, for trials."""
    quick: bool = False
    """A trial: some solvers, two episodes."""
    resume: bool = False
    """Go on with the results in the folder: what is done already is not done again."""
    overwrite: bool = False
    """Throw away the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play what is not timed. What is timed is played in one, after that."""


MANUAL = """\
Plays trained agents and all solvers on the test set and beside it, and writes the leaderboard.

Examples:
  python -m baselines.leaderboard --tune baselines/data/tuned.json
  python -m baselines.leaderboard --out results/leaderboard --agents "PPO=results/ppo" --write docs/leaderboard.md
  python -m baselines.leaderboard --out results/quick --quick
  python -m baselines.leaderboard --write docs/leaderboard.md

Files:
  DIR/SET/results.json        rows as python -m baselines.evaluate has them
  FILE.md                     what the numbers say, tables and plots
  FILE.json                   what they are made from
  images/leaderboard-*.png    the plots, beside FILE.md"""

#: Who plays in a quick trial.
QUICK = ("dls", "mfac", "rhc_gradient", *HORIZONS[:2], FORESIGHT)


def measured(options: Options, command: str, tuning: Tuning) -> Board:
    """Plays what the options ask for.

    Raises:
        IkgymError: Something expected went wrong, see :func:`baselines.evaluation.leaderboard.measure.measure`.
    """
    if options.out is None:
        if options.write is None:
            raise InvalidInputError(
                "Expected --out, where the results go, --write, the page to be drawn up again, or --tune."
            )
        if options.agents:
            raise InvalidInputError("--agents are played: expected --out, where the results go.")
        written = Board.load(options.write.with_suffix(".json"))
        if changed := [one.name for one in written.sections if one.stale]:
            raise InvalidInputError(f"{', '.join(changed)}: changed since it was measured; measure again with --out.")
        return written
    everyone = [*agents(options.agents), *_solvers(options, tuning)]
    sections = [
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
        for name in places.names()
    ]
    return Board(command, _today(), describe(), tuple(sections))


def draw_up(board: Board, tuning: Tuning, file: pathlib.Path) -> None:
    """Writes the page, its plots, and what they are made from.

    Raises:
        ResultsError: A file cannot be written.
        MissingDependencyError: There is no scipy.
    """
    board.save(file.with_suffix(".json"))
    for place, figure in pictures(board):
        write(file.parent / place, small_png(figure))
    write(file, page(board, tuning).encode())


def search(options: Options, command: str, file: pathlib.Path) -> str:
    """Searches settings, writes them, and returns them as a table.

    Raises:
        IkgymError: Something expected went wrong, see :func:`baselines.evaluation.leaderboard.tuning.tune`.
    """
    found = tune(command, _today(), episodes=options.episodes or EPISODES, workers=options.workers, progress=True)
    found.save(file)
    lines = [
        [one.spec, *map(number, (one.default, one.tuned, one.tuned / one.default)), str(dict(one.settings))]
        for one in found.solvers
    ]
    return "\n".join(table(["solver", "as it is", "tuned", "ratio", "settings"], lines, text=(0, 4)))


def _solvers(options: Options, tuning: Tuning) -> list[Entry]:
    everyone = solvers(tuning.solvers)
    return [entry for entry in everyone if entry.name in QUICK] if options.quick else list(everyone)


def _today() -> str:
    return datetime.datetime.now(datetime.UTC).date().isoformat()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code: 0, 2 where something expected went wrong, 130 after Ctrl-C.
    """
    arguments = sys.argv[1:] if arguments is None else list(arguments)
    options = tyro.cli(Options, prog="python -m baselines.leaderboard", description=MANUAL, args=arguments)
    command = shlex.join(["python", "-m", "baselines.leaderboard", *arguments])
    file = options.write or (options.out or pathlib.Path()) / "leaderboard.md"
    try:
        if options.tune is not None:
            print(search(options, command, options.tune))
            file = options.tune
        else:
            tuning = Tuning.load(DATA)
            draw_up(measured(options, command, tuning), tuning, file)
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
