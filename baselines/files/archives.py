"""Archives of unknown origin: nothing is unpacked, and no memory asked for, beyond a bound.

The directory of a .zip may claim that a member has ten bytes which unpacks to gigabytes, and the header of an array
may claim more numbers than follow. Neither is believed.
"""

from __future__ import annotations

import io
import math
import zipfile
from typing import Any

import numpy as np
import numpy.typing as npt

#: Bytes that an archive may unpack to, all members together.
MOST = 2**30
# Bytes that are unpacked at a time.
_PIECE = 2**20


class ArchiveError(ValueError):
    """An archive is damaged, or unpacks to too much."""


def unpacked(content: bytes, most: int = MOST) -> dict[str, bytes]:
    """The members of a .zip by name.

    Args:
        content: The archive.
        most: Bytes that they may have together.

    Raises:
        ArchiveError: It is damaged, or they have more.
    """
    out: dict[str, bytes] = {}
    left = most
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            for info in archive.infolist():
                if info.filename in out:
                    raise ArchiveError(f"the member {info.filename!r} is there twice")
                out[info.filename] = _member(archive, info, left)
                left -= len(out[info.filename])
    except ArchiveError:
        raise
    except Exception as e:  # whatever a damaged file makes the reader raise
        raise ArchiveError(" ".join(str(e).split()) or type(e).__name__) from None
    return out


def packed(members: dict[str, bytes]) -> bytes:
    """A .zip of members, none of them compressed: whoever reads it needs no more memory than it has bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return stream.getvalue()


def arrays(content: bytes, most: int = MOST) -> dict[str, npt.NDArray[Any]]:
    """The arrays of an .npz by name.

    Args:
        content: The archive.
        most: Bytes that they may have together.

    Raises:
        ArchiveError: It is damaged, or they have more.
    """
    return {name.removesuffix(".npy"): _array(name, data) for name, data in unpacked(content, most).items()}


def check_stored(content: bytes) -> None:
    """Insists that a .zip holds no more than its own bytes, for readers that believe its directory.

    Raises:
        ArchiveError: It is damaged, or holds compressed members, or claims more.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = archive.infolist()
    except Exception as e:
        raise ArchiveError(" ".join(str(e).split()) or type(e).__name__) from None
    compressed = any(one.compress_type != zipfile.ZIP_STORED or one.file_size != one.compress_size for one in members)
    if compressed or sum(one.file_size for one in members) > len(content):
        raise ArchiveError("its members claim more bytes than it has")


def _member(archive: zipfile.ZipFile, info: zipfile.ZipInfo, most: int) -> bytes:
    """The bytes of a member, piece by piece: to read all at once unpacks up to 2 GiB whatever the directory claims."""
    if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):  # others unpack without a bound
        raise ArchiveError(f"expected stored or deflated members, got {info.filename!r}")
    if info.file_size > most:
        raise ArchiveError(f"expected at most {most} bytes, the member {info.filename!r} claims {info.file_size}")
    pieces = []
    with archive.open(info) as stream:
        while piece := stream.read(_PIECE):
            pieces.append(piece)
    return b"".join(pieces)


def _array(name: str, data: bytes) -> npt.NDArray[Any]:
    stream = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, fortran, dtype = read(stream)
    except Exception as e:  # whatever a damaged header makes NumPy raise
        raise ArchiveError(f"the array {name!r}: {' '.join(str(e).split())[:200]}") from None
    size, there = math.prod(shape) * dtype.itemsize, len(data) - stream.tell()
    if dtype.hasobject or dtype.itemsize == 0 or size != there or any(length < 0 for length in shape):
        raise ArchiveError(f"the array {name!r}: expected {size} bytes of numbers, got {there}")
    flat = np.frombuffer(data[stream.tell() :], dtype)
    return flat.reshape(shape, order="F" if fortran else "C").copy()
