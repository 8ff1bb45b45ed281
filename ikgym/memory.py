"""How much memory there is, and a clear word instead of a machine that runs out of it."""

from __future__ import annotations

import os
from pathlib import Path

from ikgym.exceptions import InvalidInputError

GIB = 2**30
# What takes less, in bytes, is never asked about.
SMALL = 2**28
# Where the system says what is available to all, and what a group of processes may take and has taken.
SYSTEM = Path("/proc/meminfo")
GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))


def afford(what: str, needed: int) -> None:
    """Insists that there is memory for something.

    Args:
        what: What it is for, as the message begins.
        needed: About how much it takes, in bytes.

    Raises:
        InvalidInputError: Less is available; the message has both in GiB.
    """
    if needed <= SMALL:
        return
    left = available()
    if left is not None and needed > left:
        raise InvalidInputError(
            f"{what}: expected what fits into memory, got what takes about {gib(needed)}, where {gib(left)} are "
            "available."
        )


def of_rows(rows: int, shown: int, frames: int) -> int:
    """About how much memory N arms take, in bytes.

    Args:
        rows: N.
        shown: Numbers that a row shows after a step.
        frames: Numbers in the nominal frames of all rows.
    """
    # What is shown has copies: state, actions, bounds of the spaces. A row's generator takes the rest.
    return rows * (5 * 8 * shown + 1500) + 8 * frames


def gib(amount: int) -> str:
    """An amount of memory in words.

    Args:
        amount: In bytes.
    """
    return f"{amount // GIB:,} GiB" if amount >= 100 * GIB else f"{amount / GIB:.1f} GiB"


def available() -> int | None:
    """The memory that this process can still take, in bytes; None where the system does not say."""
    known = [amount for amount in (_of_system(), _of_group()) if amount is not None]
    return min(known, default=None)


def _of_system() -> int | None:
    try:
        lines = SYSTEM.read_text().splitlines()
        return next(1024 * int(line.split()[1]) for line in lines if line.startswith("MemAvailable:"))
    except (OSError, StopIteration, ValueError):
        pass
    try:  # no Linux: all that is built in
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None


def _of_group() -> int | None:
    try:
        most, taken = (int(file.read_text()) for file in GROUP)  # "max" is no number: no bound
    except (OSError, ValueError):
        return None
    return max(most - taken, 0)
