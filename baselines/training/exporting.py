"""Exports networks of PyTorch and models of Stable-Baselines3 as agents, which need neither."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from sb3_contrib.common.recurrent.policies import RecurrentActorCriticPolicy
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import nn

from baselines.agents.files import AgentFile, agent_of, save_agent
from baselines.agents.network import Network
from baselines.agents.track import Track
from baselines.policy import Problem
from ikgym.exceptions import InvalidInputError
from ikgym.sb3 import LearningVecEnv

#: Activations by the names that agents have for them.
ACTIVATIONS: dict[str, type[nn.Module]] = {"silu": nn.SiLU, "relu": nn.ReLU, "tanh": nn.Tanh, "elu": nn.ELU}
#: Observations for which the actions of model and agent are compared, and the largest difference.
_COMPARED, _NEAR = 64, 1e-4


def runtime(modules: Sequence[nn.Module], squash: str) -> Network:
    """The network of the compiled runtime with the layers of a PyTorch network.

    Raises:
        TypeError: There is another module, or activations of several kinds.
    """
    linear, between = modules[::2], modules[1::2]
    names = [name for name, kind in ACTIVATIONS.items() if all(type(module) is kind for module in between)]
    if not names or not all(isinstance(layer, nn.Linear) for layer in linear) or len(linear) != len(between) + 1:
        raise TypeError(f"expected linear layers with one of {', '.join(ACTIVATIONS)} between them, got {modules}")
    weights, biases = ([getattr(layer, part).detach().cpu().numpy() for layer in linear] for part in ("weight", "bias"))
    return Network(tuple(weights), tuple(biases), names[0], squash)


def export(
    model: BaseAlgorithm, envs: LearningVecEnv, file: str | pathlib.Path, training: Mapping[str, Any] | None = None
) -> str:
    """Writes a model as an agent that needs no learning library: ``ikgym evaluate --policies agent:FILE`` plays it.

    Args:
        model: PPO, A2C, SAC, TD3 or DDPG with Stable-Baselines3's `MlpPolicy`.
        envs: The environment of its training, of :func:`ikgym.sb3.make_vec`, without a history.
        file: Usually ``NAME.safetensors``.
        training: Description of the training, as JSON values.

    Returns:
        The agent's hash.

    Raises:
        InvalidInputError: The model is another, or the environment shows more than agents see.
        ResultsError: The file cannot be written.
    """
    return save_agent(pathlib.Path(file), agent_of_model(model, envs, training))


def agent_of_model(model: BaseAlgorithm, envs: LearningVecEnv, training: Mapping[str, Any] | None = None) -> AgentFile:
    """A model as an agent in memory; see :func:`export`.

    Raises:
        InvalidInputError: The model is another, or the environment shows more than agents see.
    """
    if not isinstance(envs, LearningVecEnv):
        raise InvalidInputError(f"envs: expected arms of ikgym.sb3.make_vec, got {type(envs).__name__}.")
    task, scenario, problem = envs.task, envs.scenario, Problem.of(envs.scenario)
    try:
        network = runtime(*_actor(model.policy))
    except TypeError as e:
        raise InvalidInputError(f"model: {e}.") from None
    processing = Track(task.ahead, task.share, task.radian, task.coarse, task.fine)
    sizes, needed = (network.sizes[0], network.sizes[-1]), (processing.size(problem), processing.outputs(problem))
    if sizes != needed:
        raise InvalidInputError(
            f"model: expected a network from {needed[0]} features to {needed[1]} outputs, got {sizes[0]} and "
            f"{sizes[1]}; agents see no history, no inverse, no commands and no ages."
        )
    _check_actions(model, network)
    return agent_of(network, processing, scenario, training)


def _actor(policy: Any) -> tuple[list[nn.Module], str]:
    """The layers from features to actions, and the squashing of actions to ±1.

    Raises:
        InvalidInputError: The policy is of another kind.
    """
    if isinstance(policy, RecurrentActorCriticPolicy):
        raise InvalidInputError("model: expected one without memory, as agents in files are, got an LSTM.")
    if isinstance(policy, ActorCriticPolicy):
        return [*policy.mlp_extractor.policy_net, policy.action_net], "clip"
    if isinstance(policy, SACPolicy):
        last: Any = policy.actor.mu  # with gSDE a layer and a Hardtanh
        return [*policy.actor.latent_pi, last[0] if isinstance(last, nn.Sequential) else last], "tanh"
    if isinstance(policy, TD3Policy):
        return [*policy.actor.mu][:-1], "tanh"
    raise InvalidInputError(
        f"model: expected one of PPO, A2C, SAC, TD3 and DDPG with an MlpPolicy, got {type(policy).__name__}."
    )


def _check_actions(model: BaseAlgorithm, network: Network) -> None:
    """Compares the actions of a model with those of its network.

    Raises:
        InvalidInputError: They differ: there is more to the model than its layers.
    """
    features = np.random.default_rng(0).uniform(-1.0, 1.0, (_COMPARED, network.sizes[0])).astype(np.float32)
    actions, _ = model.predict(features, deterministic=True)
    if not np.abs(actions - network.forward(features)).max() <= _NEAR:
        raise InvalidInputError("model: its actions are not those of its layers; a custom features extractor?")
