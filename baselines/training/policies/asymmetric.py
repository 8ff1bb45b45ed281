"""Policies of Stable-Baselines3 whose critics see more than their actor does (Pinto et al. 2018).

What a critic sees is needed in training alone: the actor that comes out of it never sees it.

>>> from stable_baselines3 import TD3
>>> envs = InverseVecEnv(64, "panda-random", privileged=True)
>>> model = TD3(AsymmetricTD3Policy, envs, policy_kwargs={"seen": envs.seen})
"""

from __future__ import annotations

from typing import Any

from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import TD3Policy
from torch import Tensor, nn


class Leading(nn.Linear):
    """A linear layer that sees the first of its inputs alone."""

    def forward(self, inputs: Tensor) -> Tensor:
        """Shape (B, at least in_features) to (B, out_features)."""
        return super().forward(inputs[..., : self.in_features])


class _Asymmetric:
    """What the policies have in common: the argument `seen`, how many of the numbers observed the actor sees."""

    def __init__(self, *args: Any, seen: int, **kwargs: Any) -> None:
        self._seen = seen
        super().__init__(*args, **kwargs)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        """What a saved policy is made from again."""
        return {**super()._get_constructor_parameters(), "seen": self._seen}  # type: ignore[misc]

    def _narrow(self, layers: nn.Sequential) -> None:
        first: Any = layers[0]
        layers[0] = Leading(self._seen, first.out_features)


class AsymmetricPPOPolicy(_Asymmetric, ActorCriticPolicy):
    """For PPO and A2C. Arguments as of Stable-Baselines3's `MlpPolicy`, and `seen`."""

    def _build_mlp_extractor(self) -> None:
        super()._build_mlp_extractor()
        self._narrow(self.mlp_extractor.policy_net)


class AsymmetricSACPolicy(_Asymmetric, SACPolicy):
    """For SAC. Arguments as of its `MlpPolicy`, and `seen`."""

    def make_actor(self, features_extractor: Any = None) -> Any:
        """The actor, see Stable-Baselines3."""
        actor = super().make_actor(features_extractor)
        self._narrow(actor.latent_pi)
        return actor


class AsymmetricTD3Policy(_Asymmetric, TD3Policy):
    """For TD3 and DDPG. Arguments as of TD3's `MlpPolicy`, and `seen`."""

    def make_actor(self, features_extractor: Any = None) -> Any:
        """The actor, see Stable-Baselines3."""
        actor = super().make_actor(features_extractor)
        self._narrow(actor.mu)
        return actor
