"""Training curves as a plot: ``python -m baselines.training.curves NAME=DIR … --write FILE``."""

from __future__ import annotations

import dataclasses
import pathlib
import sys
from collections.abc import Sequence
from typing import Annotated

import numpy as np
import tyro
from matplotlib.figure import Figure

from baselines.evaluation.plots import style
from baselines.files import write
from baselines.training.folder import read_run
from ikgym.exceptions import IkgymError, InvalidInputError

#: Ratios that span a larger factor are drawn on a logarithmic axis.
SPAN = 10.0


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command line."""

    runs: tyro.conf.Positional[Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=DIR")]]
    """Trainings: a name for each, and the folder of its seeds."""
    write: Annotated[pathlib.Path, tyro.conf.arg(metavar="FILE")]
    """The picture, a PNG."""


def curves(trainings: dict[str, pathlib.Path]) -> Figure:
    """Validation costs ÷ those of the untrained agents, over core-minutes, a line for each seed.

    Args:
        trainings: The folders of seeds by name.

    Raises:
        ResultsError: A `run.json` cannot be read.
        InvalidInputError: A folder has no runs.
    """
    drawn = style.figure(4.2)
    axes = drawn.add_subplot()
    handles = []
    for number, folder in enumerate(trainings.values()):
        files = sorted(folder.glob("seed-*/run.json"))
        if not files:
            raise InvalidInputError(f"{folder}: expected runs, seed-*/run.json; there is none.")
        for file in files:
            scores = read_run(file)["validation"]
            minutes, costs = [s["core_minutes"] for s in scores], np.array([s["cost"] for s in scores])
            (line,) = axes.plot(minutes, costs / costs[:1], lw=1.0, marker="o", ms=2.5, **style.looks(number))
        handles.append(line)
    shown = np.concatenate([line.get_ydata() for line in axes.lines])
    if shown.size and shown.max() > SPAN * shown.min():
        axes.set_yscale("log")
    style.dress(axes, ylabel="validation cost ÷ initial one", xlabel="core-minutes of training")
    style.legend(drawn, "Training: one line per seed", handles, list(trainings))
    return drawn


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line; the exit code is 0, or 2 after an error."""
    options = tyro.cli(
        Options,
        prog="python -m baselines.training.curves",
        description="Plots the validation costs of trainings over those of the untrained agents.",
        args=arguments,
    )
    pairs = [text.partition("=") for text in options.runs]
    try:
        if wrong := [text for text, pair in zip(options.runs, pairs, strict=True) if not all(pair)]:
            raise InvalidInputError(f"expected NAME=DIR, got {wrong[0]!r}.")
        trainings = {name: pathlib.Path(folder) for name, _, folder in pairs}
        write(options.write, style.small_png(curves(trainings)))
    except IkgymError as e:
        print(f"error: {' '.join(str(e).split())}", file=sys.stderr)
        return 2
    print(f"written to {options.write}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
