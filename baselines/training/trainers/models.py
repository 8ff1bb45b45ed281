"""Models of Stable-Baselines3, and what is the same in all kinds of them: a network whose outputs are squashed."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
import torch
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor, nn

from baselines.agents.features import Features
from baselines.agents.protocols import Transform
from baselines.training.config.base import Activation, Algorithm
from baselines.training.config.reinforcement import Output
from baselines.training.networks import ACTIVATIONS, QUIET, ActorModel, MemoryModel
from baselines.training.policies.asymmetric import AsymmetricPPOPolicy, AsymmetricSACPolicy, AsymmetricTD3Policy
from baselines.training.policies.bilinear import (
    BilinearActor,
    BilinearPPOPolicy,
    BilinearSACPolicy,
    BilinearTD3Policy,
)
from baselines.training.policies.null_space import NullSpacePPOPolicy
from baselines.training.score import Score
from baselines.training.validation import validate
from ikgym.scenarios import Scenario

ALGORITHMS: dict[Algorithm, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3}
BILINEAR: dict[Algorithm, type[BasePolicy]] = {
    "ppo": BilinearPPOPolicy,
    "sac": BilinearSACPolicy,
    "td3": BilinearTD3Policy,
}

ASYMMETRIC: dict[Algorithm, type[BasePolicy]] = {
    "ppo": AsymmetricPPOPolicy,
    "sac": AsymmetricSACPolicy,
    "td3": AsymmetricTD3Policy,
}

#: How network outputs are kept within ±1.
Squash = Literal["clip", "tanh", "linear"]
#: What a run trains.
Model = BaseAlgorithm | ActorModel


def new_model(
    algorithm: Algorithm,
    env: VecEnv,
    hidden: Sequence[int],
    activation: Activation,
    log_std_init: float = -2.0,
    use_sde: bool = False,
    output: tuple[Output, float | None] = ("velocities", None),
    seen: int | None = None,
    freedom: int | None = None,
    **parameters: Any,
) -> BaseAlgorithm:
    """An untrained model, whose first outputs are almost 0.

    Its first weights are drawn from the generator of PyTorch that all share.

    Args:
        algorithm: Its kind.
        env: What it is trained in.
        hidden: Neurons of the hidden layers, of actor and critics alike.
        activation: Of the hidden layers.
        log_std_init: Logarithm of the standard deviation of its outputs, before tanh where there is one; TD3 has none.
        use_sde: Whether noise is a function of what is seen (gSDE). Not for TD3.
        output: What the actor's network gives, and the damping of a bilinear one, whose environment is that of
            :func:`ikgym.sb3.make_vec`.
        seen: How many of the numbers observed the actor sees, the first ones; all if left out.
        freedom: How many joints the task leaves free, for PPO whose noise is in the null space.
        **parameters: Of the class of Stable-Baselines3.
    """
    bilinear, damping = output[0] == "bilinear", output[1]
    critic = "vf" if algorithm == "ppo" else "qf"
    policy: dict[str, Any] = {
        "net_arch": {"pi": list(hidden), critic: list(hidden)},
        "activation_fn": ACTIVATIONS[activation],
    }
    if bilinear:
        policy["damping"] = damping
    if algorithm != "td3":
        policy["log_std_init"] = log_std_init
    if use_sde:
        parameters |= {"use_sde": True}
        if algorithm == "sac":
            policy["clip_mean"] = 0.0  # or there would be more to the actor than layers
    if seen is not None:
        policy["seen"] = seen
    kind: type[BasePolicy] | str = "MlpPolicy"
    if bilinear or seen is not None:
        kind = (BILINEAR if bilinear else ASYMMETRIC)[algorithm]
    if freedom is not None:
        kind, policy["freedom"] = NullSpacePPOPolicy, freedom
    model: Any = ALGORITHMS[algorithm](kind, env, policy_kwargs=policy, device="cpu", **parameters)
    model.set_logger(Logger(None, []))
    with torch.no_grad():
        last: Any = mean_network(model)[-1]
        if algorithm != "ppo" and not bilinear:  # whose policies see to it by themselves
            last.weight.mul_(QUIET)
            last.bias.zero_()
        if algorithm == "sac" and not use_sde:
            spread: Any = model.policy.actor.log_std[-1] if bilinear else model.policy.actor.log_std
            spread.weight.mul_(QUIET)
            spread.bias.fill_(log_std_init)
        if algorithm == "td3":
            model.policy.actor_target.load_state_dict(model.policy.actor.state_dict())
    made: BaseAlgorithm = model
    return made


def algorithm_of(model: BaseAlgorithm) -> Algorithm:
    """The kind of a model.

    Raises:
        TypeError: It is of no kind that is known here.
    """
    for name, kind in ALGORITHMS.items():
        if isinstance(model, kind):
            return name
    raise TypeError(f"expected one of {', '.join(ALGORITHMS)}, got {type(model).__name__}")


def squash_of(algorithm: Algorithm) -> Squash:
    """How a kind of models keeps its outputs within ±1."""
    return "clip" if algorithm == "ppo" else "tanh"


def squash_of_model(model: Model) -> Squash:
    """How a model keeps its outputs within ±1; `linear` where it does not."""
    if isinstance(model, ActorModel) or bilinear_actor(model) is not None:
        return "linear"
    return squash_of(algorithm_of(model))


def bilinear_actor(model: BaseAlgorithm) -> BilinearActor | None:
    """The bilinear actor of a model; None where its actor is another."""
    return next((module for module in model.policy.modules() if isinstance(module, BilinearActor)), None)


def mean_network(model: Model) -> nn.Sequential:
    """From features to the mean of the outputs, before they are squashed; it shares the model's weights.

    Returns:
        Linear layers with activations in between, the last one without.
    """
    if isinstance(model, ActorModel):
        return model.policy
    bilinear = bilinear_actor(model)
    if bilinear is not None:
        return bilinear.network
    algorithm = algorithm_of(model)
    policy: Any = model.policy
    if algorithm == "ppo":
        return nn.Sequential(*policy.mlp_extractor.policy_net, policy.action_net)
    if algorithm == "sac":
        return nn.Sequential(*policy.actor.latent_pi, policy.actor.mu)
    return nn.Sequential(*list(policy.actor.mu)[:-1])  # without the tanh


_SQUASHED: dict[Squash, Callable[[Tensor], Tensor]] = {
    "clip": lambda mean: mean.clamp(-1.0, 1.0),
    "tanh": torch.tanh,
    "linear": lambda mean: mean,
}


def network_outputs(model: Model, features: Features) -> Features:
    """The deterministic outputs of a model's actor.

    Args:
        model: Of any kind.
        features: Shape (N, f).

    Returns:
        Within ±1, unless they are linear. Shape (N, outputs).
    """
    with torch.no_grad():
        mean = mean_network(model)(torch.from_numpy(features))
        squashed = _SQUASHED[squash_of_model(model)](mean)
    out: Features = squashed.numpy()
    return out


def score_of_model(model: Model, processing: Transform, scenario: Scenario, episodes: int) -> Score:
    """How good a model is on the first so many episodes of the validation split."""
    return validate(lambda features: network_outputs(model, features), processing, scenario, episodes)


def weights_hash(model: Model | MemoryModel) -> str:
    """SHA-256 of all weights of a model's policy, critics included."""
    digest = hashlib.sha256()
    for name, tensor in sorted(model.policy.state_dict().items()):
        array = np.ascontiguousarray(tensor.detach().cpu().numpy())
        digest.update(f"{name} {array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
