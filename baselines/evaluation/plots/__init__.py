"""The plots of a folder of results: matplotlib without pyplot, so that no window system is asked for."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Iterator

from matplotlib.figure import Figure
from tqdm import tqdm

from baselines.canonical import canonical
from baselines.evaluation.metrics import Row
from baselines.evaluation.plots import cost_time, joints, style, tracking
from baselines.evaluation.report import OVERVIEW, Pictures, by_scenario, is_reference, labels
from baselines.evaluation.results import Results, slug
from baselines.evaluation.summary import Summary
from baselines.files import write

__all__ = ["draw"]

#: The group of plots that show one policy each.
JOINTS = "Joint velocities, joint paths and joint accelerations"


def draw(results: Results, *, progress: bool = False) -> dict[str, Pictures]:
    """Draws all plots of a folder into its `plots/SCENARIO/`.

    All plots over time are those of the first episode of each policy. There are joint accelerations where the arm has
    limits of them.

    Args:
        results: The folder.
        progress: Whether to show a bar on stderr.

    Returns:
        The plots of each scenario.

    Raises:
        ResultsError: A log cannot be read, or a plot not be written.
    """
    out: dict[str, Pictures] = {}
    groups = by_scenario(results.rows)
    with tqdm(disable=not progress, file=sys.stderr, unit="plot", desc="plots") as bar:
        for scenario, summaries in groups.items():
            folder = pathlib.PurePath("plots") / slug(scenario)
            rows = [row for row in results.rows if row.scenario == scenario]
            pictures: dict[str, list[tuple[str, pathlib.PurePath]]] = {}
            for group, name, caption, figure in _figures(results, scenario, summaries, rows):
                file = folder / f"{name}.png"
                write(results.directory / file, style.png(figure))
                pictures.setdefault(group, []).append((caption, file))
                bar.update()
            out[scenario] = pictures
    return out


def _figures(
    results: Results, scenario: str, summaries: list[Summary], rows: list[Row]
) -> Iterator[tuple[str, str, str, Figure]]:
    """Groups, file names, captions and figures of one scenario."""
    plain = labels(summaries)
    names = {key: name + (" *" if is_reference(name.partition(":")[0]) else "") for key, name in plain.items()}
    looks = {id(summary): style.looks(number) for number, summary in enumerate(summaries)}
    first: dict[tuple[str, str], Row] = {}
    for row in rows:
        first.setdefault((row.policy, canonical(row.parameters)), row)

    if any(summary.time_p50_us is not None for summary in summaries):
        yield (
            OVERVIEW,
            "cost-time",
            f"Total cost against the median time per step in {scenario}",
            cost_time.draw(scenario, summaries, names, looks),
        )

    # The seed says which episode is shown, where there are others.
    episode = scenario if rows[0].seed == 0 else f"{scenario}, seed {rows[0].seed}"
    logs = [(summary, results.series(first[summary.policy, canonical(summary.parameters)])) for summary in summaries]
    pages = [logs[i : i + tracking.MOST] for i in range(0, len(logs), tracking.MOST)]
    for number, page in enumerate(pages, 1):
        ending = f"-{number}" if len(pages) > 1 else ""
        title = f"{episode}: task coordinates and errors"
        yield (
            OVERVIEW,
            f"tracking{ending}",
            f"Nominal and actual task coordinates, and errors, in {episode}",
            tracking.draw(title, [(names[id(summary)], log) for summary, log in page]),
        )
    for summary, log in logs:
        name = names[id(summary)]
        held = len(log["time"]) < summary.steps
        episode_of = f"{episode}, last step of each nominal point" if held else episode
        yield (
            JOINTS,
            f"velocities-{slug(plain[id(summary)])}",
            f"Joint velocities of {name} in {episode}",
            joints.draw_velocities(f"{episode_of}: joint velocities of {name}", log),
        )
        yield (
            JOINTS,
            f"joints-{slug(plain[id(summary)])}",
            f"Joint paths of {name} in {episode}",
            joints.draw_paths(f"{episode}: joint paths of {name}", log),
        )
        if "qddot" in log:
            yield (
                JOINTS,
                f"accelerations-{slug(plain[id(summary)])}",
                f"Joint accelerations of {name} in {episode}",
                joints.draw_accelerations(f"{episode_of}: joint accelerations of {name}", log),
            )
