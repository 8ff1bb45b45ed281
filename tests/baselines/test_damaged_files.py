"""Users' files with damaged or hostile content are read, or refused with one of our own errors.

The suite tries a few of each; the environment variable IKGYM_FUZZ says how many instead, see `make fuzz`.
"""

from __future__ import annotations

import contextlib
import os
import pathlib
import tempfile

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.agents.features import Processing
from baselines.agents.files import parse_agent, save_agent
from baselines.agents.network import Network
from baselines.policy import Problem
from ikgym import scenarios
from ikgym.exceptions import IkgymError

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
    scenario = scenarios.get("varga7-fast")
    processing = Processing((1, 5))
    sizes = processing.size(Problem.of(scenario)), scenario.joints
    weights, bias = np.ones(sizes[::-1], np.float32), np.zeros(sizes[1], np.float32)
    file = tmp_path_factory.mktemp("agent") / "agent.safetensors"
    save_agent(file, Network((weights,), (bias,), "tanh", "clip"), processing, scenario)
    return file.read_bytes()


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
def test_agents(agent, cuts):
    with contextlib.suppress(IkgymError):
        parse_agent("X", spliced(agent, cuts))


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
@pytest.mark.parametrize("name", ["varga7-fast", "varga7-random"])
def test_scenarios(name, cuts, tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenario")
    scenarios.get(name).save(folder / "it.toml")
    tried("it.toml", spliced((folder / "it.toml").read_bytes(), cuts), scenarios.load)
