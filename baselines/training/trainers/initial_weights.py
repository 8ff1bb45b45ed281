"""Models that begin from a trained one."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from baselines.training.config.base import Config
from baselines.training.errors import TrainingError
from baselines.training.trainers.model_file import InitialWeights, load_weights
from baselines.training.trainers.models import algorithm_of, mean_network, squash_of_model

#: Methods that can go on with an agent, by how it keeps its outputs within ±1.
FITTING: dict[str, str] = {"clip": "ppo", "tanh": "sac or td3", "linear": "the method that made it"}


def inherit(config: Config, given: Collection[str]) -> Config:
    """A configuration with what comes with the file of its `init`.

    Args:
        config: Of any method; as it is where it has no `init`.
        given: Names of the fields that were asked for, and must not be contradicted.

    Raises:
        ResultsError: The file cannot be read.
        TrainingError: The file says something else than what was asked for.
    """
    if config.init is None:
        return config
    file = load_weights(config.init)
    if not isinstance(file.processing, type(config.processing)):
        raise TrainingError(f"{file.source} holds an agent of another structure than {config.method} trains.")
    inherited = config.shape_of(file.processing, file.network.sizes, file.network.activation)
    for name in inherited:
        asked = getattr(config, name)
        if name in given and asked != inherited[name]:
            raise TrainingError(
                f"{name}: {file.source} has {inherited[name]!r}, got {asked!r}: leave it out, or begin without --init."
            )
    return config.replace(**inherited)


def begin_from(model: BaseAlgorithm, config: Config) -> None:
    """Gives a model the weights of a trained one: the actor's, and the critics' where they are of the same kind.

    Args:
        model: An untrained one, made as `config` says.
        config: With an `init`.

    Raises:
        ResultsError: The file cannot be read.
        TrainingError: It has another shape, or keeps its outputs within ±1 in another way.
    """
    assert config.init is not None
    file, algorithm = load_weights(config.init), algorithm_of(model)
    _check_processing(file, config)
    if file.network.squash != squash_of_model(model):
        raise TrainingError(
            f"{algorithm} keeps network outputs within ±1 by {squash_of_model(model)}, the agent of {file.source} by "
            f"{file.network.squash}: the same weights would be another agent. Go on with "
            f"{FITTING[file.network.squash]}, or imitate it by a model that {algorithm} can go on with: imitate "
            f"--expert agent:FILE --algorithm {algorithm}, with FILE its agent.safetensors."
        )
    if file.algorithm == algorithm:
        _load_policy(model, file)
        return
    _load_actor(mean_network(model), file)
    policy: Any = model.policy
    target: Any = getattr(policy, "actor_target", None)
    if target is not None:
        target.load_state_dict(policy.actor.state_dict())


def begin_actor_from(actor: nn.Sequential, config: Config) -> None:
    """Gives an actor the weights of a trained one.

    Args:
        actor: An untrained one, made as `config` says.
        config: With an `init`.

    Raises:
        ResultsError: The file cannot be read.
        TrainingError: It has another shape, or keeps its outputs within ±1, which this actor does not.
    """
    assert config.init is not None
    file = load_weights(config.init)
    _check_processing(file, config)
    if file.network.squash != "linear":
        raise TrainingError(
            f"{config.method} does not keep network outputs within ±1, the agent of {file.source} does by "
            f"{file.network.squash}: the same weights would be another agent. Go on with "
            f"{FITTING[file.network.squash]}."
        )
    _load_actor(actor, file)


def _check_processing(file: InitialWeights, config: Config) -> None:
    if file.processing != config.processing:
        raise TrainingError(f"{file.source} was trained with {file.processing}, which is not that of this run.")


def _load_policy(model: BaseAlgorithm, file: InitialWeights) -> None:
    """Actor and critics."""
    try:
        model.policy.load_state_dict(file.policy)
    except RuntimeError as e:
        raise TrainingError(f"Cannot begin from {file.source}: {' '.join(str(e).split())[:300]}") from None


def _load_actor(actor: nn.Sequential, file: InitialWeights) -> None:
    layers = [module for module in actor if isinstance(module, nn.Linear)]
    shapes = [tuple(layer.weight.shape) for layer in layers]
    if shapes != [weights.shape for weights in file.network.weights]:
        raise TrainingError(f"{file.source} has layers of {file.network.sizes}, which are not those of this run.")
    with torch.no_grad():
        for layer, weights, bias in zip(layers, file.network.weights, file.network.biases, strict=True):
            layer.weight.copy_(torch.tensor(weights))
            layer.bias.copy_(torch.tensor(bias))
