"""Checks that there is memory for something, before a machine runs out of it."""

from __future__ import annotations

import contextlib
from pathlib import Path

from ikgym.exceptions import InvalidInputError

GIB = 2**30
# Less than this, in bytes, is not checked.
SMALL = 2**28
# Files of Linux: the memory available to all, and the limit and the use of a control group.
SYSTEM = Path("/proc/meminfo")
GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))


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
