"""Users' files with damaged or hostile content are read, or refused with one of our errors.

The suite tries a few of each; the environment variable IKGYM_FUZZ says how many instead, see `make fuzz`.
"""

import contextlib
import functools
import io
import os
import pathlib
import tempfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.agents.files import load_agent
from baselines.evaluation.results import read_rows
from baselines.solvers.rivals.model_files import urdf
from baselines.training.options import APG
from baselines.tuning import ranges
from ikgym import arms, scenarios
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.files import read_user_file
from ikgym.trajectories import from_csv
from tests.baselines.random_agents import write_agent

EXAMPLES = int(os.environ.get("IKGYM_FUZZ", "25"))
#: What takes the place of something in a file.
HOSTILE = (
    *(b"NaN", b"-1", b"1e999", b"9" * 400, b"null", b"true", b"[]", b"{}", b'""', b'"x"', b"1.5", b"1e300", b"0"),
    *(rb'"\ud800"', b"\xff", b"\x00", b"[" * 2000, b'{"a":' * 2000, b'"a": 1, "a": 2', b"99999999999999", b"'", b"\n"),
)
BYTES = st.lists(
    st.tuples(st.floats(0.0, 1.0), st.integers(0, 12), st.one_of(st.sampled_from(HOSTILE), st.binary(max_size=4))),
    min_size=1,
    max_size=3,
)


#: Waypoints with times, and without.
TIMED = b"x, y, z, qw, qx, qy, qz, t\n1, 2, 3, 1, 0, 0, 0, 0\n4, 5.5, 6, 0.8, 0.6, 0, 0, 1.25\n7, 8, 9, 1, 0, 0, 0, 3\n"
TIMELESS = b"x,y,z\n1,2,3\n4,5.5,6\n7,8,9e-1\n"
#: Functions that read a file of a user, by the endings of the files.
READERS = {
    "scenario.toml": scenarios.load,
    "preset.toml": lambda file: APG.preset(str(file)),
    "ranges.toml": ranges.read_ranges,
    "points.csv": from_csv,
    "arm.urdf": arms.from_urdf,
    "it.safetensors": load_agent,
    "results.json": read_rows,
}


@pytest.mark.parametrize("content", [None, b"12345"])
def test_files_of_the_system_that_state_no_size_are_bounded(content, tmp_path, monkeypatch):
    (tmp_path / "it").touch()
    monkeypatch.setattr(os, "fdopen", lambda number, mode: Stream(number, content))
    with pytest.raises(
        InvalidInputError, match=r"Cannot read .*it: expected (a regular file, got one|at most 4 bytes)"
    ):
        read_user_file(tmp_path / "it", 4)


class Stream(io.FileIO):
    """A stream of a device: its size is 0, its content is another."""

    def __init__(self, number, content):
        super().__init__(number)
        self.content = content

    def read(self, most):
        return self.content


@pytest.mark.parametrize("name", [*READERS, "meshes.urdf"])
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "sparse"])
def test_only_regular_files_of_a_bounded_size_are_opened(name, kind, tmp_path):
    file, message = tmp_path / name, "expected a regular file"
    if kind == "pipe":
        os.mkfifo(file)  # opened like others, it waits for a writer
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "folder":
        file.mkdir()
        message = "Is a directory|expected a regular file"
    else:
        file.touch()
        os.truncate(file, 2**40)
        message = "expected at most [0-9]+ bytes, got 1099511627776"
    read = READERS.get(name)
    if read is None:  # what the viewer shows
        read = functools.partial(pytest.importorskip("baselines.viewer.meshes").read_urdf, arm=arms.get("panda"))
    with pytest.raises(IkgymError, match=f"Cannot read .*{name}: ({message})"):
        read(file)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The content of good files, and the functions that read them."""
    folder = tmp_path_factory.mktemp("good")
    agent = pathlib.Path(write_agent(folder / "it.safetensors", scenarios.get("varga7-fast"), hidden=(2,)))
    out = {"it.safetensors": (agent.read_bytes(), READERS["it.safetensors"])}
    for name in ("varga7-fast", "varga7-random"):
        scenarios.get(name).save(folder / f"{name}.toml")
        out[f"{name}.toml"] = (folder / f"{name}.toml").read_bytes(), scenarios.load
    out["timed.csv"] = TIMED, from_csv
    out["timeless.csv"] = TIMELESS, functools.partial(from_csv, speed=1.0, acceleration=1.0)
    out["arm.urdf"] = urdf(arms.get("planar2")).encode(), arms.from_urdf
    return out


@pytest.mark.parametrize(
    "name", ["it.safetensors", "varga7-fast.toml", "varga7-random.toml", "timed.csv", "timeless.csv", "arm.urdf"]
)
@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
def test_files_with_pieces_replaced_are_read_or_refused(files, name, cuts):
    content, read = files[name]
    for place, length, new in cuts:
        at = int(place * len(content))
        content = content[:at] + new + content[at + length :]
    with tempfile.TemporaryDirectory() as folder, contextlib.suppress(IkgymError):
        file = pathlib.Path(folder) / name
        file.write_bytes(content)
        read(file)
