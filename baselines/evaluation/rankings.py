"""Comparisons in a folder of results: policies ranked by cost ratio, and a map over severities of the plant."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterable, Sequence

from tqdm import tqdm

from baselines.evaluation.columns import CELLS
from baselines.evaluation.jobs import Job
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots import comparison
from baselines.evaluation.plots.style import png
from baselines.evaluation.results import slug
from baselines.evaluation.summary import rank
from baselines.evaluation.table import markdown, to_csv
from baselines.files import write
from baselines.oracle import Search
from baselines.oracle.several import SearchJob, find_all

#: The search for best known costs that are not recorded: on these paths all starts find the same optimum.
HOW = Search(starts=20, generations=0)


def write_ranking(out: pathlib.Path, rows: Iterable[Row], policies: Sequence[str]) -> None:
    """Writes table.csv, table.md, and a plot of cost against time for each scenario."""
    lines = rank(rows, policies)
    write(out / "table.csv", to_csv(lines).encode())
    write(out / "table.md", f"{markdown(lines)}\n".encode())
    for scenario, here in lines.groupby("scenario", sort=False):
        write(out / f"cost-time-{slug(str(scenario))}.png", png(comparison.cost_time(here, str(scenario))))


def write_map(out: pathlib.Path, rows: Sequence[Row], jobs: Sequence[Job], policies: Sequence[str]) -> None:
    """Writes map.csv, map.md and map.png; best known costs that are not recorded are searched and cached."""
    jobs_by_key = {job.key: job for job in jobs}
    missing = {(row.scenario, row.seed): jobs_by_key[row.key] for row in rows if row.cost_ratio is None}
    wanted = [SearchJob(job.scenario, job.seeds._replace(noise_seed=0), HOW) for job in missing.values()]
    found = {
        (one.scenario.name, one.draw.seed): optimum.cost
        for one, optimum in tqdm(find_all(wanted), total=len(wanted), unit="best known cost")
    }
    scored = [
        dataclasses.replace(row, cost_ratio=row.cost_ratio or row.total_cost / found[row.scenario, row.seed])
        for row in rows
    ]
    lines = rank(scored, policies)
    places = lines.scenario.str.rsplit(" ", n=2)
    lines.insert(1, "knowledge", [float(words[1]) for words in places])
    lines.insert(2, "drives", [float(words[2]) for words in places])
    write(out / "map.csv", to_csv(lines).encode())
    write(out / "map.md", f"{markdown(lines, CELLS)}\n".encode())
    write(out / "map.png", png(comparison.severity_map(lines)))
