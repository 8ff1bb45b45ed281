"""The printed table, and the README of a folder of results."""

from __future__ import annotations

import datetime
import itertools
import json
import re
import textwrap
from collections.abc import Sequence
from typing import Any

import pandas as pd

from baselines.evaluation.columns import FOLLOWED_NOTE, NOTHING, POLICIES, SPREAD, WITH_IDEAL, columns
from baselines.evaluation.metrics import AT_MARGIN, LOST_ORIENTATION, LOST_POSITION, Skipped, lacks_margin
from baselines.evaluation.summary import escape_names
from baselines.evaluation.table import plain
from baselines.oracle import best_known
from ikgym.exceptions import printable

#: Characters that a line of the printed tables may have, and one of a README.
WIDTH, WIDE = 120, 250
REFERENCE_NOTE = "* reference: has privileged information"
STOP_NOTE = "† a joint was at a stop, a limit of its coordinate"
STATED_NOTE = "§ no acceleration limit stated for some joint: the peak is the one that occurred"
TIMING_NOTE = (
    "‡ free timing: slower where limits bind; path time: when the end of the path was reached, – if it was not; path "
    "err: largest distance from the reference at the progress of the policy; all else is on the clock of the scenario"
)
RATIO_NOTE = "cost ratio: total cost / best known cost, – where none is known"
TIMES_NOTE = "p50, p99: time of a call after the first; misses: such calls longer than Δt"
ERRORS_NOTE = (
    "pos, ori: position and orientation error; q̇, q̈ peak: joint velocity and acceleration in rad/s and rad/s², in m/s "
    "and m/s² for prismatic joints"
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


def table(lines: pd.DataFrame, skipped: Sequence[Skipped] = (), *, width: int = WIDTH) -> str:
    """The tables of all scenarios as plain text, the lowest cost first.

    Notes name skipped policies, and columns that do not fit the width.

    Args:
        lines: See :func:`baselines.evaluation.summary.summarise`.
        skipped: Policies that were skipped.
        width: Characters of a line.
    """
    lines = escape_names(lines)
    parts: list[str] = []
    absent: dict[str, None] = {}
    for scenario, every in lines.groupby("scenario", sort=False):
        here = every.sort_values("total_cost", kind="stable")
        text, left_out = plain(columns(POLICIES, here), here, width)
        absent.update(dict.fromkeys(column.title for column in left_out))
        parts.append(f"{heading(here)}\n{text}")
        spread = SPREAD * bool((here.episodes > 1).any()) + WITH_IDEAL * bool(here.times_ideal.notna().any())
        if spread:
            text, _ = plain(columns(("label", *spread), here), here, width)
            parts.append(f"{here.quantity.iloc[0]} over the episodes of {scenario}\n{text}")
    notes = remarks(lines, skipped)
    if absent:
        notes.append(f"left out at {width} characters a line: {', '.join(absent)}")
    wrapped = (textwrap.fill(note, width, subsequent_indent="  ", break_on_hyphens=False) for note in notes)
    return "\n\n".join([*parts, "\n".join(wrapped)]).rstrip()


def readme(lines: pd.DataFrame, skipped: Sequence[Skipped] = (), *, command: str, date: datetime.datetime) -> str:
    """The README of a folder of results: tables, parameters and conditions as one block of text in Markdown."""
    conditions = [f"command: {command}", f"finished: {date:%Y-%m-%d %H:%M} UTC", *machines(lines)]
    text = "\n\n".join([table(lines, skipped, width=WIDE), *map("\n".join, (parameters(lines), conditions))])
    text = printable(text, "\n")
    fence = "`" * max(3, 1 + max(map(len, re.findall("`+", text)), default=0))
    return f"# Results\n\n{fence}text\n{text}\n{fence}\n"


def heading(lines: pd.DataFrame) -> str:
    """Scenario, number of episodes and steps, of lines of one scenario."""
    fewest, most = lines.episodes.min(), lines.episodes.max()
    many = "" if most == 1 else f"{most} episodes of " if fewest == most else f"{fewest}–{most} episodes of "
    return f"{lines.scenario.iloc[0]}: {many}{lines.steps.iloc[0]} steps"


def parameters(lines: pd.DataFrame) -> list[str]:
    """All parameters of each policy in each scenario."""
    return [
        printable(
            f"{line.label} in {line.scenario}: "
            + (", ".join(f"{name}={value}" for name, value in line.parameters.items()) or NOTHING)
        )
        for line in lines.itertuples()
    ]


def remarks(lines: pd.DataFrame, skipped: Sequence[Skipped] = ()) -> list[str]:
    """The notes below the tables."""
    notes = {
        REFERENCE_NOTE: lines.reference.any(),
        STOP_NOTE: lines.steps_at_joint_limit.any(),
        STATED_NOTE: not lines.stated.all(),
        TIMING_NOTE: lines.free_timing.any(),
        RATIO_NOTE: (lines.unknown < lines.rows).any(),
        TIMES_NOTE: True,
        ERRORS_NOTE: True,
        FOLLOWED_NOTE: True,
        CONTACTS_NOTE: lines.stopped.notna().any(),
        SEVERAL_NOTE: (lines.episodes > 1).any(),
        NOISE_NOTE: lines.noisy.any(),
        IDEAL_NOTE: lines.times_ideal.notna().any(),
    }
    beaten = [
        f"{policy} beats the best known cost of {scenario}, seed {', '.join(map(str, seeds))}: bring the record up to "
        f"date with {best_known.UPDATE} --scenarios {scenario} --policies {policy}"
        for (policy, scenario), some in lines.groupby(["policy", "scenario"], sort=False)
        if (seeds := [*itertools.chain(*some.beaten)])
    ]
    known = {(one.scenario, one.label, one.text): one.position_error_mm for one in lines.itertuples()}
    warnings = [
        f"warning: {label} loses the path of {scenario} where commands come later by the delay margin of its plant: "
        f"{later:.3g} mm instead of {error:.3g} mm; it may on the real arm, too"
        for (scenario, label, text), error in known.items()
        if (later := known.get((scenario + AT_MARGIN, label, text))) is not None
        and lacks_margin(1e-3 * error, 1e-3 * later)
    ]
    left_out = [f"skipped: {one.policy} in {one.scenario}: {one.reason}" for one in skipped]
    return [*(note for note, applies in notes.items() if applies), *beaten, *warnings, *left_out]


def machines(lines: pd.DataFrame) -> list[str]:
    """The machines that episodes were measured on, and a warning if there are several."""
    found = list(dict.fromkeys(itertools.chain(*lines.machines)))
    warning = ["The rows were measured on different machines: their times cannot be compared."]
    return [f"machine: {_machine(json.loads(one))}" for one in found] + warning * (len(found) > 1)


def _machine(machine: dict[str, Any]) -> str:
    cpu, cores = machine.pop("cpu", "unknown CPU"), machine.pop("cores", "?")
    return f"{cpu}, {cores} cores, " + ", ".join(f"{name} {value}" for name, value in machine.items())
