"""The foresight page: cost ratio against how far a policy looks ahead, with and without knowing the end."""

from __future__ import annotations

import pathlib
from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from baselines.evaluation.pages import sets
from baselines.evaluation.pages.claims import Comparison
from baselines.evaluation.pages.cost_time import extent
from baselines.evaluation.pages.entries import FORESIGHT, Entry, first_seed, solver
from baselines.evaluation.pages.markdown import IMAGES, between, conditions, lost, share, table, time
from baselines.evaluation.pages.measurement import Measurement, Section
from baselines.evaluation.pages.statistics import geometric_interval
from baselines.evaluation.plots import style
from baselines.evaluation.report import number
from baselines.evaluation.summary import Spread
from ikgym.validation import FloatArray

#: How far is looked ahead, in steps.
STEPS = (100, 300, 600, 1000, 1500, 3000)
#: The share of each set's episodes, the first ones, that is played: twelve policies of a tenth of a millisecond a step
#: would take as long as all else.
SHARE = 1 / 2
PICTURE = IMAGES / "foresight.png"
#: With and without knowing the end: the value of the parameter, and what it is called.
KNOWING = {True: "knows the end", False: "looks on"}

INTRODUCTION = f"""\
How far a policy has to look ahead, and what it is worth to know where the episode ends: `{FORESIGHT}` with other
horizons, all else as it is, on the [test sets](evaluation.md#test-sets) of whole poses. *Knows the end*
(`stop_at_end=True`): costs behind the last step are left out of the plan, which then covers the whole rest of the
episode as soon as that is no longer than the horizon. *Looks on* (`stop_at_end=False`): the plan goes on behind the
last step, as it does on a real arm that is not switched off there. Written by `python -m baselines.leaderboard`, see
[conditions](#conditions); everything below is worked out from what was measured, which lies in
[foresight.json](foresight.json).

**Cost ratio** is the total cost divided by the [best known cost](evaluation.md#best-known-costs) of the episode, in the
geometric mean; **95 %** its interval over the episodes, by the bootstrap that the
[leaderboard](leaderboard.md#all-lines) describes. One seed of the policy was played, on the first
{100.0 * SHARE:g} % of the episodes of each set.
"""


def entries(steps: Iterable[int] = STEPS) -> tuple[Entry, ...]:
    """All horizons with and without knowing the end, each with one seed of the policy."""
    entered = (solver(spec(ahead, knows=knows), timed=1) for knows in KNOWING for ahead in steps)
    return tuple(first_seed(one, SHARE) for one in entered)


def spec(ahead: int, *, knows: bool) -> str:
    """The policy that looks so many steps ahead: the present one is a grid point of its horizon, too."""
    return f"{FORESIGHT}:horizon={ahead + 1},stop_at_end={knows}"


def pictures(measurement: Measurement) -> Iterator[tuple[pathlib.PurePath, Figure]]:
    """The plot, and where it lies, seen from the page."""
    drawn = style.figure(3.4)
    panels = drawn.subplots(1, len(measurement.sections), squeeze=False)[0]
    for axes, section in zip(panels, measurement.sections, strict=True):
        _draw(axes, section)
    style.legend(drawn, "Foresight, geometric mean and interval of 95 %", panels[0].containers, [*KNOWING.values()])
    yield PICTURE, drawn


def page(measurement: Measurement) -> str:
    """The page as Markdown."""
    out = ["# Foresight", "", INTRODUCTION, f"![Cost ratio against foresight]({PICTURE.as_posix()})", ""]
    for one in measurement.sections:
        out += [f"## {one.name}: {extent(one)}", "", *_sentences(one), "", *_table(one), ""]
        out += [f"*Lost* is the share of episodes in which the arm was {lost(one)} at some time.", ""]
    return "\n".join([*out, *conditions(measurement)]) + "\n"


def looked_ahead(section: Section) -> list[int]:
    """How far was looked ahead there, in steps."""
    return sorted({line.preview for line in section.lines})


def _draw(axes: Axes, section: Section) -> None:
    cost_ratios, ahead = section.cost_ratios(), looked_ahead(section)
    for number_, knows in enumerate(KNOWING):
        values = [cost_ratios[spec(steps, knows=knows)] for steps in ahead]
        means = np.array([Spread.over(value).mean for value in values])
        bars = np.abs(np.array([geometric_interval(value) for value in values]).T - means)
        axes.errorbar(ahead, means, yerr=bars, lw=1.4, marker="o", ms=4.5, capsize=3.0, **style.looks(number_))
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.xaxis.set_major_locator(FixedLocator(ahead))
    axes.xaxis.set_minor_locator(NullLocator())
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
    axes.yaxis.set_minor_formatter(FuncFormatter(lambda value, _: f"{value:,g}"))
    axes.tick_params(which="minor", labelsize=style.SMALL)
    style.dress(axes, ylabel=f"{section.quantity} [1]", xlabel="steps ahead", title=section.name)


def _sentences(one: Section) -> list[str]:
    """What the furthest foresight brings beside the nearest, and what it is worth to know the end."""
    cost_ratios, ahead = one.cost_ratios(), looked_ahead(one)
    far, near = (cost_ratios[spec(steps, knows=True)] for steps in (ahead[-1], ahead[0]))
    blind = cost_ratios[spec(ahead[-1], knows=False)]
    return [
        f"- Who looks {ahead[0]:,} steps ahead pays {Comparison.of(near, far)} times as much as who looks "
        f"{ahead[-1]:,} ahead, where both know the end.",
        f"- Not to know the end costs {Comparison.of(blind, far)} times as much with {ahead[-1]:,} steps of foresight. "
        + _covered(one, ahead),
    ]


def _covered(one: Section, ahead: Sequence[int]) -> str:
    """Which horizons hold the whole episode."""
    steps = sets.get(one.name).steps
    if whole := [f"{far:,}" for far in ahead if far >= steps]:
        return f"From the first step on, {' and '.join(whole)} steps cover all {steps:,} of the episode."
    return f"None of them covers the {steps:,} steps of the episode."


def _table(one: Section) -> list[str]:
    by_label, cost_ratios = {line.label: line for line in one.lines}, one.cost_ratios()
    lines = []
    for ahead in looked_ahead(one):
        for knows, words in KNOWING.items():
            label = spec(ahead, knows=knows)
            lines.append([f"{ahead:,}", words, *_values(cost_ratios[label])])
            line = by_label[label]
            lines[-1] += [share(line.lost / line.runs), time(line.time_p50_us), time(line.time_p99_us)]
    head = ["steps ahead", "", one.quantity, "95 %", "median", "p90", "worst", "lost", "p50 [µs]", "p99 [µs]"]
    return table(head, lines, text=(1,))


def _values(cost_ratios: FloatArray) -> list[str]:
    spread = Spread.over(cost_ratios)
    return [number(spread.mean), between(cost_ratios), *map(number, (spread.median, spread.p90, spread.worst))]
