"""Files of results and agents, written in one go."""

from __future__ import annotations

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
