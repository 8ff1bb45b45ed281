"""Threads: rows of a compiled kernel are shared out to the cores.

Compiled kernels release the interpreter lock, so plain threads do. Numba's parallel loops are not used: they
abort where two Python threads meet in them, or where a process forks after its first use, and both happen
in the life of an environment.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

_pool: ThreadPoolExecutor | None = None
_limit: int | None = None


def count_cores() -> int:
    """The number of cores that this process may use."""
    there = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return there if _limit is None else min(there, _limit)


def limit_cores(number: int | None) -> None:
    """Limits the cores that this process uses, None for all: a cluster counts cores, and binds nobody to them."""
    global _limit
    _limit = number


def in_chunks(work: Callable[[int, int], object], rows: int, grain: int) -> None:
    """Runs ``work(start, stop)`` over all rows, in as many threads as there are cores; `grain` rows are worth one."""
    # The cores are counted only where there is work for more than one: asking for them takes time, too.
    chunks = rows // max(grain, 1)
    chunks = min(chunks, count_cores()) if chunks > 1 else chunks
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
        _pool = ThreadPoolExecutor(max_workers=max(count_cores() - 1, 1), thread_name_prefix="ikgym")
    return _pool


def _forget() -> None:
    """A forked child has the pool but none of its threads."""
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)
