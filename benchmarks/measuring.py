"""How speed is measured: the sizes of the tables, and medians of interleaved calls."""

from __future__ import annotations

import dataclasses
import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

Call = Callable[[], object]
Name = TypeVar("Name", bound=Hashable)


@dataclasses.dataclass(frozen=True)
class Effort:
    """The size of a run.

    Args:
        rounds: Turns of each call that is compared.
        seconds: About how long a turn lasts, at least one call, in [s].
        rows: Sizes N of vector environments.
        steps: Steps along which `predict` is timed.
        grids: Horizons HL, in grid points with the present one, at which solvers are compared.
        states: States at which they are compared.
        solves: Turns of each solver at each of these states.
        lead: Steps before each of these states, in which solvers warm up and are not timed.
        poses: Poses whose inverse kinematics is measured.
    """

    rounds: int = 15
    seconds: float = 0.05
    rows: tuple[int, ...] = (64, 1024, 16384)
    steps: int = 1000
    grids: tuple[int, ...] = (3, 30)
    states: int = 5
    solves: int = 7
    lead: int = 3
    poses: int = 10_000


FULL = Effort()
#: Shows that everything runs; its figures mean nothing.
QUICK = Effort(rounds=1, seconds=0.0, rows=(3,), steps=3, grids=(3,), states=1, solves=1, lead=1, poses=3)


def medians(calls: Mapping[Name, Call], rounds: int = 15, seconds: float = 0.05) -> dict[Name, float]:
    """The median time of each call in [s], over some turns of about so many seconds, of at least one call.

    Machines are noisy: the calls take turns, round by round, so that a slow period affects all alike. Each is made once
    before anything is timed.
    """
    repeats = {}
    for name, call in calls.items():
        call()
        repeats[name] = max(1, int(seconds / max(_time(call, 1), 1e-9)))
    times: dict[Name, list[float]] = {name: [] for name in calls}
    for _ in range(rounds):
        for name, call in calls.items():
            times[name].append(_time(call, repeats[name]))
    return {name: statistics.median(values) for name, values in times.items()}


def per_item(calls: Mapping[str, tuple[Call, int]], effort: Effort) -> dict[str, tuple[float | None, ...]]:
    """Rows of a table of calls with their numbers of items: the time of an item in [µs], and that over the first's."""
    times = medians({name: call for name, (call, _) in calls.items()}, effort.rounds, effort.seconds)
    each = {name: t / calls[name][1] for name, t in times.items()}
    first = next(iter(each.values()))
    return {name: (1e6 * t, t / first) for name, t in each.items()}


def _time(call: Call, repeats: int) -> float:
    begin = time.perf_counter()
    for _ in range(repeats):
        call()
    return (time.perf_counter() - begin) / repeats
