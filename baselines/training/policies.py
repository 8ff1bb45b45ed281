"""Policies of Stable-Baselines3 for the environments of :func:`ikgym.sb3.make_vec`, with a bilinear actor.

>>> from stable_baselines3 import PPO
>>> model = PPO(BilinearPPOPolicy, ikgym.sb3.make_vec("panda-random", 8))
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.sac.policies import Actor as SACActor
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import Actor as TD3Actor
from stable_baselines3.td3.policies import TD3Policy
from torch import Tensor, nn

from baselines.training.networks import ActorModel
from ikgym.rl import Learning
from ikgym.rl.feature_kernels import LEAST

#: Of a twist: tasks with an orientation.
TWIST = 6
#: Hidden layers of the network behind G and h.
HIDDEN = (64, 64)


class BilinearActor(nn.Module):
    """(G v̂ + h) / (0.2 + |v̂|): the mean action, linear in the twist that is due, in units of `share`.

    G and h come from a network that sees all features; what is due is among them, see
    :class:`ikgym.rl.AgentObservation`. The critics are those of Stable-Baselines3, which see it as well.

    Args:
        features: f.
        joints: n.
        twist: w, 3 for tasks of position alone.
        share: Of the unit that an action of 1 means.
        hidden: Neurons of the hidden layers.
    """

    def __init__(self, features: int, joints: int, twist: int, share: float, hidden: tuple[int, ...] = HIDDEN) -> None:
        super().__init__()
        self.network = ActorModel.new((features, *hidden, joints * (twist + 1)), "silu").policy
        self.joints, self.twist, self.share = joints, twist, share

    def forward(self, features: Tensor) -> Tensor:
        """Mean actions. Shape (B, n)."""
        n, w = self.joints, self.twist
        due = features[:, -n - 1 - w : -n]
        due = torch.cat([due[:, :w], due[:, w:] / LEAST], dim=1)
        rows = self.network(features).reshape(-1, n, w + 1)
        return (rows * due[:, None]).sum(dim=2) / self.share


class _Extractor(MlpExtractor):
    """The critic's layers of Stable-Baselines3, and the bilinear actor in place of its own."""

    def __init__(self, actor: BilinearActor, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.policy_net, self.latent_dim_pi = actor, actor.joints


class BilinearPPOPolicy(ActorCriticPolicy):
    """:class:`BilinearActor` for PPO and A2C.

    Args:
        *args: As of Stable-Baselines3's `MlpPolicy`.
        twist: See :class:`BilinearActor`.
        share: See there.
        **kwargs: As of `MlpPolicy`.
    """

    def __init__(self, *args: Any, twist: int = TWIST, share: float = Learning.share, **kwargs: Any) -> None:
        self._twist, self._share = twist, share
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        actor = BilinearActor(self.features_dim, *_sizes(self.action_space, self._twist), self._share)
        self.mlp_extractor = _Extractor(actor, self.features_dim, self.net_arch, self.activation_fn, self.device)

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        self.action_net = nn.Identity()  # what the actor says are the actions
        self.mlp_extractor.policy_net.network[-1].weight.data.mul_(0.01)  # after the orthogonal initialisation
        self.optimizer = self.optimizer_class(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)


class _BilinearSACActor(SACActor):
    def __init__(self, *args: Any, twist: int, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.mu = _Bounded(self.features_dim, self.action_space, twist)
        self.log_std = nn.Sequential(nn.Linear(self.features_dim, 64), nn.ReLU(), nn.Linear(64, self.mu.actor.joints))
        self.latent_pi = nn.Identity()


class BilinearSACPolicy(SACPolicy):
    """:class:`BilinearActor` for SAC; tanh keeps it within the box. Arguments as of :class:`BilinearPPOPolicy`."""

    def __init__(self, *args: Any, twist: int = TWIST, **kwargs: Any) -> None:
        self._twist = twist
        super().__init__(*args, **kwargs)

    def make_actor(self, features_extractor: Any = None) -> _BilinearSACActor:
        """The actor, see Stable-Baselines3."""
        kwargs = self._update_features_extractor(self.actor_kwargs, features_extractor)
        return _BilinearSACActor(**kwargs, twist=self._twist).to(self.device)


class _BilinearTD3Actor(TD3Actor):
    def __init__(self, *args: Any, twist: int, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.mu = nn.Sequential(_Bounded(self.features_dim, self.action_space, twist), nn.Tanh())


class BilinearTD3Policy(TD3Policy):
    """:class:`BilinearActor` for TD3; tanh keeps it within the box. Arguments as of :class:`BilinearPPOPolicy`."""

    def __init__(self, *args: Any, twist: int = TWIST, **kwargs: Any) -> None:
        self._twist = twist
        super().__init__(*args, **kwargs)

    def make_actor(self, features_extractor: Any = None) -> _BilinearTD3Actor:
        """The actor, see Stable-Baselines3."""
        kwargs = self._update_features_extractor(self.actor_kwargs, features_extractor)
        return _BilinearTD3Actor(**kwargs, twist=self._twist).to(self.device)


class _Bounded(nn.Module):
    """A bilinear actor before tanh, in units of the box, whose bound is the largest velocity in units."""

    def __init__(self, features: int, space: Any, twist: int) -> None:
        super().__init__()
        self.actor = BilinearActor(features, *_sizes(space, twist), share=Learning.largest)

    def forward(self, features: Tensor) -> Tensor:
        """Shape (B, n)."""
        out: Tensor = self.actor(features)
        return out


def _sizes(space: Any, twist: int) -> tuple[int, int]:
    """Joints, and components of a twist."""
    return int(space.shape[0]), twist
