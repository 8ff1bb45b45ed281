"""All weights of a model, critics included, in a file that cannot run code: ``model.safetensors``.

It holds the tensors of an agent (``layers.N.weight``, ``layers.N.bias``), those of the model's policy as
Stable-Baselines3 names them behind ``policy.``, and one JSON text that says what they mean.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from safetensors import SafetensorError
from safetensors.numpy import load as load_tensors
from safetensors.numpy import save as save_tensors
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import Tensor, nn

from baselines.agents.files import check_described, description, digest, load_agent
from baselines.agents.network import Network
from baselines.agents.untrusted import parse_json, read
from baselines.files import json_files, write
from baselines.training.config.base import Activation, Algorithm, Stored
from baselines.training.errors import TrainingError
from baselines.training.trainers.models import Model, algorithm_of, mean_network, squash_of_model
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Scenario

#: The key of the JSON text in the metadata of the file.
KEY = "ikgym-model"
#: What the names of the policy's tensors begin with.
POLICY = "policy."


@dataclasses.dataclass(frozen=True)
class InitialWeights:
    """What a run may begin from.

    Args:
        source: The file, as messages name it.
        processing: What the agent sees, and what the outputs of its network mean.
        network: Its actor.
        algorithm: The kind of model that `policy` is of; None where there is only an actor.
        policy: All tensors of the policy by name; none where there is only an actor.
    """

    source: str
    processing: Stored
    network: Network
    algorithm: Algorithm | None = None
    policy: Mapping[str, Tensor] = dataclasses.field(default_factory=dict)


def actor_network(model: Model, activation: Activation) -> Network:
    """The actor of a model, as agents have it."""
    layers = [module for module in mean_network(model) if isinstance(module, nn.Linear)]
    return Network(
        tuple(layer.weight.detach().numpy() for layer in layers),
        tuple(layer.bias.detach().numpy() for layer in layers),
        activation,
        squash_of_model(model),
    )


def save_model(
    model: BaseAlgorithm, file: pathlib.Path, activation: Activation, processing: Stored, scenario: Scenario
) -> None:
    """Writes all weights of a model, in one go.

    Args:
        model: Of any kind.
        file: Where to; usually ``model.safetensors``.
        activation: Of the hidden layers.
        processing: What the agent sees, and what the outputs of its network mean.
        scenario: What it was trained on.

    Raises:
        ResultsError: The file cannot be written.
    """
    network = actor_network(model, activation)
    tensors = {POLICY + name: tensor.detach().numpy().copy() for name, tensor in model.policy.state_dict().items()}
    for number, (weights, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        tensors |= {f"layers.{number}.weight": weights, f"layers.{number}.bias": bias}
    about = description(processing, scenario, {}) | {
        "algorithm": algorithm_of(model),
        "layers": len(network.weights),
        "activation": network.activation,
        "squash": network.squash,
    }
    about["hash"] = digest(sorted(tensors.items()), about)
    write(file, save_tensors(tensors, {KEY: json.dumps(about, ensure_ascii=False)}))


def load_weights(file: pathlib.Path) -> InitialWeights:
    """Reads `model.safetensors` or `agent.safetensors`. Whatever is in the file, none of it is executed.

    Raises:
        ResultsError: There is no such file, or it cannot be read.
        TrainingError: It is of another kind, or of an agent that was not trained here.
    """
    if file.suffix == ".zip":
        raise TrainingError(
            f"{file}: a .zip of Stable-Baselines3 can run code when it is loaded. Begin from the model.safetensors or "
            "agent.safetensors beside it, or convert it, see docs/agents.md."
        )
    content = read(file)
    text = _metadata(content).get(KEY)
    if isinstance(text, str):
        return _parse(str(file), content, parse_json(str(file), text.encode()))
    agent = load_agent(file)
    if not isinstance(agent.network, Network) or not isinstance(agent.processing, Stored):
        raise _trained_elsewhere(agent.source)
    return InitialWeights(agent.source, agent.processing, agent.network)


def _parse(source: str, content: bytes, about: dict[str, Any]) -> InitialWeights:
    claimed = about.pop("hash", None)
    processing = check_described(source, about)
    if not isinstance(processing, Stored):
        raise _trained_elsewhere(source)
    try:
        arrays = load_tensors(content)
        if claimed != (found := digest(sorted(arrays.items()), about)):
            raise ValueError(f"it was changed after it was written: expected the hash {claimed}, got {found}")
        if not all(np.isfinite(array).all() for array in arrays.values()):
            raise InvalidInputError("expected finite weights, got NaN or infinity")
        layers = range(int(about["layers"]))
        network = Network(
            tuple(arrays[f"layers.{number}.weight"] for number in layers),
            tuple(arrays[f"layers.{number}.bias"] for number in layers),
            about["activation"],
            about["squash"],
        )
        policy = {
            name.removeprefix(POLICY): torch.tensor(array) for name, array in arrays.items() if name.startswith(POLICY)
        }
        return InitialWeights(source, processing, network, about["algorithm"], policy)
    except (SafetensorError, InvalidInputError, UnknownNameError, KeyError, ValueError, TypeError) as e:
        reason = " ".join(str(e).split())[:300] or type(e).__name__
        raise TrainingError(f"Cannot begin from {source}: {reason}") from None


def _trained_elsewhere(source: str) -> TrainingError:
    return TrainingError(f"{source} was not trained here: it does not see the features of an agent.")


def _metadata(content: bytes) -> dict[str, Any]:
    """The texts in the header of a safetensors file; none where it has no header, of which others complain."""
    length = int.from_bytes(content[:8], "little")
    try:
        metadata = json_files.parse(content[8 : 8 + length])["__metadata__"]
    except (ValueError, KeyError, TypeError, OverflowError):
        return {}
    return metadata if isinstance(metadata, dict) else {}
