"""The actor of a model of Stable-Baselines3, from the names and numbers of its tensors."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from baselines.agents.network import Network
from ikgym.exceptions import InvalidInputError

#: What a model remembers: tensors by name.
State = Mapping[str, npt.NDArray[Any]]

_CRITICS = r"(critic|critic_target)\.qf\d+\.\d+\.(weight|bias)"
_LAYER = r"\.(\d+)\.(weight|bias)"


@dataclasses.dataclass(frozen=True)
class Family:
    """Algorithms whose actors are built alike.

    Args:
        algorithms: Their names.
        hidden: What the names of hidden layers begin with.
        last: What the names of the last layer begin with; None where it is the last of the hidden ones.
        others: A pattern for the names of all tensors that are no part of the actor's mean.
        squash: See :class:`baselines.agents.network.Network`.
        activation: That of Stable-Baselines3 where none is asked for.
    """

    algorithms: str
    hidden: str
    last: str | None
    others: str
    squash: str
    activation: str


FAMILIES: Final = (
    Family(
        "PPO, A2C",
        "mlp_extractor.policy_net",
        "action_net",
        rf"log_std|value_net\.(weight|bias)|mlp_extractor\.value_net{_LAYER}",
        "clip",
        "tanh",
    ),
    Family("SAC", "actor.latent_pi", "actor.mu", rf"actor\.log_std\.(weight|bias)|{_CRITICS}", "tanh", "relu"),
    Family("TD3, DDPG", "actor.mu", None, rf"actor_target\.mu{_LAYER}|{_CRITICS}", "tanh", "relu"),
)

#: Activations by how Python prints their classes.
CLASSES: Final = {
    f"<class 'torch.nn.modules.activation.{name}'>": name.lower() for name in ("ReLU", "Tanh", "SiLU", "ELU")
} | {"<class 'torch.nn.modules.linear.Identity'>": "linear"}

#: Features that are the flat observation.
_EXTRACTORS: Final = {
    f"<class 'stable_baselines3.common.torch_layers.{name}'>" for name in ("FlattenExtractor", "CombinedExtractor")
}
#: Arguments of policies that change nothing in the network of the actor that its tensors would not show.
_HARMLESS: Final = {
    "net_arch",
    "ortho_init",
    "log_std_init",
    "full_std",
    "use_sde",
    "use_expln",
    "optimizer_class",
    "optimizer_kwargs",
    "share_features_extractor",
    "features_extractor_kwargs",
    "normalize_images",
    "n_critics",
    "clip_mean",
    "seen",
    "freedom",
}


def network_of(state: State, arguments: Mapping[str, Any]) -> Network:
    """The actor's network, with which a model acts deterministically.

    Args:
        state: The tensors of the model's policy.
        arguments: The `policy_kwargs` of the model. Classes stand as Python prints them.

    Raises:
        InvalidInputError: It is no multi-layer perceptron, or one that has more to it than its tensors show.
    """
    family = next((f for f in FAMILIES if _fits(state, f)), None)
    if family is None:
        raise InvalidInputError(
            "expected the tensors of a multi-layer perceptron of "
            f"{', '.join(f.algorithms for f in FAMILIES)}, got {', '.join(sorted(state)) or 'none'}"
        )
    activation = _activation(arguments, family.activation)
    layers = _numbers(state, family.hidden)
    # Every other module is an activation, which has no tensors.
    if layers != list(range(0, 2 * len(layers), 2)):
        raise InvalidInputError(
            f"expected layers {family.hidden}.0, .2, .4 … with an activation behind each, got the numbers {layers}"
        )
    names = [f"{family.hidden}.{number}" for number in layers] + ([] if family.last is None else [family.last])
    weights = tuple(state[f"{name}.weight"].astype(np.float32) for name in names)
    biases = tuple(state[f"{name}.bias"].astype(np.float32) for name in names)
    return Network(weights, biases, activation, family.squash)


def _fits(state: State, family: Family) -> bool:
    """Whether all tensors have their place in a family, and none is missing."""
    last = "" if family.last is None else rf"|{re.escape(family.last)}\.(weight|bias)"
    pattern = re.compile(rf"{re.escape(family.hidden)}{_LAYER}{last}|{family.others}")
    ends = [f"{family.hidden}.{number}" for number in _numbers(state, family.hidden)]
    ends = ends if family.last is None else [*ends, family.last]
    whole = all(f"{end}.{part}" in state for end in ends for part in ("weight", "bias"))
    return bool(ends) and whole and all(map(pattern.fullmatch, state))


def _numbers(state: State, prefix: str) -> list[int]:
    """The numbers of the layers whose names have a prefix."""
    pattern = re.compile(rf"{re.escape(prefix)}\.(\d{{1,6}})\.weight")
    return sorted(int(match[1]) for match in map(pattern.fullmatch, state) if match)


def _activation(arguments: Mapping[str, Any], usual: str) -> str:
    """The name of the activation; refuses arguments that may change what the tensors do not show."""
    extractor = arguments.get("features_extractor_class")
    if extractor is not None and str(extractor) not in _EXTRACTORS:
        raise InvalidInputError(f"expected no extractor of features of its own, got {extractor}")
    known = {*_HARMLESS, "features_extractor_class", "activation_fn"}
    if unknown := sorted(set(arguments) - known):
        raise InvalidInputError(f"expected no arguments of the policy but {sorted(known)}, got {unknown}")
    named = arguments.get("activation_fn")
    if named is None:
        return usual
    if str(named) not in CLASSES:
        raise InvalidInputError(f"activation_fn: expected one of {', '.join(CLASSES)}, got {named}")
    return CLASSES[str(named)]
