"""The best known costs, ``ikgym oracle``."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator, Sequence
from typing import Annotated

import tyro
from tqdm import tqdm

from baselines.cli import shell
from baselines.cli.parsing import Rule
from baselines.episodes import Seeds
from baselines.evaluation import test_sets as known_sets
from baselines.oracle import best_known
from baselines.oracle.cache import VARIABLE
from baselines.oracle.optimum import Optimum, Search
from baselines.oracle.several import SearchJob, check_policies, find_all
from baselines.oracle.stripped import NOTE, strips
from baselines.workers import ALONE, Workers
from ikgym import scenarios as scenario_registry
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import whole_number

#: A scenario, and which of its episodes is meant.
SeededScenario = tuple[Scenario, Seeds]


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command line."""

    scenarios: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of scenarios. If neither scenarios nor test sets are given: all fixed scenarios and all test sets."""
    test_sets: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME …")] = ()
    """Names of test sets."""
    seeds: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = ()
    """Reset seeds of the random scenarios."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ()
    """Policies whose paths are further starts, as NAME or NAME:PARAMETER=VALUE,…, such as those that beat a record."""
    search: Annotated[Search, tyro.conf.arg(name="")] = dataclasses.field(default_factory=Search)
    """Settings of the search."""
    cache: bool = True
    """Read optima from the cache on disk, and write new ones to it."""
    update: bool = False
    """Save optima that are better than the records, or have no record."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Search on a cluster: ray, at the address in RAY_ADDRESS, a core for each episode."""


RULES = (
    Rule(("--chains", "--rounds"), lambda given: given.search.generations > 0, "with --generations 0"),
    Rule(
        ("--knots", "--seed"),
        lambda given: given.search.starts + given.search.generations > 0,
        "with --starts 0 --generations 0",
    ),
)


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Searches the cheapest joint paths of whole episodes from many starts, and keeps their costs as records:
cost ratio = cost / best known cost. A record is not proven to be the minimum.

{shell.listing("Scenarios", scenario_registry.names())}

{shell.listing("Test sets", known_sets.names())}

Examples:
  {prog} --scenarios varga7-fast
  {prog} --scenarios varga7-random --seeds 1000000 1000001 --starts 1000
  {prog} --update
  {prog} --scenarios varga7-fast --policies rhc_foresight --update
  {prog} --test-sets panda-clutter-random --policies rhc_foresight --starts 10 --generations 0 --polished 1

Among bodies, paths of policies replace the receding horizons of the search and the roll-out.

A line for each episode has: its cost and the kind of start that led to it; the norm of the gradient in [s/rad] or
[s/m]; the number of paths at full resolution within a millionth of the cost; the number of random starts within 1 % of
the best before the local search, with their median and worst cost; the CPU time of one path at full resolution.

If the plant is not ideal, drives and sensors are left out: the best known cost is that of the true arm, with ideal
drives and sensors. The search uses an ideal plant, and its path is polished on the true arm.

Optima are cached in the user's cache folder, or in the folder of the environment variable {VARIABLE}. Optima
found before Ctrl-C are kept."""


def episodes(scenarios: Sequence[str], test_sets: Sequence[str], seeds: Sequence[int]) -> list[SeededScenario]:
    """The episodes to be searched; seeds are those of the random scenarios.

    If nothing is named: all fixed scenarios and all sets, except those with collisions: a search there takes minutes.
    """
    named = [scenario_registry.get(name) for name in scenarios]
    drawn = any(map(_is_drawn, named))
    if bool(seeds) != drawn:
        raise InvalidInputError(
            "seeds: expected some for the random scenarios, got none."
            if drawn
            else "seeds: expected none, since no random scenario is named."
        )
    for seed in seeds:
        whole_number("seeds", seed, at_least=0)
    if not (scenarios or test_sets):
        every = map(scenario_registry.get, scenario_registry.names())
        named = [scenario for scenario in every if not (_is_drawn(scenario) or scenario.collides)]
        test_sets = [name for name in known_sets.names() if not known_sets.get(name).scenario.collides]
    out = [(scenario, Seeds(seed)) for scenario in named for seed in (seeds if _is_drawn(scenario) else (0,))]
    for one in map(known_sets.get, test_sets):
        out += [(one.scenario, Seeds(seed, one.arm_seed(seed))) for seed in one.seeds]
    return out


def _is_drawn(scenario: Scenario) -> bool:
    """Whether the trajectories or the arms of episodes differ, and so their best known costs."""
    return scenario.random or scenario.plant.draws_arm


def optima(
    todo: Sequence[SeededScenario], how: Search, policies: Sequence[str] = (), *, cache: bool, workers: Workers = ALONE
) -> Iterator[tuple[Scenario, Optimum]]:
    """Searches episodes, with a bar on stderr, and yields each as soon as it is done."""
    wanted = [SearchJob(scenario, draw, how, tuple(policies), cache) for scenario, draw in todo]
    check_policies(wanted)
    look, pause = "{percentage:3.0f}% |{bar}| {elapsed}<{remaining}", 0.1 if sys.stderr.isatty() else 10.0
    with tqdm(total=len(todo), dynamic_ncols=True, bar_format=look, mininterval=pause) as bar:
        found = find_all(wanted, workers, lambda _, share: bar.update(share))
        for number, (one, optimum) in enumerate(found, 1):
            bar.update(number - bar.n)
            bar.clear()
            yield one.scenario, optimum


def line(optimum: Optimum, note: str = "") -> str:
    """The printed line of an episode; a note follows its cost."""
    spread = optimum.spread
    parts = [
        f"{optimum.scenario}, seed {optimum.seed}: {optimum.cost:.10g}{note and f' {note}'} by {optimum.found_by}",
        f"gradient {optimum.gradient_norm:.1e}",
        f"{spread['polished_within_1e-6']:.0f} of {spread['polished']:.0f} paths within 1e-6",
    ]
    if "starts" in spread:
        parts.append(
            f"{spread['within_1_percent']:.0f} of {spread['starts']:.0f} starts within 1 % "
            f"(median {spread['median']:.4g}, worst {spread['worst']:.4g})"
        )
    return "; ".join([*parts, f"{optimum.seconds:.2f} s a path"])


def _work(options: Options, _: str) -> None:
    kept, todo = 0, episodes(options.scenarios, options.test_sets, options.seeds)
    workers = Workers(cluster=options.cluster)
    for scenario, optimum in optima(todo, options.search, options.policies, cache=options.cache, workers=workers):
        print(line(optimum, NOTE if strips(scenario) else ""), flush=True)
        if options.update:
            kept += len(best_known.record([optimum.record()]))
    if options.update:
        print(f"{kept} of {len(todo)} records are new or better: {best_known.DATA.name}")


main = shell.Command("oracle", Options, manual, _work, RULES, "Optima that were found are kept.")
