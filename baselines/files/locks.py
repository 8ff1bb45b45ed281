"""One process at a time writes into a folder; the operating system frees the lock of one that has died."""

from __future__ import annotations

import contextlib
import errno
import logging
import os
import pathlib
import sys
import time
from collections.abc import Iterator

from baselines.files import ResultsError

logger = logging.getLogger("ikgym")

#: The file in a folder that is locked. It holds the number of the process that has it, and goes with the lock.
NAME = ".lock"
# Seconds between two attempts of whoever waits.
_PAUSE = 0.02
# Where the byte is that is locked: on Windows nobody else may read what is, and the number should be read.
_BYTE = 2**20


@contextlib.contextmanager
def locked(folder: pathlib.Path, patience: float = 0.0) -> Iterator[None]:
    """Keeps a folder for this process.

    Args:
        folder: It is made if it is not there.
        patience: How long to wait for another one to be done with it, in [s].

    Raises:
        ResultsError: Another process, or another call in this one, still writes into it; it cannot be written.
    """
    file = folder / NAME
    try:
        folder.mkdir(parents=True, exist_ok=True)
        number = _waited(file, time.monotonic() + patience)
    except OSError as e:
        raise ResultsError(f"Cannot write into {folder}: {e.strerror or e}.") from None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows removes no file that is open: it stays, and hinders nobody
            file.unlink()
        os.close(number)


def _waited(file: pathlib.Path, until: float) -> int:
    """The descriptor of the file, locked as soon as it is free."""
    while True:
        try:
            return _open(file)
        except ResultsError:
            if time.monotonic() >= until:
                raise
            time.sleep(_PAUSE)


def _open(file: pathlib.Path) -> int:
    """The descriptor of the file, locked."""
    while True:
        number = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            if not _lock(number):
                holder = os.pread(number, 20, 0).decode(errors="replace") if hasattr(os, "pread") else ""
                who = f"process {holder}" if holder.isdecimal() else "another process"
                raise ResultsError(
                    f"{file.parent} is in use: {who} writes into it. Wait until it has ended, or choose another folder."
                )
            # Whoever had it before may have removed the file after it was opened here.
            if file.exists() and os.path.samestat(os.fstat(number), file.stat()):
                os.ftruncate(number, 0)
                os.write(number, str(os.getpid()).encode())
                return number
        except BaseException:
            os.close(number)
            raise
        os.close(number)


def _lock(number: int) -> bool:
    """Whether the lock of an open file is had now."""
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(number, _BYTE, os.SEEK_SET)
            msvcrt.locking(number, msvcrt.LK_NBLCK, 1)
            os.lseek(number, 0, os.SEEK_SET)
        else:
            import fcntl

            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as e:
        if e.errno in (errno.EAGAIN, errno.EACCES, errno.EWOULDBLOCK):
            return False
        logger.warning("This file system has no locks (%s): let no two processes write into one folder.", e.strerror)
    return True
