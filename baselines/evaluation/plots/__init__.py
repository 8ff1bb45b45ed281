"""The plots of a folder of results: matplotlib without pyplot, and so without a window system."""

from __future__ import annotations

import pathlib
import sys
from collections.abc import Iterator, Sequence

from matplotlib.figure import Figure
from tqdm import tqdm

from baselines.evaluation.plots import comparison, joints, style, tracking
from baselines.evaluation.plots.style import literal
from baselines.evaluation.records import records
from baselines.evaluation.report import OVERVIEW, Pictures
from baselines.evaluation.results import Results, slug
from baselines.evaluation.summary import Summary, by_scenario
from baselines.files import write

__all__ = ["draw"]

#: The group of plots that show one policy each.
JOINTS = "Joint velocities, joint paths and joint accelerations"


def draw(results: Results, *, progress: bool = False) -> dict[str, Pictures]:
    """Draws all plots of a folder into its `plots/SCENARIO/`.

    All plots over time are those of the first episode of each policy. Joint accelerations are drawn if the arm has
    limits of them.

    Args:
        results: The folder.
        progress: Whether to show a bar on stderr.

    Returns:
        The plots of each scenario.

    Raises:
        ResultsError: A log cannot be read, or a plot cannot be written.
    """
    out: dict[str, Pictures] = {}
    with tqdm(disable=not progress, file=sys.stderr, unit="plot", desc="plots") as bar:
        for scenario, summaries in by_scenario(results.rows).items():
            pictures: dict[str, list[tuple[str, pathlib.PurePath]]] = {}
            for group, name, caption, figure in _figures(results, scenario, summaries):
                file = pathlib.PurePath("plots") / slug(scenario) / f"{name}.png"
                write(results.directory / file, style.png(figure))
                pictures.setdefault(group, []).append((caption, file))
                bar.update()
            out[scenario] = pictures
    return out


def _figures(results: Results, scenario: str, summaries: Sequence[Summary]) -> Iterator[tuple[str, str, str, Figure]]:
    """Groups, file names, captions and figures of one scenario."""
    lines = records([row for summary in summaries for row in summary.rows])
    references = {one.label: f"{one.label} *" for one in summaries if one.reference}
    lines = [{**line, "policy": literal(references.get(line["policy"], line["policy"]))} for line in lines]
    if any(line["time_p99_us"] is not None for line in lines):
        caption = f"Cost against the 99th percentile of the time per step in {scenario}"
        yield OVERVIEW, "cost-time", caption, comparison.cost_time(lines, literal(scenario))

    # The seed says which episode is shown, where there are others.
    seed = summaries[0].first.seed
    episode = f"{scenario}, seed {seed}" if seed else scenario
    logs = [(one, results.series(one.first)) for one in summaries]
    pages = [logs[i : i + tracking.MOST] for i in range(0, len(logs), tracking.MOST)]
    for number, page in enumerate(pages, 1):
        caption = f"Errors, and nominal and actual position, in {episode}"
        named = [(literal(one.label + " *" * one.reference), log) for one, log in page]
        figure = tracking.draw(literal(f"{episode}: errors and position"), named)
        yield OVERVIEW, f"tracking{f'-{number}' if len(pages) > 1 else ''}", caption, figure
    for one, log in logs:
        for quantity in joints.QUANTITIES:
            if quantity.column in log:
                title = f"{quantity.name} of {one.label} in {episode}"
                yield JOINTS, f"{quantity.file}-{slug(one.label)}", title, joints.draw(literal(title), log, quantity)
