"""Users' files with damaged or hostile content are read, or refused with one of our own errors.

The suite tries a few of each; the environment variable IKGYM_FUZZ says how many instead, see `make fuzz`.
"""

from __future__ import annotations

import contextlib
import os
import pathlib
import tempfile

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.agents.files import load_agent
from baselines.agents.relative import Relative
from ikgym import scenarios
from ikgym.exceptions import IkgymError
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
    tried("it.safetensors", spliced(agent, cuts), lambda file: load_agent(file, (Relative,)))


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
@pytest.mark.parametrize("name", ["varga7-fast", "varga7-random"])
def test_scenarios(name, cuts, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenario")
    scenarios.get(name).save(folder / "it.toml")
    tried("it.toml", spliced((folder / "it.toml").read_bytes(), cuts), scenarios.load)
