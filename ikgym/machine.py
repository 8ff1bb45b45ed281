"""The machine: its memory, checked before it runs out, and its cores, among which rows are shared out to threads.

Compiled kernels release the interpreter lock, so plain threads do. Threads of our own instead of numba's parallel
loops: those abort where two Python threads meet in them, or where a process forks after its first use, and both happen
in the life of an environment.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ikgym.exceptions import InvalidInputError

GIB = 2**30
# Less than this, in bytes, is not checked.
SMALL = 2**28
# Files of Linux: the memory available to all, and the limit and the use of a control group.
SYSTEM = Path("/proc/meminfo")
GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))

_pool: ThreadPoolExecutor | None = None
_limit: int | None = None


def check_memory(name: str, needed: int) -> None:
    """Checks that there is memory for something of so many bytes, whose name begins the message."""
    if needed <= SMALL:
        return
    left = available()
    if left is not None and needed > left:
        raise InvalidInputError(
            f"{name}: expected to fit into memory, but take about {gib(needed)}, and {gib(left)} are available."
        )


def of_rows(rows: int, shown: int, frames: int) -> int:
    """About how much memory N arms take, in bytes, by the numbers that a row shows and those of all nominal frames."""
    # Observations have copies: state, actions, bounds of the spaces. A row's generator takes the rest.
    return rows * (5 * 8 * shown + 1500) + 8 * frames


def gib(amount: int) -> str:
    """A number of bytes in words."""
    return f"{amount // GIB:,} GiB" if amount >= 100 * GIB else f"{amount / GIB:.1f} GiB"


def available() -> int | None:
    """The memory that this process can still take, in bytes; None where the system does not say."""
    known = []
    with contextlib.suppress(OSError, StopIteration, ValueError):
        lines = SYSTEM.read_text().splitlines()
        known.append(next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:")))
    with contextlib.suppress(OSError, ValueError):  # "max" is no number: no bound
        most, taken = (int(file.read_text()) for file in GROUP)
        known.append(max(most - taken, 0))
    return min(known, default=None)


def cores() -> int:
    """The number of cores that this process may use."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return there if _limit is None else min(there, _limit)


def limit(number: int | None) -> None:
    """Has this process use at most so many cores, None for all: a cluster counts them, and binds nobody to them."""
    global _limit
    _limit = number


def in_chunks(work: Callable[[int, int], object], rows: int, grain: int) -> None:
    """Runs ``work(start, stop)`` over all rows, in as many threads as there are cores; `grain` rows are worth one."""
    # The cores are counted only where there is work for more than one: asking for them takes time, too.
    chunks = rows // max(grain, 1)
    chunks = min(chunks, cores()) if chunks > 1 else chunks
    if chunks <= 1:
        work(0, rows)
        return
    bounds = [rows * i // chunks for i in range(chunks + 1)]
    others = [_threads().submit(work, bounds[i], bounds[i + 1]) for i in range(1, chunks)]
    try:
        work(bounds[0], bounds[1])
    finally:
        for future in others:
            future.result()


def _threads() -> ThreadPoolExecutor:
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(max_workers=max(cores() - 1, 1), thread_name_prefix="ikgym")
    return _pool


def _forget() -> None:
    """A forked child has the pool but none of its threads."""
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
