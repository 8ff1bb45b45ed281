"""How long the leaderboard takes on so many cores, worked out from the measured times of its units.

``python -m docs.cluster`` measures them, ``python -m docs.tables`` writes the last paragraph of the page.
"""

from __future__ import annotations

import datetime
import heapq
import json
import sys
import textwrap
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from baselines.canonical import one_line, rounded, with_list
from baselines.evaluation.machine import describe
from baselines.evaluation.pages import sets, tuning
from baselines.evaluation.pages.entries import playing, shipped, solvers
from baselines.evaluation.pages.measure import plan
from baselines.evaluation.runner import play
from baselines.evaluation.units import BLOCK, Unit, units
from baselines.files import write
from ikgym import parallel

FILE = Path(__file__).with_suffix(".json")
CORES = (1, 100, 1000)
#: Letters in a line of the page.
WIDTH = 120


class Group(NamedTuple):
    """What the leaderboard plays of a policy in a set of episodes.

    Attributes:
        policy: Its label.
        episodes: The name of the set.
        units: What a cluster plays.
        unit: The first of them, in [s] of a processor.
        timed: All episodes that are timed on the local machine, likewise.
    """

    policy: str
    episodes: str
    units: int
    unit: float
    timed: float


def measured() -> Iterator[Group]:
    """Plays the first unit of each group on one core."""
    everyone = [*shipped(), *solvers(tuning.of(sets.MAIN).settings)]
    for name in sets.leaderboard():
        for policy, jobs in plan(name, playing(name, everyone)).items():
            away = units((job for job in jobs if not job.timed), BLOCK)
            here = units(job for job in jobs if job.timed)
            yield Group(policy, name, len(away), _seconds(away), rounded(len(here) * _seconds(here)))


def _seconds(some: Sequence[Unit]) -> float:
    """The time of a processor for the first unit, once everything is compiled: other work does not add to that."""
    if not some:
        return 0.0
    play(some[0].jobs[:1])
    before = time.process_time()
    play(some[0].jobs)
    return rounded(time.process_time() - before)


def read() -> tuple[dict[str, object], list[Group]]:
    """What was measured, and when and on what."""
    content = json.loads(FILE.read_text(encoding="utf-8"))
    return content, [Group(**group) for group in content.pop("groups")]


def makespan(times: Iterable[float], cores: int) -> float:
    """When the last unit is done if each goes, in their order, to the core that is free first, in [s]."""
    free = [0.0] * cores
    for one in times:
        heapq.heapreplace(free, free[0] + one)
    return max(free)


def paragraph() -> str:
    """The last paragraph of the page."""
    about, groups = read()
    every = [group.unit for group in groups for _ in range(group.units)]
    times = [makespan(every, cores) for cores in CORES]
    shown = ", ".join(f"{duration(one)} on {cores:,}" for cores, one in zip(CORES[1:], times[1:], strict=True))
    longest = max((group for group in groups if group.units), key=lambda group: group.unit)
    timed = sum(group.timed for group in groups)
    text = (
        f"The whole leaderboard is {len(every):,} units of at most {BLOCK} episodes, beside the episodes that are "
        f"timed. The first unit of each policy in each set was measured on {about['date']} on one core "
        f"({about['cpu']}; processor time, everything compiled), and the others count as much. Where each unit goes "
        f"to the core that is free first, they take {duration(times[0])} on 1 core, {shown}: "
        f"{times[0] / times[1]:.0f} and {times[0] / times[2]:.0f} times as fast. No number of cores goes below the "
        f"longest unit, {duration(longest.unit)} of `{longest.policy}` on `{longest.episodes}`; smaller blocks would. "
        "To each of these comes what is timed on the local machine, one episode after the other: "
        f"{duration(timed)}, whatever the number of cores, so that the whole takes "
        f"{', '.join(duration(one + timed) for one in times)}. Not counted are the start of the workers, the "
        "compilation on each node where no cache is shared, and plots and pages."
    )
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


def duration(seconds: float) -> str:
    """A time in words."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def main() -> None:
    """Measures all groups, and writes them."""
    about = {"date": datetime.datetime.now(datetime.UTC).date().isoformat(), "cpu": describe()["cpu"]}
    parallel.limit(1)
    groups = []
    for group in measured():
        print(*group, file=sys.stderr)
        groups.append(one_line(group._asdict()))
    write(FILE, with_list(about, "groups", groups).encode() + b"\n")


if __name__ == "__main__":
    main()
