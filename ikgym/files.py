"""Files: atomic writing, and bounded reading of files of users."""

from __future__ import annotations

import os
import pathlib
import stat

from ikgym.exceptions import InvalidInputError


def write(file: pathlib.Path, content: bytes) -> None:
    """Writes a file atomically: readers see the old content or the new one, also after a crash.

    Args:
        file: The file; missing folders are made.
        content: All of its bytes.

    Raises:
        OSError: It cannot be written.
    """
    # In the same folder, since renaming is atomic only within one file system.
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


def read_user_file(file: str | os.PathLike[str], most: int = 2**28) -> bytes:
    """The content of a file of a user.

    Args:
        file: The file.
        most: Largest size in bytes.

    Raises:
        InvalidInputError: It does not exist, is not a regular file, is larger, or cannot be read.
    """
    try:
        # A pipe would wait for its writer.
        with os.fdopen(os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), "rb") as stream:
            about = os.fstat(stream.fileno())
            if not stat.S_ISREG(about.st_mode):
                raise InvalidInputError(f"Cannot read {file}: expected a regular file.")
            if about.st_size > most:
                raise InvalidInputError(f"Cannot read {file}: expected at most {most} bytes, got {about.st_size}.")
            return stream.read(most)
    except InvalidInputError:
        raise
    except (OSError, TypeError, ValueError) as e:  # such as a path with a null byte
        raise InvalidInputError(f"Cannot read {file}: {getattr(e, 'strerror', None) or e}.") from None
