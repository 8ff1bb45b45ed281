"""Files of results and agents: written in one go, read within bounds."""

from __future__ import annotations

import os
import pathlib

from ikgym import files
from ikgym.exceptions import IkgymError


class ResultsError(IkgymError):
    """A folder of results, or the file of an agent, cannot be read, written or gone on with."""


def write(file: pathlib.Path, content: bytes) -> None:
    """Writes a file in one go, see :func:`ikgym.files.write`.

    Raises:
        ResultsError: It cannot be written.
    """
    try:
        files.write(file, content)
    except OSError as e:
        raise ResultsError(f"Cannot write {file}: {e.strerror or e}.") from None


def read_bytes(file: pathlib.Path, most: int) -> bytes:
    """All bytes of a file, none of which is read if there are too many.

    Args:
        file: Where to read.
        most: How many there may be.

    Raises:
        OSError: It cannot be read.
        ValueError: There are more.
    """
    with file.open("rb") as stream:
        size = os.fstat(stream.fileno()).st_size
        if size > most:
            raise ValueError(f"it is too large: expected at most {most} bytes, got {size}")
        return stream.read(size)
