"""`ikgym tune` beside the published settings, which a search over grids found with as many episodes.

``python -m benchmarks.tuned --out DIR`` goes on with what is in DIR, and prints the table of docs/evaluation.md.
"""

from __future__ import annotations

import dataclasses
import pathlib

import numpy as np
import tyro

from baselines.evaluation.pages import sets, tuning
from baselines.evaluation.pages.markdown import between, table
from baselines.evaluation.pages.tuning import Tuned, Tuning
from baselines.evaluation.report import number
from baselines.files.locks import locked
from baselines.tuning import solvers
from baselines.tuning.study import Study, prepare, search
from ikgym import scenarios
from ikgym.validation import known_names

#: Episodes that neither search has seen: those of the split for validation behind the ones that were searched on.
OTHERS = 64
HEAD = (
    *("solver", "episodes played, each", "tried, published", "tried, Optuna", "cost, published", "cost, Optuna"),
    *("cost ratio on other episodes", "interval"),
)


@dataclasses.dataclass(frozen=True)
class Command:
    """Compares the search of settings with the published ones."""

    out: pathlib.Path = pathlib.Path("results/tuned")
    """Folder for the trials; those that are there are gone on with."""
    policies: tuple[str, ...] = ()
    """Solvers, as they stand in the published settings; all of them if left out."""
    seed: int = 0
    """Of what is suggested."""


def compared(command: Command, published: Tuning) -> list[str]:
    """Searches with the budget of the published search, and plays both settings on other episodes.

    Returns:
        The lines of a table.

    Raises:
        UnknownNameError: There are no published settings of a solver.
        ResultsError: The folder has another search.
    """
    by_spec = {one.spec: one for one in published.solvers}
    known_names("published solver", command.policies, by_spec)
    beside = [by_spec[spec] for spec in command.policies or by_spec]
    scenario = scenarios.get(published.scenario)
    studies = [_study(published, one, command.seed) for one in beside]
    with locked(command.out):
        prepare(command.out, studies, resume=True, overwrite=False)
        search(command.out, studies, workers=1, unit="episode", progress=True)
        found = solvers.result(command.out, studies, scenario, f"python -m benchmarks.tuned --out {command.out}")
        found.save(command.out / "tuned.json")
    rows = [_row(published, one, new, study) for one, new, study in zip(beside, found.solvers, studies, strict=True)]
    return table(HEAD, rows, text=(0,))


def _study(published: Tuning, one: Tuned, seed: int) -> Study[solvers.Cost]:
    (study,) = solvers.planned(
        scenarios.get(published.scenario),
        [one.spec],
        solvers.stated(),
        episodes=published.episodes,
        budget=one.tried * published.episodes,
        seed=seed,
    )
    return study


def _row(published: Tuning, one: Tuned, new: Tuned, study: Study[solvers.Cost]) -> list[str]:
    cost = study.objective
    seeds = scenarios.seeds(published.split, published.episodes + OTHERS)[published.episodes :]
    ratios = np.divide(cost.costs(new.settings, seeds), cost.costs(one.settings, seeds))
    mean = float(np.exp(np.log(ratios).mean()))
    counts = (one.tried * published.episodes, one.tried, new.tried)
    return [
        f"`{one.spec}`",
        *(f"{count:,}" for count in counts),
        *map(number, (one.tuned, new.tuned, mean)),
        between(ratios[None]),
    ]


if __name__ == "__main__":
    print(*compared(tyro.cli(Command), Tuning.load(tuning.file_of(sets.SKEW))), sep="\n")
