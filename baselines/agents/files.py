"""The file of an agent: tensors, and one JSON text that says what they mean. Reading one runs nothing in it."""

from __future__ import annotations

import hashlib
import itertools
import json
import pathlib
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

import ikgym
from baselines.agents.base_policy import check_base_policy
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.features import Processing
from baselines.agents.network import Network, Singles
from baselines.agents.protocols import AgentFile, Described, StoredTransform
from baselines.agents.relative.processing import Relative
from baselines.agents.untrusted import parse_json, read, refuse
from baselines.canonical import canonical
from baselines.files import write
from baselines.fingerprints import arm_fingerprint, fingerprint
from ikgym import cost_kernels
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Scenario

#: The version of the format.
FORMAT: Final = 2
#: The ikgym that reads a format of before.
READERS: Final = {1: "0.1.0"}
#: The key of the JSON text in the metadata of the file.
KEY: Final = "ikgym"
#: Most bytes of a header.
MOST_HEADER = 2**20

#: What is raised by descriptions that are JSON, and no more.
UNREADABLE = (InvalidInputError, UnknownNameError, KeyError, TypeError, ValueError, OverflowError)


def save_agent(
    file: pathlib.Path,
    network: Network,
    processing: StoredTransform,
    scenario: Scenario,
    training: Mapping[str, Any] | None = None,
) -> str:
    """Writes an agent, in one go.

    Args:
        file: Where to; usually ``NAME.safetensors``.
        network: Its network.
        processing: What it sees, and what its outputs mean.
        scenario: What it was trained on.
        training: How, in whatever JSON can say.

    Returns:
        Its hash, see :class:`AgentFile`.

    Raises:
        InvalidInputError: `training` is no JSON.
        ResultsError: The file cannot be written.
    """
    tensors = _tensors(network)
    about = {
        **description(processing, scenario, training),
        "network": {"sizes": list(network.sizes), "activation": network.activation, "squash": network.squash},
    }
    return write_file(file, tensors, about)


def write_file(file: pathlib.Path, tensors: list[tuple[str, Singles]], about: Mapping[str, Any]) -> str:
    """Writes tensors and what they mean, in one go.

    Returns:
        Their hash.

    Raises:
        ResultsError: The file cannot be written.
    """
    found = digest(tensors, about)
    metadata = {KEY: json.dumps({**about, "hash": found}, ensure_ascii=False, allow_nan=False)}
    write(file, save(dict(tensors), metadata))
    return found


def description(processing: Described, scenario: Scenario, training: Mapping[str, Any] | None) -> dict[str, Any]:
    """What files say of an agent besides its network, as JSON has it.

    Raises:
        InvalidInputError: `training` is no JSON.
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
    }
    try:
        same = json.loads(json.dumps(about, allow_nan=False))
    except (TypeError, ValueError) as e:
        raise InvalidInputError(f"training: expected what JSON can say, got {training!r} ({e}).") from None
    return dict(same)


def load_agent(file: pathlib.Path) -> AgentFile:
    """Reads what :func:`save_agent` wrote. Whatever is in the file, none of it is executed.

    Raises:
        ResultsError: There is no such file, or it is damaged, changed, or of another version.
    """
    return parse_agent(str(file), read(file))


def parse_agent(source: str, content: bytes) -> AgentFile:
    """The agent in the content of a file.

    Args:
        source: What messages call the file.
        content: All of its bytes.

    Raises:
        ResultsError: It is damaged, changed, or of another version.
    """
    about = parse_header(source, content)
    try:
        tensors = load(content)
    except (SafetensorError, ValueError, TypeError, KeyError, OverflowError) as e:
        refuse(source, f"is damaged: {e}")
    claimed = about.pop("hash")
    processing = check_described(source, about)
    try:
        network = _network(about["network"], tensors)
    except UNREADABLE as e:
        refuse(source, f"is no agent that this version can read: {said(e)}")
    check_hash(source, _tensors(network), about, claimed)
    return AgentFile(source, network, processing, about, claimed)


def check_hash(source: str, tensors: list[tuple[str, Singles]], about: Mapping[str, Any], claimed: str) -> None:
    """Refuses a file that is not what its hash was made of."""
    found = digest(tensors, about)
    if found != claimed:
        refuse(source, f"was changed after it was written: expected the hash {claimed}, got {found}")


def parse_header(source: str, content: bytes) -> dict[str, Any]:
    """What a file says of its agent, taken at its word; the beginning of the file is enough.

    Raises:
        ResultsError: It is damaged, or of another version.
    """
    length = int.from_bytes(content[:8], "little")
    if len(content) < 8 or length > min(len(content) - 8, MOST_HEADER):
        refuse(
            source,
            f"is cut off, or no safetensors file: its header claims {length} bytes, expected at most {MOST_HEADER}, "
            f"and {max(len(content) - 8, 0)} follow",
        )
    header = parse_json(source, content[8 : 8 + length])
    metadata = header.get("__metadata__")
    text = metadata.get(KEY) if isinstance(metadata, dict) else None
    if not isinstance(text, str):
        refuse(source, f"is no agent of ikgym: expected a text {KEY!r} in its metadata, got {_names(metadata)}")
    about = parse_json(source, text.encode())
    check_format(source, about)
    if not isinstance(about.get("hash"), str):
        refuse(source, f"is damaged: expected the key 'hash', got {_names(about)}")
    return about


def check_described(source: str, about: Mapping[str, Any]) -> Processing | Bilinear | Relative:
    """The processing in what :func:`description` wrote, all of it being of the right type.

    Raises:
        ResultsError: Something is missing, of another type, or the base policy is one that a file must not name.
    """
    try:
        values = dict(about["processing"])
        kinds: dict[Any, type[Bilinear | Relative]] = {Bilinear.kind: Bilinear, Relative.kind: Relative}
        processing = kinds.get(values.get("kind"), Processing).from_json(values)
        check_types(about, processing)
    except UNREADABLE as e:
        refuse(source, f"is no agent that this version can read: {said(e)}")
    try:
        check_base_policy(processing.base_policy)
    except (InvalidInputError, UnknownNameError) as e:
        refuse(source, f"cannot be used: {str(e).removesuffix('.')}")
    return processing


def check_format(source: str, about: Mapping[str, Any]) -> None:
    """Refuses what another version has written."""
    version = about.get("format")
    if isinstance(version, bool) or version != FORMAT:
        hint = READERS.get(version) if type(version) is int else None
        needed = "" if hint is None else f", which ikgym {hint} reads"
        refuse(source, f"is of another version: expected format {FORMAT}, got {version!r}{needed}")


def _tensors(network: Network) -> list[tuple[str, Singles]]:
    """The tensors of a network by name, layer by layer."""
    out = []
    for number, (weights, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        out += [(f"layers.{number}.weight", weights), (f"layers.{number}.bias", bias)]
    return out


def _network(about: Mapping[str, Any], tensors: Mapping[str, Any]) -> Network:
    sizes = [int(size) for size in about["sizes"]]
    expected: dict[str, tuple[int, ...]] = {}
    for number, (inputs, outputs) in enumerate(itertools.pairwise(sizes)):
        expected[f"layers.{number}.weight"] = (outputs, inputs)
        expected[f"layers.{number}.bias"] = (outputs,)
    got = {name: tensor.shape for name, tensor in tensors.items()}
    if got != expected or any(tensor.dtype != np.float32 for tensor in tensors.values()):
        kinds = {name: f"{tensor.dtype} {tensor.shape}" for name, tensor in tensors.items()}
        raise InvalidInputError(f"expected float32 tensors of the shapes {expected}, got {kinds}")
    layers = range(len(sizes) - 1)
    return Network(
        tuple(tensors[f"layers.{number}.weight"] for number in layers),
        tuple(tensors[f"layers.{number}.bias"] for number in layers),
        about["activation"],
        about["squash"],
    )


def check_types(about: Mapping[str, Any], processing: Described) -> None:
    """Insists on the types of what others rely on.

    Raises:
        InvalidInputError: One is another.
    """
    texts = about["scenario"]["name"], about["scenario"]["fingerprint"], about["task"]["name"], about["ikgym"]
    numbers = about["joints"], about["task"]["size"], about["task"]["error_size"], about["cost_version"]
    base_policy = processing.base_policy is None or isinstance(processing.base_policy, str)
    if not (
        all(isinstance(text, str) for text in texts) and all(type(value) is int for value in numbers) and base_policy
    ):
        raise InvalidInputError(f"expected names as texts and sizes as whole numbers, got {texts} and {numbers}")
    arm = about.get("arm", {"name": "", "fingerprint": ""})  # files of before have none
    if not (isinstance(arm, dict) and all(isinstance(arm.get(key), str) for key in ("name", "fingerprint"))):
        raise InvalidInputError(f"arm: expected a name and a fingerprint as texts, got {arm!r}")
    if not isinstance(about["training"], dict):
        raise InvalidInputError(f"training: expected an object, got {about['training']!r}")


def digest(tensors: list[tuple[str, Singles]], about: Mapping[str, Any]) -> str:
    """The hash of a file: of what it says, and of its tensors in their order."""
    out = hashlib.sha256(canonical(about).encode())
    for name, tensor in tensors:
        out.update(f"{name}{tensor.shape}".encode())
        out.update(tensor.astype("<f4", copy=False).tobytes())
    return out.hexdigest()


def _names(value: object) -> str:
    return f"the keys {sorted(value)}" if isinstance(value, dict) else repr(value)


def said(error: Exception) -> str:
    """What is wrong, without the quotes of a missing key alone."""
    return f"the key {error} is missing" if isinstance(error, KeyError) else str(error)
