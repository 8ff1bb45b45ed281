"""Archives whose directory lies, and arrays whose header does, cost no memory."""

from __future__ import annotations

import io
import tracemalloc
import zipfile

import numpy as np
import pytest

from baselines.files import archives
from baselines.files.archives import ArchiveError


def lying_zip(size=2**28, claims=10, name="ikgym.json"):
    """A member of `size` zeros, of which the directory says that it has a few bytes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(name, bytes(size))
    content = bytearray(stream.getvalue())
    for signature, place in ((b"PK\x03\x04", 22), (b"PK\x01\x02", 24)):
        at = content.rindex(signature) + place
        content[at : at + 4] = claims.to_bytes(4, "little")
    return bytes(content)


def peak(call):
    tracemalloc.start()
    try:
        call()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def npz(**arrays):
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def npz_with_header(text):
    """An array whose header says what it likes."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        header = text.ljust(117) + "\n"
        archive.writestr(
            "q.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode() + bytes(80)
        )
    return stream.getvalue()


def test_a_directory_that_lies_costs_no_memory():
    content = lying_zip()
    assert len(content) < 2**19

    def tried():
        with pytest.raises(ArchiveError):
            archives.unpacked(content)

    assert peak(tried) < 2**25


def test_python_alone_unpacks_all_of_it():
    """If this fails Python has learned it, and members can be read in one go."""

    def read():
        with zipfile.ZipFile(io.BytesIO(lying_zip(2**26))) as archive, pytest.raises(zipfile.BadZipFile):
            archive.read("ikgym.json")

    assert peak(read) > 2**26


def test_an_honest_bomb_is_refused():
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(3):
            archive.writestr(str(number), bytes(2**20))
    with pytest.raises(ArchiveError, match="expected at most"):
        archives.unpacked(stream.getvalue(), 2**21)
    with pytest.raises(ArchiveError, match="claim more bytes than it has"):
        archives.check_stored(stream.getvalue())
    assert archives.packed(archives.unpacked(stream.getvalue())).count(b"PK\x03\x04") == 3


@pytest.mark.parametrize("kind", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_other_compressions_are_refused(kind):
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", kind) as archive:
        archive.writestr("0", bytes(100))
    with pytest.raises(ArchiveError, match="expected stored or deflated members"):
        archives.unpacked(stream.getvalue())


def test_arrays_are_those_that_were_saved():
    saved = {
        "q": np.arange(6.0).reshape(2, 3),
        "f": np.asfortranarray(np.arange(6.0).reshape(2, 3)),
        "e": np.empty((0, 3)),
    }
    saved |= {"text": np.array("ä"), "truth": np.array([True, False])}
    read = archives.arrays(npz(**saved))
    assert set(read) == set(saved)
    for name, array in saved.items():
        np.testing.assert_array_equal(read[name], array)
        assert read[name].dtype == array.dtype


@pytest.mark.parametrize(
    "header",
    [
        "{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (-10,)}",
        "{'descr': '|O', 'fortran_order': False, 'shape': (10,)}",
        "{'descr': '<U0', 'fortran_order': False, 'shape': (1000000000000,)}",
        "{'descr': '<f8', 'fortran_order': False, 'shape': (True, 10)}[0]",
        "(" * 110,
    ],
)
def test_headers_that_lie(header):
    with pytest.raises(ArchiveError, match=r"the array 'q\.npy'"):
        archives.arrays(npz_with_header(header))


def test_flipped_bytes_are_noticed():
    """A .zip has checksums of its own."""
    whole = npz(q=np.random.default_rng(0).random((20, 7)))
    for place in range(60, len(whole) - 120, 7):
        damaged = bytearray(whole)
        damaged[place] ^= 1
        with pytest.raises(ArchiveError):
            archives.arrays(bytes(damaged))
