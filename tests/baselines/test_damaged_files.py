"""Users' files with damaged or hostile content are read, or refused with one of our own errors.

The suite tries a few of each; the environment variable IKGYM_FUZZ says how many instead, see `make fuzz`.
"""

import contextlib
import functools
import os
import pathlib
import tempfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.agents.files import load_agent
from baselines.agents.track import Track
from baselines.evaluation.results import read_rows
from baselines.solvers.rivals.model_files import urdf
from baselines.training.methods import configure
from baselines.tuning import ranges
from ikgym import arms, scenarios
from ikgym.exceptions import IkgymError
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
    "preset.toml": lambda file: configure(str(file)),
    "ranges.toml": ranges.read,
    "points.csv": from_csv,
    "arm.urdf": arms.from_urdf,
    "it.safetensors": lambda file: load_agent(file, (Track,)),
    "results.json": read_rows,
}


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
        read = functools.partial(pytest.importorskip("baselines.viewer.arms").read_urdf, arm=arms.get("panda"))
    with pytest.raises(IkgymError, match=f"Cannot read .*{name}: ({message})"):
        read(file)


def spliced(content, cuts):
    """Bytes with pieces of them replaced."""
    for place, length, new in cuts:
        at = int(place * len(content))
        content = content[:at] + new + content[at + length :]
    return content


def tried(name, content, read):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / name
        file.write_bytes(content)
        with contextlib.suppress(IkgymError):
            read(file)


@pytest.fixture(scope="module")
def agent(tmp_path_factory):
    file = write_agent(tmp_path_factory.mktemp("agent") / "it.safetensors", scenarios.get("varga7-fast"), hidden=(2,))
    return pathlib.Path(file).read_bytes()


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
def test_agents(agent, cuts):
    tried("it.safetensors", spliced(agent, cuts), READERS["it.safetensors"])


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES, timed=st.booleans())
def test_waypoints(cuts, timed):
    content, given = (TIMED, {}) if timed else (TIMELESS, {"speed": 1.0, "acceleration": 1.0})
    tried("points.csv", spliced(content, cuts), lambda file: from_csv(file, **given))


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
def test_robots(cuts):
    pytest.importorskip("pinocchio")
    tried("arm.urdf", spliced(urdf(arms.get("planar2")).encode(), cuts), arms.from_urdf)


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
@pytest.mark.parametrize("name", ["varga7-fast", "varga7-random"])
def test_scenarios(name, cuts, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenario")
    scenarios.get(name).save(folder / "it.toml")
    tried("it.toml", spliced((folder / "it.toml").read_bytes(), cuts), scenarios.load)
