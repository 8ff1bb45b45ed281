"""The printed table, and the README of a folder of results."""

from __future__ import annotations

import datetime
import re
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from baselines.canonical import canonical
from baselines.evaluation.jobs import Skipped
from baselines.evaluation.metrics import FOLLOWED_ORIENTATION, FOLLOWED_POSITION, LOST_ORIENTATION, LOST_POSITION, Row
from baselines.evaluation.summary import Record, by_scenario, summarise
from baselines.evaluation.table import NOTHING, Column, filled, fitting, number, plain
from baselines.oracle import best_known

#: Characters that a line of the printed tables may have, and one of a README.
WIDTH, WIDE = 120, 250
REFERENCE_NOTE = "* reference: has privileged information"
STOP_NOTE = "† a joint was at a stop, a limit of its coordinate"
STATED_NOTE = "§ no acceleration limit stated for some joint: the peak is the one that occurred"
TIMING_NOTE = (
    "‡ free timing: slower where limits bind; path time: when the end of the path was reached, – if it was not; path "
    "err: largest distance from the reference at the policy's own progress; all else is on the clock of the scenario"
)
RATIO_NOTE = "cost ratio: total cost / best known cost, – where none is known"
TIMES_NOTE = "p50, p99: time of a call after the first; misses: such calls longer than Δt"
ERRORS_NOTE = (
    "pos, ori: position and orientation error; q̇, q̈ peak: joint velocity and acceleration in rad/s and rad/s², in m/s "
    "and m/s² for prismatic joints"
)
FOLLOWED_NOTE = (
    f"followed: at most {1e3 * FOLLOWED_POSITION:g} mm and {1e3 * FOLLOWED_ORIENTATION:g} mrad of error in all steps; "
    "solver status: the worst that the solver reported"
)
CONTACTS_NOTE = (
    "clearance: smallest distance between bodies; stopped: episodes in which they would have met, and the arm stood "
    "still from then on"
)
SEVERAL_NOTE = (
    "several episodes: costs and cost ratio are geometric means, errors, peaks, p99 and status the worst, p50 the "
    "median, misses the sum; times are those of episodes that were played alone; lost: episodes with more than "
    f"{1e3 * LOST_POSITION:g} mm or {LOST_ORIENTATION:g} rad of error at some time"
)
NOISE_NOTE = "costs of an episode are geometric means over its noise seeds; lost counts each of them"
IDEAL_NOTE = (
    "ideal: cost ratio of the same policy with an ideal plant; × ideal: its cost divided by that on the ideal plant "
    "with the same seed, geometric mean, and the interval of that over the seeds"
)


def _marked(line: Record) -> str:
    """The policy with its marks, see the notes."""
    marks = {" *": line["reference"], " †": line["steps_at_joint_limit"], " ‡": line["free_timing"]}
    return str(line["policy"]) + "".join(mark for mark, applies in marks.items() if applies)


def _followed(line: Record) -> str:
    if line["rows"] == 1:
        return "yes" if line["followed"] else "no"
    return f"{line['followed']} of {line['rows']}"


def interval(line: Record, prefix: str = "") -> str:
    """An interval: ``1.000 … 2.000``; a dash for none."""
    low, high = line[f"{prefix}low"], line[f"{prefix}high"]
    return NOTHING if low is None else f"{number(low)} … {number(high)}"


POLICY = Column("policy", "", "policy", text=_marked)
TOTAL = Column("total", "cost", "total_cost", "geometric mean over the episodes")
RATIO = Column("cost", "ratio", "cost_ratio", "total cost / best known cost, geometric mean over the episodes")
ERRORS = (
    Column("pos max", "[mm]", "position_error_mm", "largest position error"),
    Column("ori max", "[mrad]", "orientation_error_mrad", "largest orientation error", drop=1),
    Column("q̇ peak", "", "qdot_peak", "largest joint velocity, in rad/s or m/s", drop=2),
    Column(
        *("q̈ peak", "", "qddot_peak", "largest joint acceleration, in rad/s² or m/s²; § no limit stated"),
        drop=3,
        text=lambda line: number(line["qddot_peak"]) + " §" * (not line["first"].acceleration_stated),
    ),
)
TIMES = (
    Column("p50", "[µs]", "time_p50_us", "median time of a call after the first"),
    Column("p99", "[µs]", "time_p99_us", "99th percentile of these times", drop=5),
    Column("misses", "", "deadline_misses", "such calls longer than Δt", drop=6),
)
PATH = (
    Column("path time", "[s]", "path_time_s", "when the end of the path was reached, with free timing"),
    Column(
        *("path err", "[mm]", "path_error_mm"),
        "largest distance from the reference at the policy's own progress, with free timing",
    ),
)
CONTACTS = (
    Column("clearance", "[mm]", "clearance_mm", "smallest distance between bodies"),
    Column("stopped", "", "stopped", "episodes in which bodies would have met"),
)
LOST = Column("lost", "", "lost", "episodes in which the arm was lost")
EPISODES = Column("episodes", "", "episodes", "number of episodes; more than one of a random scenario")
FOLLOWED = Column("followed", "", "followed", FOLLOWED_NOTE.partition(";")[0], text=_followed)
STATUS = Column("solver", "status", "solver_status", "the worst that the solver reported in any step")
#: The columns of the table of all policies; of the table of several episodes; and of the comparison with ideal plants.
COLUMNS = (
    *(POLICY, TOTAL, Column("tracking", "cost", "tracking_cost", drop=4), RATIO, *ERRORS, *PATH, *CONTACTS, *TIMES),
    *(FOLLOWED, STATUS),
)
SPREAD = (
    EPISODES,
    Column("geometric mean", "", "mean"),
    Column("median", "", "median"),
    Column("p90", "", "p90"),
    Column("worst", "", "worst"),
    Column("worst seed", "", "worst_seed"),
    LOST,
)
BESIDE_IDEAL = (
    Column("ideal", "ratio", "ideal_cost_ratio"),
    Column("× ideal", "cost", "times_ideal"),
    Column("95 %", "", "times_ideal_low", text=lambda line: interval(line, "times_ideal_")),
)


def table(rows: Sequence[Row], skipped: Sequence[Skipped] = (), *, width: int = WIDTH) -> str:
    """The tables of all scenarios as plain text; notes name skipped policies, and columns that do not fit the width."""
    parts: list[str] = []
    absent: dict[str, None] = {}
    for scenario, lines in by_scenario(rows).items():
        columns = fitting(COLUMNS, lines, width)
        absent.update(dict.fromkeys(column.title for column in filled(COLUMNS, lines) if column not in columns))
        parts.append(f"{heading(scenario, lines)}\n{plain(columns, lines, width)}")
        spread = SPREAD * any(line["episodes"] > 1 for line in lines)
        spread += BESIDE_IDEAL * any(line["times_ideal"] is not None for line in lines)
        if spread:
            over = f"{lines[0]['quantity']} over the episodes of {scenario}"
            parts.append(f"{over}\n{plain((POLICY, *spread), lines, width)}")
    notes = remarks(rows, skipped)
    if absent:
        notes.append(f"left out at {width} characters a line: {', '.join(absent)}")
    wrapped = (textwrap.fill(note, width, subsequent_indent="  ", break_on_hyphens=False) for note in notes)
    return "\n\n".join([*parts, "\n".join(wrapped)]).rstrip()


def readme(rows: Sequence[Row], skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> str:
    """The README of a folder of results: tables, parameters and conditions as one block of text in Markdown."""
    conditions = [f"command: {command}", f"finished: {date:%Y-%m-%d %H:%M} UTC", *machines(rows)]
    text = "\n\n".join([table(rows, skipped, width=WIDE), *map("\n".join, (parameters(summarise(rows)), conditions))])
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"# Results\n\n{fence}text\n{text}\n{fence}\n"


def heading(scenario: str, lines: Sequence[Record]) -> str:
    """Scenario, number of episodes and steps."""
    episodes = sorted({line["episodes"] for line in lines})
    many = "" if episodes == [1] else f"{'–'.join(map(str, (episodes[0], episodes[-1])[: len(episodes)]))} episodes of "
    return f"{scenario}: {many}{lines[0]['steps']} steps"


def parameters(lines: Sequence[Record]) -> list[str]:
    """All parameters of each policy in each scenario."""
    return [
        f"{line['policy']} in {line['scenario']}: "
        + (", ".join(f"{name}={value}" for name, value in line["first"].parameters.items()) or NOTHING)
        for line in lines
    ]


def remarks(rows: Sequence[Row], skipped: Sequence[Skipped] = ()) -> list[str]:
    """The notes below the tables."""
    lines = summarise(rows)
    notes = {
        REFERENCE_NOTE: any(line["reference"] for line in lines),
        STOP_NOTE: any(line["steps_at_joint_limit"] for line in lines),
        STATED_NOTE: not all(row.acceleration_stated for row in rows),
        TIMING_NOTE: any(line["free_timing"] for line in lines),
        RATIO_NOTE: any(row.cost_ratio is not None for row in rows),
        TIMES_NOTE: True,
        ERRORS_NOTE: True,
        FOLLOWED_NOTE: True,
        CONTACTS_NOTE: any(line["stopped"] is not None for line in lines),
        SEVERAL_NOTE: any(line["episodes"] > 1 for line in lines),
        NOISE_NOTE: any(row.noise_seed for row in rows),
        IDEAL_NOTE: any(line["times_ideal"] is not None for line in lines),
    }
    told = [note for note, applies in notes.items() if applies]
    return [*told, *_beaten(rows), *(f"skipped: {one.policy} in {one.scenario}: {one.reason}" for one in skipped)]


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
