"""Files of agents: round trips; other files are refused with one error that names the file."""

import json

import numpy as np
import pytest
from safetensors.numpy import load, save

import baselines
import ikgym
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.files import load_agent, save_agent
from baselines.agents.track import Track
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from baselines.policy import Problem
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.baselines.random_agents import network, random_agent

SCENARIO = ikgym.scenarios.get("varga7-pose-random")
SKEW = Problem.of(ikgym.scenarios.get("varga7-random"))
AGENTS = {
    "bilinear": random_agent(SCENARIO, processing=Bilinear((1, 5, 20), 1e-3)),
    "track": random_agent(SCENARIO, processing=Track((0.002, 0.005), 0.5), training={"seed": 1}),
}


@pytest.fixture
def file(tmp_path):
    save_agent(tmp_path / "mine.safetensors", AGENTS["track"])
    return tmp_path / "mine.safetensors"


@pytest.mark.parametrize("agent", AGENTS.values(), ids=AGENTS)
def test_round_trip(agent, tmp_path):
    file = tmp_path / "a.safetensors"
    assert save_agent(file, agent) == agent.hash
    read = load_agent(file)
    assert (read.processing, read.about, read.hash, read.source) == (
        agent.processing,
        agent.about,
        agent.hash,
        str(file),
    )
    assert read.network.to_json() == agent.network.to_json()
    for name, tensor in agent.network.tensors.items():
        np.testing.assert_array_equal(read.network.tensors[name], tensor)
    content = file.read_bytes()
    save_agent(file, read)
    assert file.read_bytes() == content
    assert read.about["scenario"] == {"name": "varga7-pose-random", "fingerprint": fingerprint(SCENARIO)}


def test_other_agents_have_other_hashes():
    processing = Track((0.002, 0.005))
    others = [
        random_agent(SCENARIO, processing=processing),
        random_agent(SCENARIO, processing=processing, seed=1),
        random_agent(SCENARIO, processing=processing, training={"seed": 2}),
        random_agent(SCENARIO, processing=processing.replace(share=0.5)),
    ]
    assert len({agent.hash for agent in others}) == len(others)


@pytest.mark.parametrize("training", [{"a": object()}, {"a": float("nan")}])
def test_training_has_to_be_json(training):
    with pytest.raises(InvalidInputError, match="training: expected JSON values"):
        random_agent(SCENARIO, training=training)


def test_changed_bytes_are_noticed(file):
    content, rng = file.read_bytes(), np.random.default_rng(0)
    header = 8 + int.from_bytes(content[:8], "little")
    for place in {*range(12), *rng.integers(header, size=20).tolist(), *rng.integers(len(content), size=20).tolist()}:
        spoilt = bytearray(content)
        spoilt[place] ^= 1
        file.write_bytes(spoilt)
        with pytest.raises(ResultsError, match=str(file)):
            load_agent(file)


def parts(file):
    """Tensors and description of a file."""
    content = file.read_bytes()
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    return load(content), json.loads(header["__metadata__"]["ikgym"])


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t, a: a.update(format=1), "expected format 2, got 1"),
        (lambda t, a: a.pop("network"), "'network'"),
        *(
            (lambda t, a, x=x: a.update(processing=x), f"processing: expected a table, got {x!r}")
            for x in (None, "track", True)
        ),
        (lambda t, a: a["processing"].update(kind="raw"), "kind bilinear or track, got 'raw'"),
        (lambda t, a: a["processing"].update(future=1), "no field 'future' of the processing"),
        (lambda t, a: a["processing"].update(ahead=[2, 1]), "rising times above 0"),
        (lambda t, a: a["network"].update(activation="gelu"), "no choice 'gelu' of activation"),
        (lambda t, a: a["network"].update(sizes=[10**12, 10**12]), "tensors: expected float32 of the shapes"),
        (lambda t, a: a.update(joints=6), "changed after it was written"),
        (lambda t, a: t.pop("layers.0.bias"), "tensors: expected float32 of the shapes"),
        (lambda t, a: t.update({"layers.0.bias": np.full(16, np.nan, np.float32)}), "expected finite numbers"),
    ],
)
def test_other_descriptions_are_refused(file, spoil, message):
    tensors, about = parts(file)
    spoil(tensors, about)
    file.write_bytes(save(tensors, {"ikgym": json.dumps(about)}))
    with pytest.raises(ResultsError, match=rf"(?s){file}.*({message})"):
        load_agent(file)


def test_no_file(tmp_path):
    for name in ("none.safetensors", ".", "a\0b", "~nosuchuser/x"):
        with pytest.raises(ResultsError, match="Cannot read"):
            baselines.make("agent", SCENARIO, path=f"{tmp_path}/{name}")


#: What a processing or a network refuses.
REFUSED = [
    (lambda: Track((0.1,), 0.0), "share: expected"),
    *((lambda ahead=ahead: Track(ahead), "ahead: expected") for ahead in ((), (0.0, 0.1), (0.2, 0.1), ("a",), 0.1)),
    *((lambda steps=steps: Bilinear(steps), "offsets: expected") for steps in ((1,), (2, 5), (1, 5, 5), (1, 2.5))),
    *((lambda number=number: Bilinear((1, 5), number), "damping: ") for number in (0.0, float("nan"), "much")),
    (lambda: Bilinear((1, 5)).outputs(SKEW), "task: expected another than skew coordinates"),
    (lambda: Bilinear.from_json({"damping": None}), "damping: expected a finite number above 0"),
    (lambda: network((2, 2), "relo"), "no choice 'relo' of activation"),
]


def test_processings_and_networks_are_checked():
    for make, words in REFUSED:
        with pytest.raises((InvalidInputError, UnknownNameError), match=words):
            make()
