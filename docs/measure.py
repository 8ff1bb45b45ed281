"""Measures tables of `docs/results`: ``python -m docs.measure cost_time periods``.

A table with a module of its name in this folder is what its `measure` returns; a new one begins as an empty CSV file.
Others say by their lines what is played: scenario, policy, episodes, noise seeds and seeds. Where `policy` is a label,
the column `spec` has what is played. To add a policy, add a line with these columns; --new measures those
alone. Each policy is timed in two episodes, on one core: times compare within one run on an idle machine. A killed
measurement continues. Trained agents are read from ``runs/NAME/seed-*``; a line whose scenario or agent is missing here
stays as it is. Then ``python -m docs.tables`` and ``python -m docs.pictures`` write the pages.
"""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import itertools
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro

import ikgym
from baselines import registry
from baselines.evaluate import evaluate
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots.comparison import front
from baselines.evaluation.summary import LOWEST, rank
from baselines.evaluation.table import records
from baselines.files import canonical, jsonable
from baselines.registry import parse_policy
from docs.keeping import PAGES, RESULTS, RUNS, WORK, Line, keep, lines, resumable


@dataclasses.dataclass(frozen=True)
class Command:
    """Measures tables of docs/results anew."""

    tables: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Names of CSV files without their end, such as cost_time or drift."""
    new: bool = False
    """Measure only lines without a result."""
    bench: Path | None = None
    """Folder of the arm with masses that the table `drives` is measured on, see :mod:`docs.drives`."""


def measure_lines(name: str, *, only_new: bool = False) -> list[Line]:
    """The lines of a table, scenario by scenario, from low to high cost ratios."""
    old = lines(name)
    groups = itertools.groupby(old, lambda line: line["scenario"])
    out = itertools.chain(*(_group(name, list(here), only_new) for _, here in groups))
    return [{column: line.get(column) for column in old[0]} for line in out]


def _group(name: str, old: list[Line], only_new: bool) -> list[Line]:
    """The lines of one scenario; all of them, if one is new and costs are relative to the lowest in the table."""
    todo = [line for line in old if not (only_new and (line.get("cost_ratio") or line.get("error_mm")))]
    if todo and any(line.get("relative_to") == LOWEST for line in old):
        todo = old
    scenario = _scenario(old[0])
    todo = [line for line in todo if scenario is not None and policies(line)]
    left = [line for line in old if line not in todo]
    if left and not only_new:
        where = old[0]["scenario"]
        print(f"{name}, {where}: {', '.join(one['policy'] for one in left)}: as before", file=sys.stderr)
    out = list(left)
    for conditions in sorted({_conditions(line) for line in todo}):
        some = {_spec(line): line for line in todo if _conditions(line) == conditions}
        played = [policy for line in some.values() for policy in policies(line)]
        episodes, noise_seeds = conditions
        folder = f"{name}-{old[0]['scenario']}-{episodes}-{noise_seeds}"
        rows = evaluate(scenario, played, episodes=episodes, noise_seeds=noise_seeds, **resumable(folder))
        if rows.skipped:  # its line would be lost, or lack a seed
            raise SystemExit("\n".join(f"{one.policy} in {one.scenario}: {one.reason}" for one in rows.skipped))
        for one in records(rank(rows, list(some))):
            line = some[one["policy"]]
            out.append(line | one | {"policy": line["policy"]} | (_errors(line, rows) if "error_mm" in line else {}))
    if "front" in old[0]:
        best = front(out)
        out = [{**line, "front": "yes" if line in best else "no"} for line in out]
    return sorted(out, key=lambda line: float(line.get("cost_ratio") or 0.0))


def _spec(line: Line) -> str:
    return line.get("spec") or line["policy"]


def _conditions(line: Line) -> tuple[int, int]:
    """Episodes and noise seeds."""
    return int(line["episodes"]), int(line.get("noise_seeds") or 1)


def _scenario(line: Line) -> ikgym.Scenario | None:
    """The scenario of a line, with its control period, if it says one; None where there is no such scenario."""
    name = line["scenario"].partition(" at ")[0]
    if name not in ikgym.scenarios.names():
        return None
    usual = ikgym.scenarios.get(name)
    if "period_ms" not in line:
        return usual
    dt = 1e-3 * float(line["period_ms"])
    return usual.replace(name=line["scenario"], dt=dt, steps=round(usual.steps * usual.dt / dt))


def _errors(line: Line, rows: Sequence[Row]) -> Line:
    """The largest errors of a policy; none of agents and of several seeds."""
    if len(policies(line)) != 1 or not registry.known(_spec(line).partition(":")[0]):
        return {"error_mm": None, "error_mrad": None}
    name, given = parse_policy(_spec(line))
    parameters = canonical(jsonable(registry.make(name, _scenario(line), **given).parameters))
    alike = [row for row in rows if row.policy == name and canonical(row.parameters) == parameters]
    largest = (max(getattr(row, f"{kind}_error_max") for row in alike) for kind in ("position", "orientation"))
    return {name: 1e3 * error for name, error in zip(("error_mm", "error_mrad"), largest, strict=True)}


def policies(line: Line) -> list[str]:
    """The policies whose results make a line: one, or one for each seed; none where an agent is missing."""
    name, seeds = _spec(line), int(line.get("seeds") or 1)
    if not registry.known(name.partition(":")[0]):
        return [f"agent:{file}" for file in sorted((RUNS / name).glob("seed-*/agent.safetensors"))]
    if seeds == 1:
        return [name]
    return [f"{name}{',' if ':' in name else ':'}seed={seed}" for seed in range(seeds)]


def table_of(name: str, *, only_new: bool = False, bench: Path | None = None) -> list[Line]:
    """A table: that of the module `docs.NAME` where there is one, else by the lines of its CSV file.

    Raises:
        SystemExit: There is no such table, or it is measured as a whole, and new lines alone were asked for.
    """
    if not (RESULTS / f"{name}.csv").is_file():
        available = ", ".join(sorted(file.stem for file in RESULTS.glob("*.csv")))
        raise SystemExit(f"tables: expected names of tables, got {name!r}; available: {available}.")
    if not (PAGES / f"{name}.py").is_file():
        return measure_lines(name, only_new=only_new)
    measure = importlib.import_module(f"docs.{name}").measure
    if "only_new" in inspect.signature(measure).parameters:
        return list(measure(only_new=only_new))
    if only_new:
        raise SystemExit(f"{name}: this table is measured as a whole; leave --new out.")
    return list(measure(bench) if "bench" in inspect.signature(measure).parameters else measure())


def main(command: Command) -> None:
    """Writes the tables."""
    for name in command.tables:
        keep(name, table_of(name, only_new=command.new, bench=command.bench))
        for folder in WORK.glob(f"{name}-*"):  # or the next measurement would have these times
            shutil.rmtree(folder)


if __name__ == "__main__":
    main(tyro.cli(Command))
