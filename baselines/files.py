"""Files that the project writes: each is replaced in one go, a folder has one writer, and reading has one check."""

from __future__ import annotations

import contextlib
import csv
import dataclasses
import errno
import io
import json
import logging
import math
import os
import pathlib
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from ikgym import files
from ikgym.exceptions import IkgymError, InvalidInputError

logger = logging.getLogger("ikgym")

#: Largest size in bytes of a file that is read.
LARGEST = 2**32
#: The file in a folder that is locked. It holds the number of the process that writes into the folder.
LOCK = ".lock"
# Seconds between two attempts to get a lock.
_PAUSE = 0.02
# The locked byte: on Windows a locked byte cannot be read, and the process number should be.
_BYTE = 2**20

T = TypeVar("T")


class ResultsError(IkgymError):
    """A file or folder of results cannot be read, written or resumed; the message names it."""


def write(file: pathlib.Path, content: bytes) -> None:
    """Writes a file in one go, see :func:`ikgym.files.write`.

    Raises:
        ResultsError: It cannot be written.
    """
    try:
        files.write(file, content)
    except OSError as e:
        raise ResultsError(f"Cannot write {file}: {e.strerror or e}.") from None


def write_json(file: pathlib.Path, value: object) -> None:
    """Writes a value as JSON, in one go.

    Raises:
        ResultsError: The file cannot be written.
    """
    write(file, json_text(value, indent=1).encode())


def json_text(value: object, indent: int | None = None) -> str:
    """A value as JSON, with a line break at its end; what a terminal cannot show is escaped in it."""
    text = json.dumps(value, indent=indent, ensure_ascii=False, allow_nan=False)
    if not text.replace("\n", "").isprintable():
        text = "".join(c if c.isprintable() or c == "\n" else json.dumps(c)[1:-1] for c in text)
    return text + "\n"


def canonical(value: object) -> str:
    """Equal JSON texts for equal values."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False)


def jsonable(value: Any) -> Any:
    """A value as JSON; types that JSON does not have become text."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): jsonable(item) for name, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else repr(value)


def csv_text(head: Iterable[str], lines: Iterable[Iterable[object]]) -> str:
    """Lines of cells as CSV: numbers with all digits, None as an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(lines)
    return text.getvalue()


def read_bytes(file: pathlib.Path, most: int = LARGEST) -> bytes:
    """The content of a file of at most `most` bytes, see :func:`ikgym.files.read_user_file`.

    Raises:
        ResultsError: It cannot be read.
    """
    try:
        return files.read_user_file(file, most)
    except InvalidInputError as e:
        raise ResultsError(str(e)) from None


def read_json(file: pathlib.Path, advice: str = "") -> Any:
    """The value in a JSON file; see :func:`reading` for ``advice``.

    Raises:
        ResultsError: It cannot be read, or is not JSON.
    """
    with reading(file, advice):
        return json.loads(read_bytes(file))


def read_arrays(file: pathlib.Path, advice: str = "") -> dict[str, npt.NDArray[Any]]:
    """The arrays in an .npz file, by name; see :func:`reading` for ``advice``.

    Raises:
        ResultsError: It cannot be read, or is damaged.
    """
    with reading(file, advice), np.load(io.BytesIO(read_bytes(file)), allow_pickle=False) as arrays:
        return dict(arrays)


def from_json(kind: type[T], values: object) -> T:
    """A dataclass from a JSON object with its fields as keys.

    Raises:
        ValueError: It is not an object, a key is missing, or there is an unknown key.
    """
    if not isinstance(values, dict):
        raise ValueError(f"expected an object with the keys of a {kind.__name__}, got {type(values).__name__}")
    known = {field.name: field for field in dataclasses.fields(kind)}  # type: ignore[arg-type]  # T is a dataclass
    missing = dataclasses.MISSING
    needed = [name for name, one in known.items() if one.default is missing and one.default_factory is missing]
    if wrong := [*(name for name in needed if name not in values), *(name for name in values if name not in known)]:
        raise ValueError(f"the key {wrong[0]!r} is {'unknown' if wrong[0] in values else 'missing'}")
    return kind(**values)


@contextlib.contextmanager
def reading(file: pathlib.Path, advice: str = "") -> Iterator[None]:
    """Turns errors while a file is read into one that names the file.

    Args:
        file: The file.
        advice: A sentence at the end of the message if the file is damaged.

    Raises:
        ResultsError: The file cannot be read, or its content is not as expected.
    """
    try:
        yield
    except (ResultsError, MemoryError):
        raise
    except OSError as e:
        raise ResultsError(f"Cannot read {file}: {e.strerror or e}.") from None
    except Exception as e:  # a damaged file makes readers raise anything
        raise ResultsError(
            f"{file} is damaged, or was written by another version: {reason(e)}. {advice}".rstrip()
        ) from e


def reason(error: Exception) -> str:
    """The message of an error of a library in one line, truncated if it is long; its kind if it has none."""
    return (" ".join(str(error).split()) or type(error).__name__)[:300].removesuffix(".")


def read_resumable(manifest: pathlib.Path, about: Mapping[str, Any]) -> dict[str, Any] | None:
    """The manifest of the work in a folder, which is resumed; the caller has locked the folder.

    Args:
        manifest: The JSON file that says which work the folder holds; nothing is written to it.
        about: Values that must be equal there.

    Returns:
        Its content; None if there is no such file, and the work begins.

    Raises:
        ResultsError: It is other work, or the manifest is damaged.
    """
    if not manifest.exists():
        return None
    there = read_json(manifest)
    if not isinstance(there, dict):
        raise ResultsError(f"{manifest} is damaged: expected an object, got {type(there).__name__}.")
    check_same(manifest, there, about)
    return there


def check_flags(file: pathlib.Path, *, resume: bool, overwrite: bool) -> bool:
    """Checks the flags of a command; returns whether the work in a file is continued.

    Raises:
        ResultsError: Both flags are given, or neither and the file exists.
    """
    if resume and overwrite:
        raise ResultsError("--resume keeps existing results, --overwrite replaces them: choose one.")
    if not (resume or overwrite) and file.exists():
        raise ResultsError(
            f"{file} already exists: continue with --resume, replace it with --overwrite, or choose another folder."
        )
    return resume and file.exists()


def check_same(file: pathlib.Path, there: Mapping[str, Any], here: Mapping[str, Any], of: str = "") -> None:
    """Refuses to continue work in a file with other values than those here.

    Raises:
        ResultsError: A value differs.
    """
    if names := [name for name in here if there.get(name) != here[name]]:
        changes = ", ".join(f"{name} ({there.get(name)!r} there, {here[name]!r} here)" for name in names)
        raise ResultsError(f"{file} differs in {changes}{of}: resume with the same, or choose another folder.")


def check_writable(folder: pathlib.Path) -> None:
    """Creates a folder if it does not exist, and a file in it for a moment: better now than after hours of work.

    Raises:
        ResultsError: It cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as e:
        raise ResultsError(f"Cannot write into {folder}: {e.strerror or e}.") from None


def check_writable_file(file: pathlib.Path) -> None:
    """Checks that a file can be written, with its folder, see :func:`check_writable`; its content stays.

    Raises:
        ResultsError: It cannot: its name is too long, or it is a folder.
    """
    check_writable(file.absolute().parent)
    if file.is_dir():
        raise ResultsError(f"Cannot write {file}: it is a folder.")
    try:
        files.draft_of(file).lstat()
    except FileNotFoundError:
        pass
    except OSError as e:
        raise ResultsError(f"Cannot write {file}: {e.strerror or e}.") from None


@contextlib.contextmanager
def locked(folder: pathlib.Path, patience: float = 0.0) -> Iterator[None]:
    """Locks a folder for this process; the operating system frees the lock of a process that dies.

    Args:
        folder: Created if it does not exist.
        patience: How long to wait for another process that writes into it, in [s].

    Raises:
        ResultsError: Another process, or another call in this one, writes into it, or it cannot be written.
    """
    file, until = folder / LOCK, time.monotonic() + patience
    try:
        folder.mkdir(parents=True, exist_ok=True)
        while (number := _acquire(file)) is None:
            if time.monotonic() >= until:
                holder = file.read_text(errors="replace") if file.exists() else ""
                who = f"process {holder}" if holder.isdecimal() else "another process"
                raise ResultsError(
                    f"{folder} is in use: {who} writes into it. Wait until it has ended, or choose another folder."
                )
            time.sleep(_PAUSE)
    except OSError as e:
        raise ResultsError(f"Cannot write into {folder}: {e.strerror or e}.") from None
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # Windows does not remove open files: it stays, without effect
            file.unlink()
        os.close(number)


def _acquire(file: pathlib.Path) -> int | None:
    """The descriptor of the locked file; None if another process holds the lock."""
    while True:
        number = os.open(file, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            free = _lock(number)
            # The previous holder may have removed the file after it was opened here.
            if free and file.exists() and os.path.samestat(os.fstat(number), file.stat()):
                os.ftruncate(number, 0)
                os.write(number, str(os.getpid()).encode())
                return number
        except BaseException:
            os.close(number)
            raise
        os.close(number)
        if not free:
            return None


def _lock(number: int) -> bool:
    """Locks an open file, unless another process has locked it."""
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
