"""Files with damaged or hostile content are read, or refused in one of our own errors; never anything else.

The suite tries a few of each; the environment variable IKGYM_FUZZ says how many instead, see `make fuzz`.
"""

from __future__ import annotations

import contextlib
import json
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
from baselines.evaluate import evaluate
from baselines.evaluation import report
from baselines.evaluation.pages import tuning
from baselines.evaluation.pages.measurement import Measurement
from baselines.evaluation.pages.sets import SKEW
from baselines.evaluation.pages.tuning import Tuning
from baselines.evaluation.results import read_rows
from baselines.oracle import best_known
from baselines.policy import Problem
from baselines.training import methods, presets
from baselines.training.folder import FORMAT, read_run
from ikgym import scenarios
from ikgym.exceptions import IkgymError
from tests.baselines.evaluation.pages.builders import a_measurement, a_section, learned, line

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
VALUES = st.recursive(
    st.sampled_from([None, True, -1, 0, 10**20, 1e300, -1.5, "", "x", "dls", "agent:x", "\u0000", "test", 10**13]),
    lambda inner: st.one_of(st.lists(inner, max_size=2), st.dictionaries(st.sampled_from("ab"), inner, max_size=2)),
    max_leaves=4,
)


def spliced(content, cuts):
    """Bytes with pieces of them replaced."""
    for place, length, new in cuts:
        at = int(place * len(content))
        content = content[:at] + new + content[at + length :]
    return content


def places(value, path=()):
    """Paths to all values inside of one of JSON."""
    yield path
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        yield from places(inner, (*path, key))


def exchanged(content, at, new):
    """JSON with one value of it replaced by another."""
    value = json.loads(content)
    paths = list(places(value))[1:]
    *way, last = paths[int(at * (len(paths) - 1))]
    inside = value
    for key in way:
        inside = inside[key]
    inside[last] = new
    return json.dumps(value).encode()


def rows(folder):
    evaluate("varga7-fast", ["dls", "rhc_gradient"], steps=3, out=folder, plots=False)
    return (folder / "results.json").read_bytes()


def run(folder):
    del folder
    config = methods.get("ppo").config()
    about = {"format": FORMAT, "method": "ppo", "seed": 0, "config": config.to_json(), "status": "finished"}
    return json.dumps(about).encode()


def measured(folder):
    a_measurement(a_section(line(), learned("x", ((1.0, 2.5), (3.0, 1e9))))).save(folder / "it.json")
    return (folder / "it.json").read_bytes()


def first_records(folder):
    del folder
    return json.dumps(json.loads(best_known.DATA.read_bytes())[:2]).encode()


def read_report(file):
    report.table(read_rows(file))


def read_config(file):
    about = read_run(file)
    methods.get(about["method"]).config.from_json(about["config"])


def read_records(file):
    best_known._read.cache_clear()
    best_known.read(file)


READERS = {
    "results.json": (rows, read_report),
    "run.json": (run, read_config),
    "leaderboard.json": (measured, Measurement.load),
    "tuned.json": (lambda _: tuning.file_of(SKEW).read_bytes(), Tuning.load),
    "best_known.json": (first_records, read_records),
}


def tried(name, content, read):
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / name
        file.write_bytes(content)
        with contextlib.suppress(IkgymError):
            read(file)


@pytest.fixture(scope="module")
def originals(tmp_path_factory):
    return {name: make(tmp_path_factory.mktemp("original")) for name, (make, _) in READERS.items()}


@pytest.mark.parametrize("name", READERS)
def test_the_originals_are_read(originals, name, tmp_path):
    (tmp_path / name).write_bytes(originals[name])
    READERS[name][1](tmp_path / name)


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
def test_other_bytes(originals, name, cuts):
    tried(name, spliced(originals[name], cuts), READERS[name][1])


@pytest.mark.parametrize("name", READERS)
@settings(max_examples=EXAMPLES)
@given(at=st.floats(0.0, 1.0), new=VALUES)
def test_other_values(originals, name, at, new):
    tried(name, exchanged(originals[name], at, new), READERS[name][1])


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


@settings(max_examples=EXAMPLES)
@given(cuts=BYTES)
def test_presets(cuts):
    original = (presets.FOLDER / "residual.toml").read_bytes()
    tried("it.toml", spliced(original, cuts), lambda file: presets.configure(methods.get("imitate").config, str(file)))
