"""The cost–time page: how to choose, plots and tables, all of it worked out from what was measured."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator

import numpy as np
from matplotlib.figure import Figure

from baselines.evaluation.metrics import LOST_ORIENTATION, LOST_POSITION
from baselines.evaluation.pages import cost_time_plot, sets
from baselines.evaluation.pages.claims import Comparison
from baselines.evaluation.pages.entries import FORESIGHT
from baselines.evaluation.pages.families import FAMILIES, family, presets
from baselines.evaluation.pages.markdown import (
    IMAGES,
    between,
    collapsed,
    conditions,
    fewer_episodes,
    runs,
    share,
    table,
    time,
)
from baselines.evaluation.pages.measurement import Line, Measurement, Section
from baselines.evaluation.plots import style
from baselines.evaluation.plots.cost_time import Mark
from baselines.evaluation.report import NOTHING, number
from baselines.evaluation.results import slug
from baselines.evaluation.summary import Spread
from ikgym.validation import FloatArray

# Colours: of the families, of presets, and of all others.
COLOURS, PRESET, OTHER = style.COLOURS[:4], style.COLOURS[4], style.STEEL
# Of policies that stand for themselves, whose names stand in the legend.
MARKERS = "osD^v<>PX*phd8H"
BEST = "●"

INTRODUCTION = f"""\
Every policy that a user can choose, by what it costs and how long a step takes it: all registered ones as they are,
`rhc` by horizon, computed in four ways, and its presets with and without knowing where the episode ends. References,
which have privileged information, are left out. Written by `python -m baselines.leaderboard`, see
[conditions](#conditions); everything below is worked out from what was measured, which lies in
[cost_time.json](cost_time.json).

- **Cost ratio** is the total cost divided by the [best known cost](evaluation.md#best-known-costs) of the episode:
  geometric mean, median, 90th percentile and worst over the episodes. A mean hinges on one or two of them: look at the
  worst, too. **95 %** is the interval of the geometric mean, by the bootstrap that the
  [leaderboard](leaderboard.md#all-lines) describes. Where a best known cost is missing, costs are relative to the
  lowest over the seeds of `{FORESIGHT}`.
- **Lost** is the share of episodes in which the arm was at some time more than {1e3 * LOST_POSITION:g} mm away from
  where it should have been, or, where the scenario has an orientation, turned away by more than
  {LOST_ORIENTATION:g} rad.
- **p50, p99** are of calls of `predict` after the first, in the episodes that were played alone, with the clock: the
  median of the medians, and the largest 99th percentile. The **first** call, the longest of the episodes, stands apart:
  an episode can begin when it is done.
- {BEST} marks the **Pareto front**: no other policy has both a lower cost ratio and a lower median time. Who has played
  fewer episodes is not on it.
- Played are the [test sets](evaluation.md#test-sets) of whole poses, and each fixed scenario once, but for those that
  hold their points, where the task is to iterate. The column of episodes says how many each line has.
- Presets that draw at random were played with several seeds of their own, put together here: 3 × 256 are three seeds.
- `rhc` to the optimum makes as many Newton steps as it takes; with one iteration it makes one in each control period
  (the real-time iteration); with move blocks it has fewer knots, closer together near the present.
"""


def pictures(measurement: Measurement) -> Iterator[tuple[pathlib.PurePath, Figure]]:
    """The plot of each set, and where it lies, seen from the page."""
    for one in measurement.sections:
        yield _file(one), _picture(one)


def page(measurement: Measurement) -> str:
    """The page as Markdown."""
    out = ["# Cost against time", "", INTRODUCTION, "## How to choose", ""]
    for one in [one for one in measurement.sections if len(one.seeds) > 1] or measurement.sections:
        out += _choice(one)
    for one in measurement.sections:
        out += _section(one)
    return "\n".join([*out, *conditions(measurement)]) + "\n"


def front(section: Section, by: str = "time_p50_us") -> list[str]:
    """The lines that no other beats in time or cost ratio without being worse in the other, from fast to slow.

    Args:
        section: A set of episodes.
        by: Which of a line's times.
    """
    means = {name: spread.mean for name, spread in section.spreads().items()}
    out: list[str] = []
    timed = [line for line in section.lines if getattr(line, by) is not None and line.episodes == len(section.seeds)]
    for line in sorted(timed, key=lambda line: (getattr(line, by), means[line.label])):
        if not out or means[line.label] < means[out[-1]]:
            out.append(line.label)
    return out


def _choice(one: Section) -> list[str]:
    """What to take for which time, what the horizon and the shortcuts do, and what it is worth to know the end."""
    by_label, cost_ratios = {line.label: line for line in one.lines}, one.cost_ratios()
    head = ["a step takes up to [µs]", "policy", *_heads(one), "p50 [µs]", "first [µs]"]
    lines = [
        [
            time(by_label[spec].time_p99_us),
            f"`{spec}`",
            *_values(one, by_label[spec], cost_ratios[spec]),
            *map(time, (by_label[spec].time_p50_us, by_label[spec].time_first_us)),
        ]
        for spec in front(one, "time_p99_us")
    ]
    out = [f"On `{one.name}`, take the last line whose time (p99) you can spare; the {one.quantity} falls:", ""]
    out += [*table(head, lines, text=(1,)), "", *_horizons(one), ""]
    return out + [text for name in presets() for text in _worth_of_the_end(one, name)]


def _worth_of_the_end(one: Section, name: str) -> list[str]:
    knows, looks_on = (one.cost_ratios().get(f"{name}:stop_at_end={flag}") for flag in (True, False))
    if knows is None or looks_on is None:
        return []
    ratio = Comparison.of(looks_on, knows)
    mean, low, high = (f"{100.0 * (value - 1.0):+.1f} %" for value in (ratio.ratio, ratio.low, ratio.high))
    median = 100.0 * (np.median(looks_on) / np.median(knows) - 1.0)
    return [
        f"Not to know where the episode ends (`stop_at_end=False`) changes the {one.quantity} of `{name}` by "
        f"{mean} ({low} to {high}) in the geometric mean, by {median:+.1f} % in the median.",
        "",
    ]


def _horizons(one: Section) -> list[str]:
    """The families by horizon."""
    members = {key: line for line in one.lines if (key := family(line.name))}
    spreads, cost_ratios = one.spreads(), one.cost_ratios()
    lines = []
    for horizon in sorted({horizon for _, horizon in members}):
        cells = [str(horizon)]
        for name in FAMILIES:
            member = members.get((name, horizon))
            if member is None:
                cells += [NOTHING] * 3
                continue
            fewer = "**" * (member.episodes < len(one.seeds))
            interval = between(cost_ratios[member.label]) if member.runs > 1 else NOTHING
            mean = f"{fewer}{number(spreads[member.label].mean)}{fewer}"
            cells += [mean, interval, time(member.time_p50_us)]
        lines.append(cells)
    head = ["horizon", *(text for name in FAMILIES for text in (f"{name}: {one.quantity}", "95 %", "p50 [µs]"))]
    return [*table(head, lines), "", "Bold means fewer episodes, the first ones: compare those with each other only."]


def _section(one: Section) -> list[str]:
    out = [f"## {one.name}: {extent(one)}", ""]
    out += [f"![{one.quantity.capitalize()} against time per step in {one.name}]({_file(one).as_posix()})", ""]
    best, cost_ratios = set(front(one)), one.cost_ratios()
    head = ["", "policy", *_heads(one), "p50 [µs]", "p99 [µs]", "first [µs]", "episodes", "timed"]
    lines = [
        [
            BEST if line.label in best else "",
            f"`{line.label}`",
            *_values(one, line, cost_ratios[line.label]),
            *map(time, (line.time_p50_us, line.time_p99_us, line.time_first_us)),
            runs(line, one) if line.seeds or line.episodes < len(one.seeds) else str(len(one.seeds)),
            str(line.timed),
        ]
        for line in one.ranked()
    ]
    rows = table(head, lines, text=(1,))
    return (
        [*out, *rows, "", *fewer_episodes(one)]
        if len(one.seeds) > 1
        else [*out, *collapsed(f"All policies on {one.name}", rows)]
    )


def extent(one: Section) -> str:
    """How many episodes a section has, and of how many steps, in words."""
    many = f"{len(one.seeds)} episodes of " if len(one.seeds) > 1 else ""
    return f"{many}{sets.get(one.name).steps:,} steps"


def _heads(one: Section) -> list[str]:
    """The heads of what :func:`_values` gives."""
    spread = ["95 %", "median", "p90"] if len(one.seeds) > 1 else []
    return [one.quantity, *spread, "worst", "lost"]


def _values(one: Section, line: Line, cost_ratios: FloatArray) -> list[str]:
    """Geometric mean, its interval, median, p90, worst, and the share lost; of one episode mean, worst and share."""
    spread, out = Spread.over(cost_ratios), []
    if len(one.seeds) > 1:
        out = [between(cost_ratios), *map(number, (spread.median, spread.p90))]
    return [number(spread.mean), *out, number(spread.worst), share(line.lost / line.runs)]


def _file(one: Section) -> pathlib.PurePath:
    return IMAGES / f"cost-time-{slug(one.name)}.png"


def _picture(one: Section) -> Figure:
    spreads, marks = one.spreads(), {}
    families: dict[str, list[Mark]] = {name: [] for name in FAMILIES}
    plain: list[Mark] = []
    for line in one.lines:
        if line.time_p50_us is None:
            continue
        member = family(line.name)
        colour = COLOURS[FAMILIES.index(member[0])] if member else PRESET if _preset(line) else OTHER
        name = str(member[1]) if member else _short(line.label)
        marker = MARKERS[len(plain) % len(MARKERS)] if member is None else "o"
        mark = Mark(line.time_p50_us, spreads[line.label], name, colour, member is not None, marker)
        marks[line.label] = mark
        (families[member[0]] if member else plain).append(mark)
    return cost_time_plot.draw(
        f"{one.name}, {extent(one)}",
        plain,
        {name: members for name, members in families.items() if members},
        [marks[name] for name in front(one)],
        quantity=one.quantity,
        several=len(one.seeds) > 1,
        deadline=1e6 * sets.get(one.name).dt,
    )


def _preset(line: Line) -> bool:
    return line.name.partition(":")[0] in presets()


def _short(spec: str) -> str:
    """A policy on a plot: ``rhc_foresight, stop_at_end off``."""
    return spec.replace(":stop_at_end=", ", stop_at_end ").replace("True", "on").replace("False", "off")
