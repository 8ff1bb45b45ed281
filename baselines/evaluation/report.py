"""The printed table, and the README of a folder of results."""

from __future__ import annotations

import datetime
import textwrap
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from baselines.canonical import canonical
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.metrics import FOLLOWED_ORIENTATION, FOLLOWED_POSITION, LOST_ORIENTATION, LOST_POSITION, Row
from baselines.evaluation.summary import Paired, Summary, by_scenario, is_reference, summarise
from baselines.evaluation.table import NOTHING, Column, code, escaped, filled, fitting, markdown, number, plain
from baselines.oracle import best_known
from baselines.statistics import Spread

#: Characters that a line of the printed tables may have.
WIDTH = 120
REFERENCE_NOTE = "* reference: has privileged information"
STOP_NOTE = "† a joint was at a stop, a limit of its coordinate"
STATED_NOTE = "§ no acceleration limit stated for some joint: the peak is what was used"
TIMING_NOTE = (
    "‡ free timing: slower where limits bind; path time: when the end of the path was reached, – if it was not; path "
    "err: largest distance from the reference at the policy's own progress; all else is on the clock of the scenario"
)


def _policy(summary: Summary) -> str:
    marks = " *" * summary.reference + " †" * bool(summary.total("steps_at_joint_limit")) + " ‡" * summary.free_timing
    return summary.label + marks


POLICY = Column("policy", "", _policy)
TOTAL = Column("total", "cost", lambda s: s.total_cost.mean, about="geometric mean over the episodes")
RATIO = Column(
    "cost",
    "ratio",
    lambda s: s.cost_ratio and s.cost_ratio.mean,
    about="total cost / best known cost, geometric mean over the episodes",
)


def _largest(column: str, title: str, unit: str, about: str, scale: float = 1.0, drop: int = 0) -> Column:
    return Column(title, unit, lambda s: s.largest(column), scale, about=about, drop=drop)


ERRORS = (
    _largest("position_error_max", "pos max", "[mm]", "largest position error", 1e3),
    _largest("orientation_error_max", "ori max", "[mrad]", "largest orientation error", 1e3, drop=1),
    _largest("qdot_peak", "q̇ peak", "", "largest joint velocity, in rad/s or m/s", drop=2),
    Column(
        "q̈ peak",
        "",
        lambda s: s.largest("qddot_peak"),
        text=lambda s: number(s.largest("qddot_peak")) + " §" * (not s.first.acceleration_stated),
        about="largest joint acceleration, in rad/s² or m/s²; § no limit stated",
        drop=3,
    ),
)
TIMES = (
    Column("p50", "[µs]", lambda s: s.median("time_p50_us"), about="median time of a call after the first"),
    _largest("time_p99_us", "p99", "[µs]", "99th percentile of these times", drop=5),
    Column("misses", "", lambda s: s.total("deadline_misses"), about="such calls longer than Δt", drop=6),
)
PATH = (
    Column("path time", "[s]", lambda s: s.path_time, about="when the end of the path was reached, with free timing"),
    _largest(
        "path_position_error",
        "path err",
        "[mm]",
        "largest distance from the reference at the policy's own progress, with free timing",
        1e3,
    ),
)
CONTACTS = (
    Column("clearance", "[mm]", lambda s: s.smallest("clearance_min"), 1e3, about="smallest distance between bodies"),
    Column("stopped", "", lambda s: s.stopped, about="episodes in which bodies would have met"),
)
LOST = Column("lost", "", lambda s: s.lost, about="episodes in which the arm was lost")
EPISODES = Column("episodes", "", lambda s: s.episodes, about="number of episodes; more than one of a random scenario")
FOLLOWED = Column(
    "followed",
    "",
    lambda s: s.followed,
    text=lambda s: f"{s.followed} of {len(s.rows)}" if len(s.rows) > 1 else "yes" if s.followed else "no",
    about=f"errors of at most {1e3 * FOLLOWED_POSITION:g} mm and {1e3 * FOLLOWED_ORIENTATION:g} mrad in all steps",
)
STATUS = Column("solver", "status", lambda s: s.solver_status, about="the worst that the solver reported in any step")
#: The columns of the table of all policies.
COLUMNS = (
    POLICY,
    TOTAL,
    Column("tracking", "cost", lambda s: s.mean("tracking_cost"), drop=4),
    RATIO,
    *ERRORS,
    *PATH,
    *CONTACTS,
    *TIMES,
    FOLLOWED,
    STATUS,
)


def table(rows: Sequence[Row], skipped: Sequence[Skipped] = (), *, width: int = WIDTH) -> str:
    """The tables of all scenarios as plain text; notes name skipped policies, and columns that do not fit the width."""
    parts: list[str] = []
    absent: dict[str, None] = {}
    for scenario, summaries in by_scenario(rows).items():
        columns = fitting(COLUMNS, summaries, width)
        absent.update(dict.fromkeys(column.title for column in filled(COLUMNS, summaries) if column not in columns))
        parts.append(f"{heading(scenario, summaries)}\n{plain(columns, summaries, width)}")
        if spread := _spread(summaries):
            parts.append(f"{_score(summaries)} over the episodes of {scenario}\n{plain(spread, summaries, width)}")
    notes = remarks(rows)
    if absent:
        notes.append(f"left out at {width} characters a line: {', '.join(absent)}")
    notes += [f"skipped: {s.policy} in {s.scenario}: {s.reason}" for s in skipped]
    wrapped = (textwrap.fill(note, width, subsequent_indent="  ", break_on_hyphens=False) for note in notes)
    return "\n\n".join([*parts, "\n".join(wrapped)]).rstrip()


def readme(rows: Sequence[Row], skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> str:
    """The README of a folder of results, in Markdown."""
    out = ["# Results", ""]
    parameters = ["| scenario | policy | parameters |", "|---|---|---|"]
    for scenario, summaries in by_scenario(rows).items():
        out += [f"## {escaped(heading(scenario, summaries))}", "", markdown(COLUMNS, summaries), ""]
        if spread := _spread(summaries):
            out += [f"{_score(summaries).capitalize()} over the episodes:", "", markdown(spread, summaries), ""]
        for one in summaries:
            values = ", ".join(code(f"{name}={value}") for name, value in one.first.parameters.items()) or NOTHING
            values = values.replace("|", "\\|")  # nothing else has a meaning in code
            parameters.append(f"| {escaped(scenario)} | {escaped(one.label)} | {values} |")
    out += ["## Notes", "", *(f"- {escaped(note)}" for note in remarks(rows)), ""]
    if skipped:
        out += ["Skipped:", ""]
        out += [f"- {escaped(f'{s.policy} in {s.scenario}: {s.reason}')}" for s in skipped] + [""]
    out += ["## Parameters", "", *parameters, "", "## Conditions", "", f"- command: {code(command)}"]
    out += [f"- finished: {date:%Y-%m-%d %H:%M} UTC", *(f"- {escaped(one)}" for one in machines(rows))]
    out.append(
        "- Times are those of single calls on one thread, without the first call and without garbage collection."
    )
    return "\n".join(out) + "\n"


def heading(scenario: str, summaries: Sequence[Summary]) -> str:
    """Scenario, number of episodes and steps."""
    episodes = sorted({summary.episodes for summary in summaries})
    many = "" if episodes == [1] else f"{'–'.join(map(str, (episodes[0], episodes[-1])[: len(episodes)]))} episodes of "
    return f"{scenario}: {many}{summaries[0].first.steps} steps"


def _score(summaries: Sequence[Summary]) -> str:
    """The quantity in the table of several episodes: the cost ratio if it is known for all policies."""
    return "total cost" if any(summary.cost_ratio is None for summary in summaries) else "cost ratio"


def _spread(summaries: Sequence[Summary]) -> list[Column]:
    """The columns of the table of several episodes; those of matched pairs if there is one episode, or none."""
    beside = _beside_ideal() if any(summary.paired for summary in summaries) else []
    if all(summary.episodes == 1 for summary in summaries):
        return [POLICY, *beside] if beside else []
    ratio = _score(summaries) == "cost ratio"

    def column(title: str, value: Callable[[Spread], float]) -> Column:
        return Column(title, "", lambda s: value(s.cost_ratio if ratio and s.cost_ratio else s.total_cost))

    return [
        POLICY,
        EPISODES,
        column("geometric mean", lambda spread: spread.mean),
        column("median", lambda spread: spread.median),
        column("p90", lambda spread: spread.p90),
        column("worst", lambda spread: spread.worst),
        column("worst seed", lambda spread: spread.worst_seed),
        LOST,
        *beside,
    ]


def _beside_ideal() -> list[Column]:
    """The columns of matched pairs: cost ratio of the same policy on an ideal plant, and the factor of the cost."""

    def column(title: str, unit: str, value: Callable[[Paired], float | None], text: bool = False) -> Column:
        def interval(summary: Summary) -> str:
            return interval_text(summary.paired and (summary.paired.low, summary.paired.high))

        return Column(title, unit, lambda s: s.paired and value(s.paired), text=interval if text else None)

    return [
        column("ideal", "ratio", lambda pair: pair.cost_ratio),
        column("× ideal", "cost", lambda pair: pair.mean),
        column("95 %", "", lambda pair: pair.low, text=True),
    ]


def interval_text(ends: tuple[float, float] | None) -> str:
    """An interval: ``1.000 … 2.000``; a dash for none."""
    return " … ".join(map(number, ends)) if ends else NOTHING


def remarks(rows: Sequence[Row]) -> list[str]:
    """The notes below the tables."""
    summaries = summarise(rows)
    notes = [REFERENCE_NOTE] * any(is_reference(row.policy) for row in rows)
    notes += [STOP_NOTE] * any(row.steps_at_joint_limit for row in rows)
    notes += [STATED_NOTE] * (not all(row.acceleration_stated for row in rows))
    notes += [TIMING_NOTE] * any(summary.free_timing for summary in summaries)
    ratio = "cost ratio: total cost / best known cost, – where none is known; "
    ratio *= any(row.cost_ratio is not None for row in rows)
    notes.append(f"{ratio}p50, p99: time of a call after the first; misses: such calls longer than Δt")
    notes.append(
        "pos, ori: position and orientation error; q̇, q̈ peak: joint velocity and acceleration in rad/s and rad/s², in "
        "m/s and m/s² for prismatic joints"
    )
    small = f"{1e3 * FOLLOWED_POSITION:g} mm and {1e3 * FOLLOWED_ORIENTATION:g} mrad of error"
    notes.append(f"followed: at most {small} in all steps; solver status: the worst that the solver reported")
    if any(summary.stopped is not None for summary in summaries):
        notes.append(
            "clearance: smallest distance between bodies; stopped: episodes in which they would have met, and the arm "
            "stood still from then on"
        )
    if any(summary.episodes > 1 for summary in summaries):
        notes.append(
            "several episodes: costs and cost ratio are geometric means, errors, peaks, p99 and status the worst, p50 "
            "the median, misses the sum; times are those of episodes that were played alone; lost: episodes with more "
            f"than {1e3 * LOST_POSITION:g} mm or {LOST_ORIENTATION:g} rad of error at some time"
        )
    if any(row.noise_seed for row in rows):
        notes.append("costs of an episode are geometric means over its noise seeds; lost counts each of them")
    if any(summary.paired for summary in summaries):
        notes.append(
            "ideal: cost ratio of the same policy with an ideal plant; × ideal: its cost divided by that on the ideal "
            "plant with the same seed, geometric mean, and the interval of that over the seeds"
        )
    return notes + _beaten(rows)


def _beaten(rows: Sequence[Row]) -> list[str]:
    """The policies that beat a best known cost."""
    seeds: dict[tuple[str, str], list[int]] = {}
    for row in rows:
        if best_known.beaten(row):
            seeds.setdefault((row.policy, row.scenario), []).append(row.seed)
    return [
        f"{policy} beats the best known cost of {scenario}, seed {', '.join(map(str, better))}: bring the record up to "
        f"date with {best_known.UPDATE} --scenarios {scenario} --policies {policy}"
        for (policy, scenario), better in seeds.items()
    ]


def machines(rows: Sequence[Row]) -> list[str]:
    """The machines that rows were measured on, and a warning if there are several."""
    found = list({canonical(row.machine): row.machine for row in rows}.values())
    warning = ["The rows were measured on different machines: their times cannot be compared."]
    return [f"machine: {_machine(one)}" for one in found] + warning * (len(found) > 1)


def _machine(machine: Mapping[str, Any]) -> str:
    words = dict(machine)
    cpu, cores = words.pop("cpu", "unknown CPU"), words.pop("cores", "?")
    return f"{cpu}, {cores} cores, " + ", ".join(f"{name} {value}" for name, value in words.items())
