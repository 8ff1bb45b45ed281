"""How long the leaderboard takes on so many cores, worked out from the times of its own policies."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from baselines.evaluation.pages import sets
from baselines.evaluation.pages.entries import TIMED
from baselines.evaluation.pages.measurement import Measurement
from baselines.evaluation.units import BLOCK

PAGES = Path(__file__).parent
CORES = (1, 100, 1000)


class Work(NamedTuple):
    """Work of the leaderboard, in [s] on one core.

    Attributes:
        units: What a cluster does, a time for each block of seeds.
        names: Policy and scenario of each of them.
        timed: What is timed on the local machine, one after the other.
        unknown: Units of policies that were never timed, which are left out.
    """

    units: list[float]
    names: list[str]
    timed: float
    unknown: int


def work(measurement: Measurement) -> Work:
    """The units of a measurement, whose episodes take steps × the median time of a call."""
    calls = {line.label: line.time_p50_us for line in measurement.sections[0].lines}
    out: list[float] = []
    names: list[str] = []
    timed, unknown = 0.0, 0
    for section in measurement.sections:
        steps = sets.get(section.name).steps
        for line in section.lines:
            call = calls.get(line.label)
            if call is None:
                unknown += len(line.cost)
                continue
            episode = 1e-6 * call * steps
            for _ in line.cost:
                clocked = min(TIMED, line.episodes) if line.timed else 0
                timed += clocked * episode
                blocks = list(_blocks(line.episodes - clocked))
                out += [size * episode for size in blocks]
                names += [f"`{line.label}` on `{section.name}`"] * len(blocks)
    return Work(out, names, timed, unknown)


def _blocks(episodes: int) -> Iterator[int]:
    for first in range(0, episodes, BLOCK):
        yield min(BLOCK, episodes - first)


def makespan(units: Iterable[float], cores: int) -> float:
    """When the last unit is done if each goes, in their order, to the core that is free first, in [s]."""
    free = [0.0] * cores
    for unit in units:
        heapq.heapreplace(free, free[0] + unit)
    return max(free)


def paragraph() -> str:
    """The last paragraph of the page."""
    measurement = Measurement.load(PAGES / "leaderboard.json")
    done = work(measurement)
    times = [makespan(done.units, cores) for cores in CORES]
    longest = max(range(len(done.units)), key=done.units.__getitem__)
    shown = ", ".join(f"{duration(time)} on {cores:,}" for cores, time in zip(CORES[1:], times[1:], strict=True))
    return (
        f"The whole leaderboard is {len(done.units):,} units of at most {BLOCK} episodes, beside the episodes that are "
        f"timed. With the median times of calls in leaderboard.json (cpu {measurement.machine['cpu']}), and each unit "
        f"handed to the core that is free first, the units take {duration(times[0])} on 1 core, {shown}: "
        f"{times[0] / times[1]:.0f} and {times[0] / times[2]:.0f} times as fast. No number of cores goes below the "
        f"longest unit, {duration(done.units[longest])} of {done.names[longest]}. To each of these comes what is "
        f"timed on the local machine, one episode after the other: {duration(done.timed)}, whatever the number of "
        "cores. Not counted are the start of the workers and the compilation on each node, and that episodes of a "
        "unit are played together, which takes less time for each than single calls do; left out are "
        f"{done.unknown} units of policies that were never timed."
    )


def duration(seconds: float) -> str:
    """A time in words."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
