"""The file of an agent: tensors, and a JSON text that describes them. Reading one executes nothing in it."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import pathlib
from collections.abc import Mapping
from typing import Any, Final

from safetensors.numpy import load, save

import ikgym
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.network import Network
from baselines.agents.processing import Processing
from baselines.agents.track import Track
from baselines.files import ResultsError, canonical, read_bytes, reading, write
from baselines.fingerprints import arm_fingerprint, fingerprint
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import cost as cost_kernels
from ikgym.scenarios import Scenario

#: The version of the format.
FORMAT: Final = 2
#: The key of the JSON text in the metadata of the file.
KEY: Final = "ikgym"
#: Largest size of a file in bytes.
MOST_BYTES = 2**28
#: Digits of a hash that identify an agent in results.
DIGITS = 12
#: The kinds of agents by the names that files have for them.
KINDS: Final[Mapping[str, type[Processing]]] = {kind.kind: kind for kind in (Bilinear, Track)}
#: Strings and numbers that every file contains.
_PARTS: Final = {
    "scenario": ("name", "fingerprint"),
    "arm": ("name", "fingerprint"),
    "task": ("name", "size", "error_size"),
}


@dataclasses.dataclass(frozen=True, eq=False)
class AgentFile:
    """An agent, read from a file or in memory.

    Args:
        source: The file, as messages name it.
        network: Its network.
        processing: The features of the network, and the meaning of its outputs.
        about: The description in the file: the scenario and the method of its training.
        hash: SHA-256 of the description and the tensors, in 64 hexadecimal digits.
    """

    source: str
    network: Network
    processing: Processing
    about: Mapping[str, Any]
    hash: str

    @property
    def digits(self) -> str:
        """The first digits of the hash, which identify the agent in results."""
        return self.hash[:DIGITS]


def agent_of(
    network: Network,
    processing: Processing,
    scenario: Scenario,
    training: Mapping[str, Any] | None = None,
) -> AgentFile:
    """An agent in memory.

    Args:
        network: Its network.
        processing: The features of the network, and the meaning of its outputs.
        scenario: The scenario of its training.
        training: How it was trained, as JSON values.

    Raises:
        InvalidInputError: `training` cannot be written as JSON.
    """
    about = {
        "format": FORMAT,
        "processing": processing.to_json(),
        "scenario": {"name": scenario.name, "fingerprint": fingerprint(scenario)},
        "arm": {"name": scenario.model.name, "fingerprint": arm_fingerprint(scenario.model)},
        "joints": scenario.joints,
        "task": {"name": scenario.task.name, "size": scenario.task.size, "error_size": scenario.task.error_size},
        "training": dict(training or {}),
        "ikgym": ikgym.__version__,
        "cost_version": cost_kernels.COST_VERSION,
        "network": network.to_json(),
    }
    try:
        about = json.loads(json.dumps(about, allow_nan=False))
    except (TypeError, ValueError) as e:
        raise InvalidInputError(f"training: expected JSON values, got {training!r} ({e}).") from None
    return AgentFile("in memory", network, processing, about, _digest(network, about))


def save_agent(file: pathlib.Path, agent: AgentFile) -> str:
    """Writes an agent in one go.

    Args:
        file: Usually ``NAME.safetensors``.
        agent: The agent.

    Returns:
        Its hash.

    Raises:
        ResultsError: The file cannot be written.
    """
    text = json.dumps({**agent.about, "hash": agent.hash}, ensure_ascii=False, allow_nan=False)
    write(file, save(dict(agent.network.tensors), {KEY: text}))
    return agent.hash


def load_agent(file: pathlib.Path) -> AgentFile:
    """Reads the file of an agent.

    Raises:
        ResultsError: There is no such file, it is damaged, or it has another format.
    """
    with reading(file):
        return _parse(str(file), read_bytes(file, MOST_BYTES))


def _parse(source: str, content: bytes) -> AgentFile:
    """The agent in the content of a file."""
    tensors = load(content)
    header = json.loads(content[8 : 8 + int.from_bytes(content[:8], "little")])
    about = json.loads(header.get("__metadata__", {})[KEY])
    if about["format"] != FORMAT:
        raise ValueError(f"expected format {FORMAT}, got {about['format']!r}")
    claimed = about.pop("hash")
    described: Any = about["processing"]
    if not isinstance(described, dict):
        raise ValueError(f"processing: expected a table, got {described!r}")
    kind: Any = described.get("kind")
    if kind not in KINDS:
        raise ResultsError(f"{source}: expected an agent of the kind {' or '.join(KINDS)}, got {kind!r}.")
    for part, names in _PARTS.items():
        if not all(isinstance(about[part][name], (str, int)) for name in names):
            raise ValueError(f"{part}: expected {', '.join(names)}, got {about[part]!r}")
    processing = KINDS[kind].from_json(described)
    network = Network.from_json(about["network"], tensors)
    found = _digest(network, about)
    if found != claimed:
        raise ValueError(f"it was changed after it was written: expected the hash {claimed}, got {found}")
    return AgentFile(source, network, processing, about, found)


def _digest(network: Network, about: Mapping[str, Any]) -> str:
    """The hash of a description and of the tensors in their order."""
    out = hashlib.sha256(canonical(about).encode())
    for name, tensor in network.tensors.items():
        out.update(f"{name}{tensor.shape}".encode())
        out.update(tensor.astype("<f4", copy=False).tobytes())
    return out.hexdigest()
