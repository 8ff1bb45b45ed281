"""The rows of a batch shared out to threads."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from baselines.policy_kernels import Solution
from ikgym.kernels.threads import in_chunks

#: Which threads work on a share of a batch. Calls within them are not shared out further: threads of one pool that
#: wait for others of it wait forever.
_sharing = threading.local()


def fits_one_call(rows: int, grain: int) -> bool:
    """Whether B rows are solved in one call; ``grain`` rows are worth a thread."""
    return rows < 2 * grain or getattr(_sharing, "now", False)


def divide_rows(solve: Callable[[slice], Solution], rows: int, grain: int) -> Solution:
    """The solution of all rows, each thread solving a part of at least ``grain`` rows."""
    parts: dict[int, Solution] = {}

    def work(start: int, stop: int) -> None:
        _sharing.now = True
        try:
            parts[start] = solve(slice(start, stop))
        finally:
            _sharing.now = False

    in_chunks(work, rows, grain)
    qdots, memories, status, iterations = zip(*(parts[start] for start in sorted(parts)), strict=True)
    memory = tuple(np.concatenate(arrays) for arrays in zip(*memories, strict=True))
    return Solution(np.concatenate(qdots), memory, np.concatenate(status), np.concatenate(iterations))
