"""The file of an agent with memory: tensors, and one JSON text that says what they mean. Reading one runs nothing."""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Mapping
from typing import Any

from safetensors import SafetensorError
from safetensors.numpy import load, save

from baselines.agents.base_policy import check_base_policy
from baselines.agents.files import KEY, check_types, description, digest, parse_header
from baselines.agents.protocols import DIGITS
from baselines.agents.recurrent.network import GatedNetwork, shapes
from baselines.agents.recurrent.processing import Recurrent
from baselines.agents.untrusted import read, refuse
from baselines.files import write
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Scenario


@dataclasses.dataclass(frozen=True, eq=False)
class RecurrentFile:
    """An agent with memory that was read from a file.

    Args:
        source: The file, as messages name it.
        network: Its network.
        processing: What it corrects, and what its filter begins with.
        about: What the file says of the agent: where it was trained, and how.
        hash: SHA-256 of what it is made of, in 64 hexadecimal digits.
    """

    source: str
    network: GatedNetwork
    processing: Recurrent
    about: Mapping[str, Any]
    hash: str

    @property
    def digits(self) -> str:
        """The first digits of the hash."""
        return self.hash[:DIGITS]


def save_recurrent(
    file: pathlib.Path,
    network: GatedNetwork,
    processing: Recurrent,
    scenario: Scenario,
    training: Mapping[str, Any] | None = None,
) -> str:
    """Writes an agent, in one go.

    Args:
        file: Where to; usually ``NAME.safetensors``.
        network: Its network.
        processing: What it corrects.
        scenario: What it was trained on.
        training: How, in whatever JSON can say.

    Returns:
        Its hash.

    Raises:
        InvalidInputError: `training` is no JSON.
        ResultsError: The file cannot be written.
    """
    about = _about(network, processing, scenario, training)
    tensors = [(name, network.tensors[name]) for name in shapes(network.sizes)]
    found = digest(tensors, about)
    write(file, save(dict(tensors), {KEY: json.dumps({**about, "hash": found}, ensure_ascii=False, allow_nan=False)}))
    return found


def load_recurrent(file: pathlib.Path) -> RecurrentFile:
    """Reads what :func:`save_recurrent` wrote. Whatever is in the file, none of it is executed.

    Raises:
        ResultsError: There is no such file, or it is damaged, changed, of another version, or without memory.
    """
    source, content = str(file), read(file)
    about = parse_header(source, content)
    claimed = about.pop("hash")
    try:
        processing = Recurrent.from_json(_of_kind(about["processing"]))
        check_types(about, processing)
        check_base_policy(processing.base_policy)
        sizes = tuple(int(size) for size in about["network"]["sizes"])
        network = GatedNetwork(sizes, load(content))
        if sizes != Recurrent.sizes(sizes[1:-1]):
            raise InvalidInputError(f"sizes: expected {Recurrent.sizes(sizes[1:-1])}, got {sizes}")
    except (
        SafetensorError, InvalidInputError, UnknownNameError, KeyError, TypeError, ValueError, OverflowError
    ) as e:  # fmt: skip
        reason = f"the key {e} is missing" if isinstance(e, KeyError) else str(e)
        refuse(source, f"is no agent with memory that this version can read: {reason}")
    found = digest([(name, network.tensors[name]) for name in shapes(sizes)], about)
    if found != claimed:
        refuse(source, f"was changed after it was written: expected the hash {claimed}, got {found}")
    return RecurrentFile(source, network, processing, about, found)


def in_memory(network: GatedNetwork, processing: Recurrent, scenario: Scenario) -> RecurrentFile:
    """An agent that is in no file yet, as if it had been read from one; without a hash."""
    return RecurrentFile("in training", network, processing, _about(network, processing, scenario, None), "")


def _about(
    network: GatedNetwork, processing: Recurrent, scenario: Scenario, training: Mapping[str, Any] | None
) -> dict[str, Any]:
    """What the file of an agent says of it."""
    return {
        **description(processing, scenario, training),
        "network": {"sizes": list(network.sizes)},
    }


def _of_kind(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The values of a processing of the right kind.

    Raises:
        InvalidInputError: It is of an agent of another kind.
    """
    if values.get("kind") != Recurrent.kind:
        raise InvalidInputError(f"it has no memory, and is played as agent:FILE; its kind is {values.get('kind')!r}")
    return values
