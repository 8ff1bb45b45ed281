"""Files that are written in one go."""

from __future__ import annotations

import os
import pathlib


def write(file: pathlib.Path, content: bytes) -> None:
    """Writes a file in one go: whoever reads it, and whatever happens meanwhile, finds it old or new, never half.

    Args:
        file: Where to write; folders that are missing are made.
        content: All of it.

    Raises:
        OSError: It cannot be written.
    """
    # In the same folder, since only within one file system is renaming one step.
    draft = file.with_name(f".{file.name}.{os.getpid()}.tmp")
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
