"""Models of Stable-Baselines3 that were trained in environments of this package, as files of agents."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.features import Features
from baselines.agents.files import save_agent
from baselines.agents.network import Network
from baselines.agents.relative.processing import Relative, Squash
from baselines.agents.sb3_zip import network_of_model
from baselines.policy import Problem
from baselines.training.environment.inverse_env import InverseVecEnv
from baselines.training.policies.bilinear import ACTIVATION
from baselines.training.trainers.models import bilinear_actor
from ikgym.exceptions import InvalidInputError
from ikgym.preview import offsets
from ikgym.sb3 import LearningVecEnv
from ikgym.scenarios import Scenario


def export(
    model: BaseAlgorithm,
    envs: LearningVecEnv | InverseVecEnv,
    file: str | pathlib.Path,
    training: Mapping[str, Any] | None = None,
) -> str:
    """Writes a model as an agent that needs no learning library: ``ikgym evaluate --policies agent:FILE`` plays it.

    Args:
        model: PPO, A2C, SAC, TD3 or DDPG with Stable-Baselines3's `MlpPolicy`, or with one of
            :mod:`baselines.training.policies`.
        envs: What it was trained in: of :func:`ikgym.sb3.make_vec`, without a history, or with actions that weigh a
            damped inverse.
        file: Where to; usually ``NAME.safetensors``.
        training: How, in whatever JSON can say.

    Returns:
        The agent's hash.

    Raises:
        InvalidInputError: The model is another, or the environment shows more than such agents see.
        ResultsError: The file cannot be written.
    """
    if isinstance(envs, InverseVecEnv):
        network = network_of_model(model.policy, model.policy_kwargs)
        return _saved(file, network, envs.processing, envs.scenario, training)
    learning, scenario = envs.learning, envs.scenario
    actor = bilinear_actor(model)
    if actor is None:
        network, tanh = _unsquashed(network_of_model(model.policy, model.policy_kwargs))
        gain = learning.largest if tanh else learning.share
    else:
        network, tanh, gain = _layers(actor.network), hasattr(model.policy, "critic"), learning.share
    squash: Squash = "tanh" if tanh else "clip"
    ahead = offsets(learning.preview)
    damping = None if actor is None else actor.damping
    processing = Relative(ahead, learning.furthest, learning.largest, gain, squash, actor is not None, damping)
    return _saved(file, network, processing, scenario, training)


def _saved(
    file: str | pathlib.Path,
    network: Network,
    processing: Bilinear | Relative,
    scenario: Scenario,
    training: Mapping[str, Any] | None,
) -> str:
    """Writes an agent whose network is of the right size."""
    problem = Problem.of(scenario)
    sizes, needed = (network.inputs, network.outputs), (processing.size(problem), processing.outputs(problem))
    if sizes != needed:
        raise InvalidInputError(
            f"model: expected a network from {needed[0]} features to {needed[1]} outputs, got {sizes[0]} and "
            f"{sizes[1]}; agents see no history and no commands."
        )
    return save_agent(pathlib.Path(file), network, processing, scenario, training)


def _unsquashed(network: Network) -> tuple[Network, bool]:
    """A network with linear outputs, and whether tanh was behind them."""
    linear = Network(network.weights, network.biases, network.activation, "linear")
    return linear, network.squash == "tanh"


def _layers(layers: nn.Sequential) -> Network:
    """The layers of a bilinear actor."""
    linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
    weights, biases = ([numbers(layer) for layer in linear] for numbers in (_weight, _bias))
    return Network(tuple(weights), tuple(biases), ACTIVATION, "linear")


def _weight(layer: nn.Linear) -> Features:
    out: Features = layer.weight.detach().cpu().numpy()
    return out


def _bias(layer: nn.Linear) -> Features:
    out: Features = layer.bias.detach().cpu().numpy()
    return out
