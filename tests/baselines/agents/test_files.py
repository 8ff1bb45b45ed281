"""Files of agents: what goes in comes out, and whatever else is in one does nothing but an error."""

from __future__ import annotations

import json
import struct
import tracemalloc

import numpy as np
import pytest
from safetensors.numpy import save

import baselines
import ikgym
from baselines.agents import files
from baselines.agents.features import Processing
from baselines.agents.files import load_agent, parse_agent, save_agent
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from baselines.policy import Problem
from ikgym.exceptions import InvalidInputError
from tests.baselines.random_agents import network, write_agent

SCENARIO = ikgym.scenarios.get("varga7-fast")
PROCESSING = Processing(offsets=(1, 2, 5), base_policy="dls:damping=1e-2")
SIZES = (PROCESSING.size(Problem.of(SCENARIO)), 12, 7)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "mine.safetensors"
    save_agent(path, network(SIZES, "elu", "tanh"), PROCESSING, SCENARIO, {"method": "sac", "steps": 1000})
    return path


def test_round_trip(file):
    agent, net = load_agent(file), network(SIZES, "elu", "tanh")
    assert agent.processing == PROCESSING
    assert (agent.network.activation, agent.network.squash, agent.network.sizes) == ("elu", "tanh", SIZES)
    for there, here in zip(agent.network.weights + agent.network.biases, net.weights + net.biases, strict=True):
        np.testing.assert_array_equal(there, here)
    assert agent.about["scenario"] == {"name": "varga7-fast", "fingerprint": fingerprint(SCENARIO)}
    assert agent.about["training"] == {"method": "sac", "steps": 1000}
    assert agent.about["joints"] == 7
    assert agent.about["task"] == {"name": "skew", "size": 6, "error_size": 6}
    assert agent.about["ikgym"] == ikgym.__version__
    assert agent.about["cost_version"] == ikgym.cost_kernels.COST_VERSION
    assert agent.source == str(file)
    assert agent.digits == agent.hash[:12]


def test_same_agents_make_same_files_and_others_have_another_hash(file, tmp_path):
    again = tmp_path / "again.safetensors"
    digest = save_agent(again, network(SIZES, "elu", "tanh"), PROCESSING, SCENARIO, {"method": "sac", "steps": 1000})
    assert again.read_bytes() == file.read_bytes()
    assert digest == load_agent(file).hash
    others = {
        save_agent(again, network(SIZES, "elu", "tanh", seed=1), PROCESSING, SCENARIO),
        save_agent(again, network(SIZES, "elu", "tanh"), PROCESSING, SCENARIO),
        save_agent(again, network(SIZES, "relu", "tanh"), PROCESSING, SCENARIO),
        save_agent(again, network(SIZES, "elu", "tanh"), PROCESSING.replace(action_scale=1.0), SCENARIO),
    }
    assert len(others - {digest}) == 4
    assert list(tmp_path.iterdir()) == [again, file] or list(tmp_path.iterdir()) == [file, again]


def test_training_that_is_no_json(tmp_path):
    for training in ({"a": object()}, {"a": float("nan")}):
        with pytest.raises(InvalidInputError, match="training: expected what JSON can say"):
            save_agent(tmp_path / "a.safetensors", network(SIZES), PROCESSING, SCENARIO, training)
    assert not list(tmp_path.iterdir())


def test_no_byte_can_be_changed(file):
    content = file.read_bytes()
    rng = np.random.default_rng(0)
    header = 8 + int.from_bytes(content[:8], "little")
    places = {*range(16), *rng.integers(header, size=150).tolist(), *rng.integers(len(content), size=150).tolist()}
    for place in places:
        for change in (1, 0x80):
            spoilt = bytearray(content)
            spoilt[place] ^= change
            with pytest.raises(ResultsError, match="Agent X "):
                parse_agent("X", bytes(spoilt))


def test_no_byte_can_be_missing_or_too_many(file):
    content = file.read_bytes()
    for length in [*range(40), len(content) // 2, len(content) - 1]:
        with pytest.raises(ResultsError, match="Agent X is "):
            parse_agent("X", content[:length])
    with pytest.raises(ResultsError, match="Agent X is "):
        parse_agent("X", content + b"\0")


def parts(file):
    """Tensors and JSON of a file."""
    content = file.read_bytes()
    length = int.from_bytes(content[:8], "little")
    about = json.loads(json.loads(content[8 : 8 + length])["__metadata__"]["ikgym"])
    agent = load_agent(file)
    return dict(files._tensors(agent.network)), about


def forged(file, spoil):
    """The file with its JSON or tensors changed, and the hash made to fit wherever that can be."""
    tensors, about = parts(file)
    spoil(tensors, about)
    about.pop("hash", None)
    try:
        about["hash"] = files.digest(sorted(tensors.items()), about)
    except TypeError:
        about["hash"] = "0" * 64
    return save(tensors, {"ikgym": json.dumps(about)})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t, a: a.update(format=1), "of another version: expected format 2, got 1, which ikgym 0.1.0 reads"),
        (lambda t, a: a.update(format=3), "of another version: expected format 2, got 3"),
        (lambda t, a: a.update(format=True), "of another version"),
        (lambda t, a: a.pop("format"), "of another version: expected format 2, got None"),
        (lambda t, a: a.pop("network"), "the key 'network' is missing"),
        (lambda t, a: a.pop("processing"), "the key 'processing' is missing"),
        (lambda t, a: a["processing"].update(future=1), "no field of the processing 'future'"),
        (lambda t, a: a["processing"].update(offsets=5), "no agent that this version can read"),
        (lambda t, a: a["processing"].update(offsets=[2, 1]), "offsets: expected"),
        (lambda t, a: a["processing"].update(base_policy=5), "base_policy: expected"),
        (lambda t, a: a.update(processing=3), "no agent that this version can read"),
        (lambda t, a: a.update(scenario="x"), "no agent that this version can read"),
        (lambda t, a: a.update(joints="7"), "names as texts and sizes as whole numbers"),
        (lambda t, a: a.update(training=3), "training: expected an object, got 3"),
        (lambda t, a: a["network"].update(activation="gelu"), "no activation 'gelu'"),
        (lambda t, a: a["network"].update(activation=[]), "no activation"),
        (lambda t, a: a["network"].update(sizes=[10**12, 10**12]), "expected float32 tensors of the shapes"),
        (lambda t, a: a["network"].update(sizes=[float("inf"), 1]), "Infinity is no JSON"),
        (lambda t, a: a["network"].update(sizes=[]), "expected float32 tensors"),
        (lambda t, a: t.pop("layers.0.bias"), "expected float32 tensors of the shapes .* got "),
        (lambda t, a: t.update({"more": np.ones(3, dtype=np.float32)}), "expected float32 tensors of the shapes"),
        (lambda t, a: t.update({"layers.0.bias": np.ones(12)}), "expected float32 tensors .*float64"),
        (lambda t, a: t.update({"layers.0.bias": np.full(12, np.nan, dtype=np.float32)}), "expected finite numbers"),
    ],
)
def test_what_is_no_agent(file, spoil, message):
    file.write_bytes(forged(file, spoil))
    with pytest.raises(ResultsError, match=rf"(?s)Agent {file} is .*{message}"):
        load_agent(file)


def test_a_forged_hash(file):
    tensors, about = parts(file)
    content = save(tensors, {"ikgym": json.dumps({**about, "joints": 6})})
    with pytest.raises(ResultsError, match=f"was changed after it was written: expected the hash {about['hash']}, got"):
        parse_agent("X", content)
    for metadata in (None, {"ikgym": "[]"}, {"other": "x"}, {"ikgym": "{"}, {"ikgym": "[" * 100_000}):
        with pytest.raises(ResultsError, match=r"Agent X is (no agent of ikgym|damaged|of another version)"):
            parse_agent("X", save(tensors, metadata))


def header(**entries):
    text = json.dumps(entries).encode()
    return struct.pack("<Q", len(text)) + text


CUT = "is cut off, or no safetensors file: its header claims"


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", CUT),
        (b"1234567", CUT),
        (b"\xff" * 8 + b"{}", rf"{CUT} {2**64 - 1} bytes, expected at most 1048576, and 2 follow"),
        (struct.pack("<Q", 3) + b"{}", rf"{CUT} 3 bytes, expected at most 1048576, and 2 follow"),
        (struct.pack("<Q", 2**20 + 1) + b" " * (2**20 + 1), CUT),
        (b"\x80\x04\x95" + b"\xff" * 100, CUT),
        (struct.pack("<Q", 4) + b"abcd", "is damaged: Expecting value"),
        (struct.pack("<Q", 2) + b"\xff\xfe", "is damaged: .*utf-8"),
        (struct.pack("<Q", 10**5) + b"[" * 10**5, "is damaged"),
        (struct.pack("<Q", 2) + b"[]", "is damaged: expected a JSON object, got list"),
        (struct.pack("<Q", 2) + b"{}", "is no agent of ikgym: expected a text 'ikgym' in its metadata, got None"),
    ],
)
def test_absurd_headers(content, message):
    with pytest.raises(ResultsError, match=f"Agent X {message}"):
        parse_agent("X", content)


@pytest.mark.parametrize("shape", [[10**9, 10**9], [2**63], [-1], [1e3], [2**62, 4]])
def test_absurd_shapes_take_no_memory(file, shape):
    _, about = parts(file)
    metadata = {"ikgym": json.dumps(about)}
    tensor = {"dtype": "F32", "shape": shape, "data_offsets": [0, 4]}
    tracemalloc.start()
    try:
        with pytest.raises(ResultsError, match="Agent X is damaged"):
            parse_agent("X", header(__metadata__=metadata, a=tensor) + b"1234")
        assert tracemalloc.get_traced_memory()[1] < 10**7
    finally:
        tracemalloc.stop()


def test_no_file(tmp_path, file):
    with pytest.raises(ResultsError, match=r"mine2.safetensors does not exist. Did you mean '.*mine.safetensors'\?"):
        load_agent(tmp_path / "mine2.safetensors")
    with pytest.raises(ResultsError, match=r"does not exist\.$"):
        load_agent(tmp_path / "quite_another")
    with pytest.raises(ResultsError, match=r"does not exist\. There is no folder .*nowhere\."):
        load_agent(tmp_path / "nowhere" / "mine.safetensors")
    with pytest.raises(ResultsError, match="is no file"):
        load_agent(tmp_path)
    with pytest.raises(ResultsError, match=r"Agent .* (cannot be read|does not exist)"):
        load_agent(tmp_path / "a\0b")


def test_a_file_that_is_too_large_is_not_read(tmp_path):
    with (tmp_path / "large.safetensors").open("wb") as stream:
        stream.truncate(2**28 + 1)
    with pytest.raises(ResultsError, match="is no agent: it is too large: expected at most 268435456 bytes, got"):
        load_agent(tmp_path / "large.safetensors")


def test_helper_writes_agents(tmp_path):
    path = write_agent(tmp_path / "a.safetensors", SCENARIO, "dls")
    assert load_agent(tmp_path / "a.safetensors").source == path


def test_a_home_of_nobody():
    with pytest.raises(ResultsError, match="Agent ~nosuchuser/x: expected a path, got one with an unknown user's home"):
        baselines.make("agent", "varga7-fast", path="~nosuchuser/x")
