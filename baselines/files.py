"""Files that are written in one go."""

from __future__ import annotations

import os
import pathlib

from ikgym.exceptions import IkgymError


class ResultsError(IkgymError):
    """A folder of results, or the file of an agent, cannot be read, written or gone on with."""


def write(file: pathlib.Path, content: bytes) -> None:
    """Writes a file in one go: whoever reads it, and whatever happens meanwhile, finds it old or new, never half.

    Raises:
        ResultsError: It cannot be written.
    """
    # In the same folder, since only within one file system is renaming one step.
    draft = file.with_name(f".{file.name}.{os.getpid()}.tmp")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        try:
            with draft.open("wb") as stream:
                stream.write(content)
                stream.flush()
                os.fsync(stream.fileno())
            draft.replace(file)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise
    except OSError as e:
        raise ResultsError(f"Cannot write {file}: {e.strerror or e}.") from None
