"""Times of calls that are worth comparing: medians of interleaved rounds."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

Call = Callable[[], object]
Name = TypeVar("Name", bound=Hashable)


def medians(calls: Mapping[Name, Call], rounds: int = 15, seconds: float = 0.05) -> dict[Name, float]:
    """The median time of each call in [s].

    Machines are noisy: what is compared takes turns, round by round, so that a slow period affects all alike.

    Args:
        calls: What to time, by name. Each is called once before anything counts.
        rounds: How often everything has its turn.
        seconds: About how long a turn of one call lasts; never less than one call.
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


def _time(call: Call, repeats: int) -> float:
    begin = time.perf_counter()
    for _ in range(repeats):
        call()
    return (time.perf_counter() - begin) / repeats
