"""Results in words: the table on the terminal, and the README of a folder of results."""

from __future__ import annotations

import collections
import dataclasses
import datetime
import math
import pathlib
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any
from urllib.parse import quote

from baselines import registry
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.metrics import LOST_ORIENTATION, LOST_POSITION, Row
from baselines.evaluation.summary import Paired, Spread, Summary, summarise
from baselines.evaluation.text_table import Column, fitting, plain
from baselines.oracle import best_known
from ikgym.exceptions import IkgymError

#: Characters that a line of the printed tables may have.
WIDTH = 120
NOTHING = "–"
#: The plots of a scenario: captions and files, relative to the folder, by the group they are shown in.
Pictures = Mapping[str, Sequence[tuple[str, pathlib.PurePath]]]
#: The group of plots that show all policies.
OVERVIEW = "overview"
REFERENCE_NOTE = "* reference: has privileged information"
STOP_NOTE = "† ran into a stop: a limit of a joint's coordinate held it back"


def number(value: float | None, scale: float = 1.0) -> str:
    """A number with four significant digits: ``1234``, ``0.01235``, ``1.235e7``; a dash for none."""
    if value is None or math.isnan(value):
        return NOTHING
    if value == 0.0:
        return "0"
    digits = f"{value * scale:#.4g}"
    mantissa, _, exponent = digits.partition("e")
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa.removesuffix(".")


def table(rows: Sequence[Row], skipped: Sequence[Skipped] = (), *, width: int = WIDTH) -> str:
    """The tables of all scenarios as plain text.

    Args:
        rows: The results.
        skipped: What was left out, to be said below.
        width: Characters that a line may have. Columns that do not fit are left out, and named below.
    """
    parts: list[str] = []
    absent: dict[str, None] = {}
    for scenario, summaries in by_scenario(rows).items():
        names = labels(summaries)
        columns, left_out = fitting(_columns(names), summaries, width)
        absent.update(dict.fromkeys(column.title for column in left_out))
        parts.append(f"{heading(scenario, summaries)}\n{plain(columns, summaries, width)}")
        if spread := _spread(names, summaries):
            parts.append(f"{_judged_by(summaries)} over the episodes of {scenario}\n{plain(spread, summaries, width)}")
    notes = remarks(rows)
    if absent:
        notes.append(f"left out at {width} characters a line: {', '.join(absent)}")
    notes += [f"skipped: {s.policy} in {s.scenario}: {s.reason}" for s in skipped]
    wrapped = (textwrap.fill(note, width, subsequent_indent="  ", break_on_hyphens=False) for note in notes)
    return "\n\n".join([*parts, "\n".join(wrapped)]).rstrip()


def readme(
    rows: Sequence[Row],
    skipped: Sequence[Skipped] = (),
    *,
    command: str,
    date: datetime.datetime,
    pictures: Mapping[str, Pictures] | None = None,
) -> str:
    """The README of a folder of results, in Markdown.

    Args:
        rows: The results.
        skipped: What was left out.
        command: What made them.
        date: When.
        pictures: The plots of each scenario.
    """
    out = ["# Results", ""]
    for scenario, summaries in by_scenario(rows).items():
        names = labels(summaries)
        out += [f"## {heading(scenario, summaries)}", "", *_markdown(_columns(names), summaries), ""]
        if spread := _spread(names, summaries):
            title = f"{_judged_by(summaries).capitalize()} over the episodes:"
            out += [title, "", *_markdown(spread, summaries), ""]
        for group, files in (pictures or {}).get(scenario, {}).items():
            # Those of each policy are many: collapsed, so that the tables stay together.
            collapsed = group != OVERVIEW
            out += ["<details>", f"<summary>{group}</summary>", ""] if collapsed else []
            for caption, file in files:
                out += [f"![{_escaped(caption)}]({quote(file.as_posix())})", "", f"*{_escaped(caption)}.*", ""]
            out += ["</details>", ""] if collapsed else []
    out += ["## Notes", "", *(f"- {_escaped(note)}" for note in remarks(rows)), ""]
    if skipped:
        out += ["Skipped, since the policy does not suit the scenario:", ""]
        out += [f"- {s.policy} in {s.scenario}: {_escaped(s.reason)}" for s in skipped] + [""]
    out += ["## Parameters", "", "| scenario | policy | parameters |", "|---|---|---|"]
    for scenario, summaries in by_scenario(rows).items():
        names = labels(summaries)
        for summary in summaries:
            values = ", ".join(f"`{name}={value}`" for name, value in summary.parameters.items()) or NOTHING
            values = values.replace("|", "\\|")  # in code nothing else has a meaning
            out.append(f"| {_escaped(scenario)} | {_escaped(names[id(summary)])} | {values} |")
    out += ["", "## Conditions", "", f"- command: `{command}`", f"- finished: {date:%Y-%m-%d %H:%M} UTC"]
    machines = list({tuple(row.machine.items()): row.machine for row in rows}.values())
    out += [f"- machine: {_escaped(machine_in_words(machine))}" for machine in machines]
    if len(machines) > 1:
        out += ["- The rows were measured on different machines: their times cannot be compared."]
    out += [
        "- Times are those of single calls of the policy on one thread: garbage collection off, one call before that."
    ]
    return "\n".join(out) + "\n"


def by_scenario(rows: Sequence[Row]) -> dict[str, list[Summary]]:
    """Summaries of each scenario, in the order of the rows."""
    out: dict[str, list[Summary]] = {}
    for summary in summarise(rows):
        out.setdefault(summary.scenario, []).append(summary)
    return out


def labels(summaries: Sequence[Summary]) -> dict[int, str]:
    """What to call each summary's policy among those of one scenario, by the summary's id.

    The name, and the parameters that are not at their defaults; where that leaves two of one name alike, all
    parameters that differ between them.
    """

    def told(summary: Summary, variants: Sequence[Mapping[str, Any]]) -> str:
        defaults = _defaults(summary.policy)
        parts = [
            f"{name}={_short(value)}"
            for name, value in summary.parameters.items()
            if any(variant.get(name) != value for variant in variants) or defaults.get(name, value) != value
        ]
        return summary.policy + (f":{','.join(parts)}" if parts else "")

    short = {id(summary): told(summary, ()) for summary in summaries}
    taken = collections.Counter(short.values())
    return {
        id(s): told(s, [o.parameters for o in summaries if short[id(o)] == short[id(s)]])
        if taken[short[id(s)]] > 1
        else short[id(s)]
        for s in summaries
    }


def is_reference(policy: str) -> bool:
    """Whether a policy has privileged information, as far as it can be told without importing code of others."""
    try:
        kind = registry.get(policy) if registry.known(policy) else registry.imported(policy)
    except IkgymError:
        return False
    return bool(getattr(kind, "reference", False))


def heading(scenario: str, summaries: Sequence[Summary]) -> str:
    """Scenario, steps and episodes in words."""
    episodes = sorted({summary.episodes for summary in summaries})
    many = "" if episodes == [1] else f"{'–'.join(map(str, (episodes[0], episodes[-1])[: len(episodes)]))} episodes of "
    return f"{scenario}: {many}{summaries[0].steps} steps"


def _columns(names: Mapping[int, str]) -> list[Column]:
    return [
        _policy(names),
        Column("total", "cost", lambda s: number(s.total_cost.mean)),
        Column("tracking", "cost", lambda s: number(s.tracking_cost), drop=3),
        Column("velocity", "cost", lambda s: number(s.velocity_cost), drop=4),
        Column("cost", "ratio", lambda s: number(None if s.cost_ratio is None else s.cost_ratio.mean)),
        Column("pos max", "[mm]", lambda s: number(s.position_error_max, 1e3)),
        Column("ori max", "[mrad]", lambda s: number(s.orientation_error_max, 1e3), drop=1),
        Column("q̇ peak", "", lambda s: number(s.qdot_peak), drop=2),
        Column("p50", "[µs]", lambda s: number(s.time_p50_us)),
        Column("p99", "[µs]", lambda s: number(s.time_p99_us), drop=5),
        Column("misses", "", lambda s: NOTHING if s.deadline_misses is None else str(s.deadline_misses), drop=6),
        Column("status", "", lambda s: s.status, left=True),
    ]


def _judged_by(summaries: Sequence[Summary]) -> str:
    """What the table of several episodes shows: the cost ratio, where it is known for all of them."""
    return "total cost" if any(summary.cost_ratio is None for summary in summaries) else "cost ratio"


def _spread(names: Mapping[int, str], summaries: Sequence[Summary]) -> list[Column]:
    """The columns of the table of several episodes; of one, those of matched pairs, or none."""
    beside = _beside_ideal() if any(summary.paired for summary in summaries) else []
    if all(summary.episodes == 1 for summary in summaries):
        return [_policy(names), *beside] if beside else []
    by_cost_ratio = _judged_by(summaries) == "cost ratio"

    def column(title: str, cell: Callable[[Spread], str]) -> Column:
        return Column(title, "", lambda s: cell(s.cost_ratio if by_cost_ratio and s.cost_ratio else s.total_cost))

    return [
        _policy(names),
        Column("episodes", "", lambda s: str(s.episodes)),
        column("geometric mean", lambda spread: number(spread.mean)),
        column("median", lambda spread: number(spread.median)),
        column("p90", lambda spread: number(spread.p90)),
        column("worst", lambda spread: number(spread.worst)),
        column("worst seed", lambda spread: str(spread.worst_seed)),
        Column("lost", "", lambda s: str(s.lost)),
        *beside,
    ]


def _beside_ideal() -> list[Column]:
    """The columns of matched pairs: the same policy on an ideal plant, and what it costs more than there."""

    def column(title: str, unit: str, cell: Callable[[Paired], str]) -> Column:
        return Column(title, unit, lambda s: cell(s.paired) if s.paired else NOTHING)

    return [
        column("ideal", "ratio", lambda pair: number(pair.cost_ratio)),
        column("× ideal", "cost", lambda pair: number(pair.mean)),
        column("95 %", "", lambda pair: f"{number(pair.low)} … {number(pair.high)}"),
    ]


def _policy(names: Mapping[int, str]) -> Column:
    def cell(summary: Summary) -> str:
        marks = " *" * is_reference(summary.policy) + " †" * (summary.steps_at_joint_limit > 0)
        return names[id(summary)] + marks

    return Column("policy", "", cell, left=True)


def _markdown(columns: Sequence[Column], summaries: Sequence[Summary]) -> list[str]:
    heads = [f"{column.title} {column.unit}".strip() for column in columns]
    rules = [":--" if column.left else "--:" for column in columns]
    cells = [[_escaped(column.cell(summary)) for column in columns] for summary in summaries]
    return [f"| {' | '.join(line)} |" for line in (heads, rules, *cells)]


def remarks(rows: Sequence[Row]) -> list[str]:
    """What has to be said below the tables."""
    notes = [REFERENCE_NOTE] * any(is_reference(row.policy) for row in rows)
    notes += [STOP_NOTE] * any(row.steps_at_joint_limit for row in rows)
    notes.append(
        "cost ratio: total cost / best known cost, – where none is known; p50, p99: time of a call after the first; "
        "misses: such calls longer than Δt"
    )
    notes.append("pos, ori: position and orientation error; q̇ peak in rad/s, in m/s for prismatic joints")
    if any(summary.episodes > 1 for summaries in by_scenario(rows).values() for summary in summaries):
        notes.append(
            "several episodes: costs and cost ratio are geometric means, errors, q̇ peak, p99 and status the worst, p50 "
            "the median, misses the sum; times are those of episodes that were played alone; lost: episodes with more "
            f"than {1e3 * LOST_POSITION:g} mm or {LOST_ORIENTATION:g} rad of error at some time"
        )
    if any(row.noise_seed for row in rows):
        notes.append("costs of an episode are geometric means over its noise seeds; lost counts each of them")
    if any(summary.paired for summaries in by_scenario(rows).values() for summary in summaries):
        notes.append(
            "ideal: cost ratio of the same policy with an ideal plant; × ideal: its cost divided by that on the ideal "
            "plant with the same seed, geometric mean, and the interval of that over the seeds"
        )
    return notes + _beaten(rows)


def _beaten(rows: Sequence[Row]) -> list[str]:
    """What has to be said where a policy is better than the best known."""
    seeds: dict[tuple[str, str], list[int]] = {}
    for row in rows:
        if best_known.beaten(row):
            seeds.setdefault((row.policy, row.scenario), []).append(row.seed)
    return [
        f"{policy} beats the best known cost of {scenario}, seed {', '.join(map(str, better))}: bring the record up to "
        f"date with {best_known.UPDATE} --scenarios {scenario} --policies {policy}"
        for (policy, scenario), better in seeds.items()
    ]


def machine_in_words(machine: Mapping[str, Any]) -> str:
    """A line on what was measured on."""
    words = dict(machine)
    cpu, cores = words.pop("cpu", "unknown CPU"), words.pop("cores", "?")
    return f"{cpu}, {cores} cores, " + ", ".join(f"{name} {value}" for name, value in words.items())


def _defaults(policy: str) -> dict[str, Any]:
    try:
        fields = dataclasses.fields(registry.get(policy))
    except IkgymError:  # of a policy that is not known here
        return {}
    # None often stands for a value that the policy works out itself.
    return {f.name: f.default for f in fields if f.default is not dataclasses.MISSING and f.default is not None}


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value).replace(" ", "")


def _escaped(text: str) -> str:
    for sign in "|*":
        text = text.replace(sign, f"\\{sign}")
    return text
