"""Files: atomic writing, and bounded reading of files of users."""

from __future__ import annotations

import os
import pathlib
import re
import stat
import tomllib
from typing import Any

from ikgym.exceptions import InvalidInputError

#: Largest size of a TOML file in bytes.
LARGEST_TOML = 2**24
# The time of `tomllib` grows with the square of the number of names in a dotted key.
_LONG_KEY = re.compile(rb"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){50}""")


def write(file: pathlib.Path, content: bytes) -> None:
    """Writes a file atomically, with its folders: readers see the old content or the new one, also after a crash."""
    draft = draft_of(file)
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


def draft_of(file: pathlib.Path) -> pathlib.Path:
    """The file that :func:`write` renames: in the same folder, as renaming is atomic only within a file system."""
    return file.with_name(f".{file.name}.{os.getpid()}.tmp")


def read_user_file(file: str | os.PathLike[str], most: int = 2**28) -> bytes:
    """The content of a file of a user, of at most `most` bytes; an error says why it cannot be read."""
    try:
        # A pipe would wait for its writer.
        with os.fdopen(os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as stream:
            about = os.fstat(stream.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise InvalidInputError(f"Cannot read {file}: expected a regular file.")
            if about.st_size > most:
                raise InvalidInputError(f"Cannot read {file}: expected at most {most} bytes, got {about.st_size}.")
            content = stream.read(most + 1)  # files of the system state no size
    except InvalidInputError:
        raise
    except (OSError, TypeError, ValueError) as e:  # such as a path with a null byte
        raise InvalidInputError(f"Cannot read {file}: {getattr(e, 'strerror', None) or e}.") from None
    if content is None:  # as from a device that waits
        raise InvalidInputError(f"Cannot read {file}: expected a regular file, got one without content.")
    if len(content) > most:
        raise InvalidInputError(f"Cannot read {file}: expected at most {most} bytes, got more.")
    return content


def read_user_toml(file: str | os.PathLike[str]) -> dict[str, Any]:
    """The content of a TOML file of a user, see :func:`read_user_file`."""
    content = read_user_file(file, LARGEST_TOML)
    if _LONG_KEY.search(content):
        raise InvalidInputError(f"{file}: expected keys of at most 50 names, got one with more dots.")
    try:
        return tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"{file}: invalid TOML: {error}.") from None
