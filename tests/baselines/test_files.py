"""One writer a folder, one check on reading, and one error that names the file."""

from __future__ import annotations

import dataclasses
import os
import signal
import subprocess
import sys

import pytest

from baselines.evaluate import evaluate
from baselines.files import (
    LOCK,
    ResultsError,
    check_flags,
    from_json,
    locked,
    read_arrays,
    read_json,
    read_resumable,
    write_json,
)

HOLD = """
import pathlib, sys, time
from baselines.files import locked
with locked(pathlib.Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def holder(folder):
    process = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "held\n"
    return process


def test_a_second_process_is_told_who_has_the_folder_or_waits_and_a_dead_one_has_none(tmp_path):
    with holder(tmp_path) as process:
        try:
            said = rf"{tmp_path} is in use: process {process.pid} writes into it"
            with pytest.raises(ResultsError, match=said), locked(tmp_path, 0.05):
                pass
            with pytest.raises(ResultsError, match=said):
                evaluate("varga7-fast", "dls", steps=5, out=tmp_path, overwrite=True)
        finally:
            process.send_signal(signal.SIGKILL)
        with locked(tmp_path, 30.0):
            assert (tmp_path / LOCK).read_text() == str(os.getpid())
    assert not (tmp_path / LOCK).exists()


def test_one_process_does_not_have_a_folder_twice(tmp_path):
    with locked(tmp_path), pytest.raises(ResultsError, match="in use"), locked(tmp_path):
        pass
    with locked(tmp_path / "one"), locked(tmp_path / "another"):
        pass


def test_a_folder_that_cannot_be_made(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ResultsError, match="Cannot write into"), locked(tmp_path / "file"):
        pass


@dataclasses.dataclass(frozen=True)
class Point:
    x: float
    y: float = 0.0


def test_a_dataclass_has_its_fields_as_keys():
    assert from_json(Point, {"x": 1.0}) == Point(1.0)
    for values, message in [({"y": 1.0}, "'x' is missing"), ({"x": 1.0, "z": 2.0}, "'z' is unknown"), ([], "got list")]:
        with pytest.raises(ValueError, match=message):
            from_json(Point, values)


@pytest.mark.parametrize("content", [b"", b"{", b"\xff", b"[" * 100_000])
@pytest.mark.parametrize("read", [read_json, read_arrays])
def test_a_damaged_file_is_named(tmp_path, content, read):
    file = tmp_path / "it"
    file.write_bytes(content)
    with pytest.raises(ResultsError, match=f"{file} is damaged, or was written by another version: .*Run it again"):
        read(file, "Run it again.")
    with pytest.raises(ResultsError, match=f"Cannot read {tmp_path / 'none'}: No such file"):
        read(tmp_path / "none")


def test_only_the_same_work_is_resumed(tmp_path):
    file, about = tmp_path / "it.json", {"seed": 1, "steps": 5}
    assert read_resumable(file, about) is None
    write_json(file, {**about, "done": 3})
    assert read_resumable(file, about) == {**about, "done": 3}
    with pytest.raises(ResultsError, match=r"it\.json differs in seed \(1 there, 2 here\)"):
        read_resumable(file, {**about, "seed": 2})
    file.write_text("[]")
    with pytest.raises(ResultsError, match=r"it\.json is damaged"):
        read_resumable(file, about)
    with pytest.raises(ResultsError, match=r"it\.json already exists: continue with --resume"):
        check_flags(file, resume=False, overwrite=False)
    with pytest.raises(ResultsError, match="choose one"):
        check_flags(file, resume=True, overwrite=True)
