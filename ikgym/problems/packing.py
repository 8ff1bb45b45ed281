"""Tables of numbers that change little from row to row, in few bytes.

Numbers become whole multiples of a resolution, these their differences of some order from row to row, and a zip
archive of them, compressed with bzip2, is a file that :func:`numpy.load` opens.
"""

from __future__ import annotations

import os
import zipfile
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ikgym.validation import FloatArray


def differences(tables: Sequence[FloatArray], scale: int, order: int) -> npt.NDArray[np.int32]:
    """Tables below each other, in differences.

    Args:
        tables: Each of shape (k_i, c).
        scale: One over the resolution; numbers are rounded to it.
        order: Of the differences; each table begins as if rows of zeros went before.

    Returns:
        One row a column of the tables, which compresses better. Shape (c, Σ k_i).
    """
    whole = (np.rint(scale * np.asarray(table)).astype(np.int64) for table in tables)
    rows = [np.diff(table, n=order, axis=0, prepend=np.zeros((order, table.shape[1]), np.int64)) for table in whole]
    return np.concatenate(rows).T.astype(np.int32)


def restored(packed: npt.NDArray[np.int32], lengths: Sequence[int], scale: int, order: int) -> list[FloatArray]:
    """The tables that :func:`differences` packed, rounded; lengths are the k_i."""
    out = []
    for part in np.split(packed.T.astype(np.int64), np.cumsum(lengths)[:-1]):
        for _ in range(order):
            part = np.cumsum(part, axis=0)
        out.append(part / scale)
    return out


def save(file: str | os.PathLike[str], arrays: Mapping[str, npt.NDArray[np.generic]]) -> None:
    """Writes arrays as an archive for :func:`numpy.load`, the same bytes for the same arrays."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_BZIP2) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_BZIP2
            with archive.open(member, "w") as stream:
                np.lib.format.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)
