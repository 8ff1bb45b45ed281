"""Models that begin from a trained one."""

from __future__ import annotations

import hashlib
import io
import pathlib
import pickle
import zipfile
from collections.abc import Collection
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from baselines.agents import files, untrusted
from baselines.agents.features import Processing
from baselines.agents.network import Network
from baselines.agents.protocols import AgentFile
from baselines.agents.sb3_network import network_of
from baselines.policy import Problem
from baselines.training.config.common import SHAPE, Algorithm, Config
from baselines.training.errors import TrainingError
from baselines.training.trainers.models import algorithm_of, mean_network, squash_of

#: A weight that only the policy of one kind of models has.
TELLTALES: dict[Algorithm, str] = {
    "ppo": "action_net.weight",
    "sac": "actor.latent_pi.0.weight",
    "td3": "actor.mu.0.weight",
}


def settle(config: Config, given: Collection[str]) -> Config:
    """A configuration with what its `init` brings along.

    Args:
        config: Of any method; as it is where it has no `init`.
        given: Names of the fields that were asked for, and must not be contradicted.

    Raises:
        ResultsError: The file cannot be read.
        TrainingError: The file says something else than what was asked for.
    """
    if config.init is None:
        return config
    file, network, processing = _read(config.init, Problem.of(config.make_scenario()))
    brought: dict[str, Any] = {
        "base_policy": processing.base_policy,
        "offsets": processing.offsets,
        "action_scale": processing.action_scale,
        "null_space": processing.null_space,
        "hidden": tuple(network.sizes[1:-1]),
        "activation": network.activation,
    }
    for name in SHAPE:
        asked = getattr(config, name)
        if name in given and asked != brought[name]:
            raise TrainingError(
                f"{name}: {file.source} has {brought[name]!r}, got {asked!r}: leave it out, or begin without --init."
            )
    return config.replace(**brought)


def begin_from(model: BaseAlgorithm, config: Config) -> None:
    """Gives a model the weights of a trained one: the actor's, and the critics' where they are of the same kind.

    Args:
        model: An untrained one, made as `config` says.
        config: With an `init`.

    Raises:
        ResultsError: The file cannot be read.
        TrainingError: It has another shape, or keeps its answers within ±1 in another way.
    """
    assert config.init is not None
    file, network, processing = _read(config.init, Problem.of(config.make_scenario()))
    algorithm = algorithm_of(model)
    if processing != config.processing:
        raise TrainingError(f"{file.source} was trained with {processing}, which is not that of this run.")
    if network.squash != squash_of(algorithm):
        fitting = "ppo" if network.squash == "clip" else "sac or td3"
        raise TrainingError(
            f"{algorithm} keeps answers within ±1 by {squash_of(algorithm)}, the agent of {file.source} by "
            f"{network.squash}: the same weights would be another agent. Go on with {fitting}, or imitate it by a "
            f"model that {algorithm} can go on with: imitate --expert agent:{file.source} --algorithm {algorithm}."
        )
    if config.init.suffix == ".zip" and _load_all(model, config.init):
        return
    layers = [module for module in mean_network(model) if isinstance(module, nn.Linear)]
    shapes = [tuple(layer.weight.shape) for layer in layers]
    if shapes != [weights.shape for weights in network.weights]:
        raise TrainingError(f"{file.source} has layers of {network.sizes}, which are not those of this run.")
    with torch.no_grad():
        for layer, weights, bias in zip(layers, network.weights, network.biases, strict=True):
            layer.weight.copy_(torch.tensor(weights))
            layer.bias.copy_(torch.tensor(bias))
        target: Any = getattr(model.policy, "actor_target", None)
        if target is not None:
            actor: Any = model.policy.actor
            target.load_state_dict(actor.state_dict())


def _read(path: pathlib.Path, problem: Problem) -> tuple[AgentFile, Network, Processing]:
    """The agent of a file, which is one of ours."""
    file = _read_zip(path) if path.suffix == ".zip" else files.load_agent(path)
    if not isinstance(file.network, Network) or not isinstance(file.processing, Processing):
        raise TrainingError(f"{path} is no model that was trained here: it does not see the features of an agent.")
    return file, file.network, file.processing


def _read_zip(path: pathlib.Path) -> AgentFile:
    """The agent of a model that was saved here, from its tensors and texts; nothing in it is executed."""
    source, content = str(path), untrusted.read(path)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            about = untrusted.parse_json(source, archive.read("ikgym.json"))
            arguments = untrusted.parse_json(source, archive.read("data"))["policy_kwargs"]
            weights = torch.load(io.BytesIO(archive.read("policy.pth")), map_location="cpu", weights_only=True)
        plain = {name: value for name, value in arguments.items() if not name.startswith(":")}
        network = network_of({name: tensor.numpy() for name, tensor in weights.items()}, plain)
    except KeyError:
        raise TrainingError(
            f"{path} is no model that was trained here: it does not see the features of an agent."
        ) from None
    except zipfile.BadZipFile as e:
        untrusted.refuse(source, f"is damaged, or no .zip file: {e}")
    except (RuntimeError, ValueError, pickle.PickleError) as e:
        raise TrainingError(f"Cannot begin from {path}: {e}") from None
    files.check_format(source, about)
    processing = files.check_described(source, about)
    return AgentFile(source, network, processing, about, hashlib.sha256(content).hexdigest())


def _load_all(model: BaseAlgorithm, path: pathlib.Path) -> bool:
    """Loads actor and critics, if the file is of the model's kind; nothing in it is executed."""
    try:
        with zipfile.ZipFile(path) as archive:
            weights = torch.load(io.BytesIO(archive.read("policy.pth")), map_location="cpu", weights_only=True)
        if TELLTALES[algorithm_of(model)] not in weights:
            return False
        model.policy.load_state_dict(weights)
    except (OSError, KeyError, RuntimeError, ValueError, zipfile.BadZipFile, pickle.PickleError) as e:
        reason = " ".join(str(e).split())[:300]
        raise TrainingError(f"Cannot begin from {path}: {reason}") from None
    return True
