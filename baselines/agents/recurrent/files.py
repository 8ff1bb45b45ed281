"""The file of an agent with memory: tensors, and one JSON text that says what they mean. Reading one runs nothing."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import Any

from safetensors import SafetensorError
from safetensors.numpy import load

from baselines.agents.base_policy import check_base_policy
from baselines.agents.files import (
    UNREADABLE,
    check_hash,
    check_types,
    description,
    parse_header,
    said,
    write_file,
)
from baselines.agents.network import Singles
from baselines.agents.protocols import FileOf
from baselines.agents.recurrent.network import GatedNetwork, shapes
from baselines.agents.recurrent.processing import Recurrent
from baselines.agents.untrusted import read, refuse
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario


class RecurrentFile(FileOf[GatedNetwork, Recurrent]):
    """An agent with memory that was read from a file."""


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
    return write_file(file, _tensors(network), about)


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
    except (SafetensorError, *UNREADABLE) as e:
        refuse(source, f"is no agent with memory that this version can read: {said(e)}")
    check_hash(source, _tensors(network), about, claimed)
    return RecurrentFile(source, network, processing, about, claimed)


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


def _tensors(network: GatedNetwork) -> list[tuple[str, Singles]]:
    """Those of a network by name, in the order in which they are hashed."""
    return [(name, network.tensors[name]) for name in shapes(network.sizes)]


def _of_kind(values: Mapping[str, Any]) -> Mapping[str, Any]:
    """The values of a processing of the right kind.

    Raises:
        InvalidInputError: It is of an agent of another kind.
    """
    if values.get("kind") != Recurrent.kind:
        raise InvalidInputError(f"it has no memory, and is played as agent:FILE; its kind is {values.get('kind')!r}")
    return values
