"""The page about what was measured: how to choose, plots and tables, all of it worked out from the points."""

from __future__ import annotations

import pathlib
from collections.abc import Iterator

from matplotlib.figure import Figure

from baselines.evaluation.markdown import table
from baselines.evaluation.metrics import Spread
from baselines.evaluation.pareto import picture
from baselines.evaluation.pareto.contenders import FAMILIES, family, presets
from baselines.evaluation.pareto.points import LOST, Measured, Measurement, Point, front
from baselines.evaluation.plots import style
from baselines.evaluation.plots.cost_time import Mark
from baselines.evaluation.report import NOTHING, number
from baselines.evaluation.results import slug
from ikgym import scenarios

#: Where the plots lie, seen from the page.
IMAGES = pathlib.PurePath("images")
# Colours: of the families, of presets, and of all others.
LINES, PRESET, OTHER = style.COLOURS[:4], style.COLOURS[4], style.STEEL
BEST = "●"

INTRODUCTION = f"""\
Every policy that a user can choose, by what it costs and how long a step takes it: all registered ones as they are,
`rhc` by horizon, computed in four ways, and its presets with and without knowing where the episode ends. References,
which know what no observation shows, are left out. Written by `python -m baselines.pareto`, see
[conditions](#conditions); everything below is worked out from what was measured, which lies in
[pareto.json](pareto.json).

- **Cost ratio** is the total cost divided by the [best known cost](evaluation.md#best-known-costs) of the episode:
  geometric mean, median, 90th percentile and worst over the episodes. A mean hinges on one or two of them: look at the
  worst, too. Where a best known cost is missing, the total cost stands in its place.
- **Lost** is the share of episodes in which the arm was at some time more than {1e3 * LOST:g} mm away from where it
  should have been.
- **p50, p99** are of calls of `predict` after the first, in the episodes that were played alone, with the clock: the
  median of the medians, and the largest 99th percentile. The **first** call, the longest of the episodes, stands apart:
  an episode can begin when it is done.
- {BEST} marks the **Pareto front**: no other policy has both a lower cost ratio and a lower median time.
- Played are the [test sets](evaluation.md#test-sets), and each fixed scenario once, but for those that hold their
  points, where the task is to iterate. The column of episodes says how many each line has.
- Presets that draw at random were played with several seeds of their own, put together here: 3 × 64 are three seeds.
- `rhc` to the optimum makes as many Newton steps as it takes; with one iteration it makes one in each control period
  (the real-time iteration); with blocks it has fewer knots, closer together near the present.
"""

TIMES = (
    "Times are those of single calls on one thread, with nothing else under way: garbage collection off, one call "
    "before that."
)


def pictures(measurement: Measurement) -> Iterator[tuple[pathlib.PurePath, Figure]]:
    """The plot of each set, and where it lies, seen from the page."""
    for one in measurement.sets:
        yield _file(one), _picture(one)


def page(measurement: Measurement) -> str:
    """The page as Markdown."""
    out = ["# Cost against time", "", INTRODUCTION, "## How to choose", ""]
    for one in [one for one in measurement.sets if len(one.seeds) > 1] or measurement.sets:
        out += _choice(one)
    for one in measurement.sets:
        out += _section(one)
    out += ["## Conditions", "", f"- command: `{measurement.command}`", f"- date: {measurement.date}"]
    words = [f"{name} {value}" for name, value in measurement.machine.items()]
    out += [f"- machine: {', '.join(words)}", f"- {TIMES}"]
    return "\n".join(out) + "\n"


def _choice(one: Measured) -> list[str]:
    """What to take for which time, what the horizon and the shortcuts do, and what it is worth to know the end."""
    points, spreads = {point.spec: point for point in one.points}, one.spreads()
    head = ["a step takes up to [µs]", "policy", *_heads(one), "p50 [µs]", "first [µs]"]
    lines = [
        [
            _time(points[spec].time_p99_us),
            f"`{spec}`",
            *_values(one, points[spec], spreads[spec]),
            *map(_time, (points[spec].time_p50_us, points[spec].time_first_us)),
        ]
        for spec in front(one, "time_p99_us")
    ]
    out = [f"On `{one.name}`, take the last line whose time (p99) you can spare; the {_quantity(one)} falls:", ""]
    out += [*table(head, lines, text=(1,)), "", *_horizons(one), ""]
    return out + [text for name in presets() for text in _worth_of_the_end(one, name)]


def _worth_of_the_end(one: Measured, name: str) -> list[str]:
    knows, looks_on = (one.spreads().get(f"{name}:stop_at_end={flag}") for flag in (True, False))
    if knows is None or looks_on is None:
        return []
    mean, median = (100.0 * (a / b - 1.0) for a, b in ((looks_on.mean, knows.mean), (looks_on.median, knows.median)))
    return [
        f"Not to know where the episode ends (`stop_at_end=False`) changes the {_quantity(one)} of `{name}` by "
        f"{mean:+.1f} % in the geometric mean, by {median:+.1f} % in the median.",
        "",
    ]


def _horizons(one: Measured) -> list[str]:
    """The families by horizon."""
    members = {key: point for point in one.points if (key := family(point.spec))}
    spreads = one.spreads()
    lines = []
    for horizon in sorted({horizon for _, horizon in members}):
        line = [str(horizon)]
        for name in FAMILIES:
            point = members.get((name, horizon))
            line += [number(spreads[point.spec].mean), _time(point.time_p50_us)] if point else [NOTHING, NOTHING]
        lines.append(line)
    head = ["horizon", *(text for name in FAMILIES for text in (f"{name}: {_quantity(one)}", "p50 [µs]"))]
    return table(head, lines)


def _section(one: Measured) -> list[str]:
    steps = scenarios.get(one.name).steps
    many = f"{len(one.seeds)} episodes of " if len(one.seeds) > 1 else ""
    out = [f"## {one.name}: {many}{steps:,} steps", ""]
    out += [f"![{_quantity(one).capitalize()} against time per step in {one.name}]({_file(one).as_posix()})", ""]
    best, spreads = set(front(one)), one.spreads()
    head = ["", "policy", *_heads(one), "p50 [µs]", "p99 [µs]", "first [µs]", "episodes", "timed"]
    lines = []
    for point in sorted(one.points, key=lambda point: spreads[point.spec].mean):
        seeds = len(point.cost) // len(one.seeds)
        lines.append(
            [
                BEST if point.spec in best else "",
                f"`{point.spec}`",
                *_values(one, point, spreads[point.spec]),
                *map(_time, (point.time_p50_us, point.time_p99_us, point.time_first_us)),
                f"{seeds} × {len(one.seeds)}" if seeds > 1 else str(len(one.seeds)),
                str(point.timed),
            ]
        )
    rows = table(head, lines, text=(1,))
    if len(one.seeds) > 1:
        return [*out, *rows, ""]
    return [*out, "<details>", f"<summary>All policies on {one.name}</summary>", "", *rows, "", "</details>", ""]


def _quantity(one: Measured) -> str:
    return "cost" if one.best_known() is None else "cost ratio"


def _heads(one: Measured) -> list[str]:
    """The heads of what :func:`_values` gives."""
    spread = ["median", "p90"] if len(one.seeds) > 1 else []
    return [_quantity(one), *spread, "worst", "lost"]


def _values(one: Measured, point: Point, spread: Spread) -> list[str]:
    """Geometric mean, median, 90th percentile, worst, and the share that lost track; of one episode mean and worst."""
    between = (spread.median, spread.p90) if len(one.seeds) > 1 else ()
    return [*map(number, (spread.mean, *between, spread.worst)), f"{100.0 * point.lost / len(point.cost):.0f} %"]


def _time(microseconds: float) -> str:
    return f"{microseconds:,.0f}"


def _file(one: Measured) -> pathlib.PurePath:
    return IMAGES / f"pareto-{slug(one.name)}.png"


def _picture(one: Measured) -> Figure:
    spreads, marks = one.spreads(), {}
    for point in one.points:
        member = family(point.spec)
        name = point.spec.split(":")[0]
        marks[point.spec] = Mark(
            time=point.time_p50_us,
            value=spreads[point.spec],
            name=str(member[1]) if member else _short(point.spec),
            colour=LINES[FAMILIES.index(member[0])] if member else PRESET if name in presets() else OTHER,
            small=member is not None,
        )
    families = {
        name: [mark for spec, mark in marks.items() if (member := family(spec)) and member[0] == name]
        for name in FAMILIES
    }
    scenario = scenarios.get(one.name)
    many = f"{len(one.seeds)} episodes of " if len(one.seeds) > 1 else ""
    return picture.draw(
        f"{one.name}, {many}{scenario.steps:,} steps",
        [mark for spec, mark in marks.items() if family(spec) is None],
        {name: members for name, members in families.items() if members},
        [marks[spec] for spec in front(one)],
        cost_ratio=one.best_known() is not None,
        several=len(one.seeds) > 1,
        deadline=1e6 * scenario.dt,
    )


def _short(spec: str) -> str:
    """A contender on a plot: ``rhc_foresight, stop_at_end off``."""
    return spec.replace(":stop_at_end=", ", stop_at_end ").replace("True", "on").replace("False", "off")
