"""Maps the cost of policies over two severities of an imperfect plant: ``ikgym robustness``."""

from __future__ import annotations

import dataclasses
import itertools
import pathlib
from collections.abc import Mapping, Sequence
from typing import Annotated

import tyro
from tqdm import tqdm

from baselines.cli import shell
from baselines.cli.commands.evaluate import ONE_KIND
from baselines.cli.parsing import if_random
from baselines.evaluation import records
from baselines.evaluation.metrics import Row
from baselines.evaluation.results import Rows
from baselines.evaluation.run import evaluate
from baselines.files import write
from baselines.oracle import Search
from baselines.oracle.several import Wanted, find_all
from baselines.recording import Seeds
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario, imperfect
from ikgym.validation import number

#: The search for best known costs that are not recorded: on these paths all starts find the same optimum.
HOW = Search(starts=20, generations=0)


@dataclasses.dataclass(frozen=True)
class Options:
    """Options of the command line."""

    out: Annotated[pathlib.Path, tyro.conf.arg(metavar="DIR")]
    """Folder for the results, the table and the map."""
    policies: Annotated[tuple[str, ...], tyro.conf.arg(metavar="POLICY …")] = ("qp", "rhc", "rhc_foresight", "told")
    """Policies as those of evaluate."""
    scenario: Annotated[str, tyro.conf.arg(metavar="NAME|FILE.toml")] = imperfect.FIELD_NAME
    """Scenario whose plant has severity 1; of panda-field that is the worst one."""
    severities: Annotated[tuple[float, ...], tyro.conf.arg(metavar="S …")] = (0.0, 0.25, 0.5, 0.75, 1.0)
    """Severities, from 0, of unknown properties (calibration, payload, camera) and of the drives (lag, delay)."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 4
    """Test episodes of each policy in each cell of the map."""
    resume: bool = False
    """Continue with the results in the folder."""
    overwrite: bool = False
    """Replace the results in the folder."""
    workers: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Processes that play episodes."""
    cluster: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Play on a cluster: ray, at the address in RAY_ADDRESS."""


RULES = (ONE_KIND, if_random("--episodes"))


def manual(prog: str) -> str:
    """The text of ``--help`` above the options."""
    return f"""\
Maps the cost ratio of policies over two severities of an imperfect plant: of unknown properties (calibration, payload,
camera), and of the drives (lag, delay). Test sets of imperfect plants: ikgym leaderboard --test-sets panda-field …

Examples:
  {prog} --policies qp rhc told --out results/map
  {prog} --scenario lab.toml --severities 0 0.5 1 2 --episodes 8 --out results/lab

Files in DIR, besides those of evaluate:
  map.csv, map.md, map.png"""


def at(name: str, knowledge: float, drives: float) -> Scenario:
    """The scenario with its plant at two severities: of calibration, payload and camera; of lag and delay."""
    base = scenarios.find(name)
    if base.plant.ideal:
        raise InvalidInputError(f"Scenario {base.name!r}: expected a plant that is not ideal.")
    scaled = (
        imperfect.field(knowledge, drives)
        if name == imperfect.FIELD_NAME
        else base.replace(plant=base.plant.scaled(knowledge, drives))
    )
    return scaled.replace(name=f"{base.name} {knowledge:g} {drives:g}")


def with_cost_ratios(rows: Rows, places: Mapping[str, Scenario]) -> list[Row]:
    """The rows with their cost ratios; best known costs that are not recorded are searched and cached."""
    missing = {(row.scenario, row.seed): None for row in rows if row.cost_ratio is None}
    wanted = [Wanted(places[name], Seeds(seed), HOW) for name, seed in missing]
    found = {}
    for one, optimum in tqdm(find_all(wanted), total=len(wanted), unit="best known cost"):
        found[one.scenario.name, one.draw.seed] = optimum.cost
    return [
        row
        if row.cost_ratio is not None
        else dataclasses.replace(row, cost_ratio=row.total_cost / found[row.scenario, row.seed])
        for row in rows
    ]


def _work(options: Options, _: str) -> None:
    severities = sorted({number("severities", one, at_least=0.0) for one in options.severities})
    by_place = {place: at(options.scenario, *place) for place in itertools.product(severities, severities)}
    rows = evaluate(
        tuple(by_place.values()),
        options.policies,
        episodes=options.episodes,
        out=options.out,
        resume=options.resume,
        overwrite=options.overwrite,
        workers=options.workers,
        cluster=options.cluster,
        report=False,
        progress=True,
    )
    places = {scenario.name: place for place, scenario in by_place.items()}
    scored = with_cost_ratios(rows, {scenario.name: scenario for scenario in by_place.values()})
    lines = []
    for line in records.records(scored, options.policies):
        knowledge, drives = places[line["scenario"]]
        lines.append({"policy": line.pop("policy"), "knowledge": knowledge, "drives": drives, **line})
    _write(options.out, lines)
    print(f"written to {options.out}")


def _write(out: pathlib.Path, lines: Sequence[records.Record]) -> None:
    from baselines.evaluation.plots.comparison import severity_map
    from baselines.evaluation.plots.style import png

    columns = ("policy", "knowledge", "drives", "episodes", "cost_ratio", "low", "worst", "lost_percent")
    text = records.markdown(lines, columns)
    write(out / "map.csv", records.to_csv(lines).encode())
    write(out / "map.md", f"{text}\n".encode())
    write(out / "map.png", png(severity_map(lines)))
    print(text)


main = shell.Command("robustness", Options, manual, _work, RULES, shell.RESUMED)
