"""The command line of ``ikgym tune``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
from typing import Annotated

import tyro

from baselines.cli import shell
from baselines.cli.parsing import Count, SeedOption
from baselines.files import locked, write_json
from baselines.fingerprints import fingerprint
from baselines.workers import MOST
from ikgym import scenarios
from ikgym.frozen import Frozen
from ikgym.validation import Bounds


@dataclasses.dataclass(frozen=True, kw_only=True)
class Options(Frozen):
    """Options of the command."""

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")]
    """A scenario: its name, FILE.toml, or MODULE:ATTRIBUTE."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ()
    """Solvers as NAME or NAME:PARAMETER=VALUE,…; if left out, all with ranges that suit the scenario."""
    ranges: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.toml")] = None
    """Further ranges, by solver and parameter; they take precedence over those that come with the solvers."""
    episodes: Count = 64
    """Episodes of a trial that is not pruned: the first seeds of the validation split."""
    trials: Count = 100
    """Trials of each solver, pruned ones included."""
    seed: SeedOption = 0
    """Seed of Optuna's sampler."""
    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the trials, and for tuned.json."""
    workers: Annotated[int, tyro.conf.arg(metavar="N"), Bounds(at_least=1, at_most=MOST)] = 1
    """Processes that play trials at the same time. With several, the result depends on their order."""
    resume: bool = False
    """Continue with the trials in the folder."""
    overwrite: bool = False
    """Replace the trials in the folder."""


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Searches the settings of solvers with the lowest geometric mean of the total cost, by Optuna (tree-structured Parzen
estimator), on validation episodes. Trials that are worse than the median of earlier ones are pruned (median pruner).

Examples:
  {prog} --scenario varga7-random --policies dls rhc:horizon=3 --out results/tune
  {prog} --scenario varga7-random --out results/tune --workers 4 --resume

Files:
  DIR/study.journal   all trials, for Optuna (JournalStorage) and for --resume
  DIR/tuned.json      the best settings"""


def _work(options: Options, text: str) -> None:
    from baselines import tuning  # imports Optuna, an extra

    scenario = scenarios.find(options.scenario)
    wanted = tuning.searches(scenario, options.policies, options.ranges, episodes=options.episodes, seed=options.seed)
    flags = {"resume": options.resume, "overwrite": options.overwrite}
    with locked(options.out):
        found = tuning.run(options.out, wanted, options.trials, workers=options.workers, **flags)
        about = {"command": text, "date": datetime.datetime.now(datetime.UTC).date().isoformat()}
        about |= {"scenario": scenario.name, "fingerprint": fingerprint(scenario)}
        about |= {"split": tuning.SPLIT}
        write_json(options.out / "tuned.json", {**about, "episodes": options.episodes, "solvers": found})
    for one in found:
        ratio = one["tuned"] / one["default"]
        print(f"{one['spec']}: {ratio:.4g} times the cost of its defaults, {one['tried']} tried: {one['settings']}")
    print(f"\nwritten to {options.out}")


main = shell.Command("tune", Options, manual, _work, kept=shell.RESUMED)
