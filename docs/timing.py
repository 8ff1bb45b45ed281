"""Times of calls on a noisy machine."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Hashable, Mapping
from typing import TypeVar

Call = Callable[[], object]
Name = TypeVar("Name", bound=Hashable)


def medians(calls: Mapping[Name, Call], rounds: int = 15, seconds: float = 0.05) -> dict[Name, float]:
    """The median time of each call in [s].

    The calls take turns, round by round, so that a slow period affects all alike. Each is made once before anything is
    timed.

    Args:
        calls: The calls by name.
        rounds: Turns of each call.
        seconds: Approximate length of a turn in [s], at least one call.
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
