"""Policies of Stable-Baselines3 for the environments of :func:`ikgym.sb3.make_vec`, with a bilinear actor.

>>> from stable_baselines3 import PPO
>>> model = PPO(BilinearPPOPolicy, ikgym.sb3.make_vec("panda-random", 8))
>>> envs = ikgym.sb3.make_vec("panda-random", 8, jacobian=True)
>>> model = PPO(BilinearPPOPolicy, envs, policy_kwargs={"damping": 4e-4})  # begins as damped least squares
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.sac.policies import Actor as SACActor
from stable_baselines3.sac.policies import SACPolicy
from stable_baselines3.td3.policies import Actor as TD3Actor
from stable_baselines3.td3.policies import TD3Policy
from torch import Tensor, nn

from baselines.agents.bilinear.damped_kernels import LARGEST
from baselines.training.config.base import Activation
from baselines.training.networks import QUIET, ActorModel
from ikgym.exceptions import InvalidInputError
from ikgym.rl.feature_kernels import LEAST
from ikgym.rl.view import due_size

#: Of the network behind G and h.
ACTIVATION: Activation = "silu"


class BilinearActor(nn.Module):
    """(G v̂ + h) / (0.2 + |v̂|), linear in the twist that is due: the mean velocity, in units of what is asked for.

    G and h come from a network that sees all features; what is due is the first of them, see
    :class:`ikgym.rl.AgentObservation`. The critics are those of Stable-Baselines3, which see it as well.

    With a damping, G is what the network adds to U Jᵀ (J U Jᵀ + λ I)⁻¹, and h moves in the null space, see
    :class:`baselines.agents.bilinear.processing.Bilinear`; J are the last of the features, which the network itself
    does not see.

    Args:
        space: Of the features.
        joints: n.
        hidden: Neurons of the hidden layers.
        damping: λ where the network says 0; None for no inverse.
    """

    def __init__(self, space: Any, joints: int, hidden: Sequence[int], damping: float | None = None) -> None:
        super().__init__()
        self.joints, self.twist, self.damping = joints, due_size(space), damping
        inverse = damping is not None
        self.seen = space.shape[0] - inverse * self.twist * joints
        outputs = joints * (self.twist + 1) + inverse * (1 + joints)
        self.network = ActorModel.new((self.seen, *hidden, outputs), ACTIVATION).policy

    def forward(self, features: Tensor) -> Tensor:
        """Mean velocities in units. Shape (B, n)."""
        n, w = self.joints, self.twist
        due = torch.cat([features[:, :w], features[:, w : w + 1] / LEAST], dim=1)
        output = self.network(features[:, : self.seen])
        rows = output[:, : n * (w + 1)].reshape(-1, n, w + 1)
        out: Tensor
        if self.damping is None:
            out = (rows * due[:, None]).sum(dim=2)
            return out
        jacobian = features[:, self.seen :].reshape(-1, w, n).double()
        matrices, null_motion = rows[:, :, :w].double(), (rows[:, :, w] * due[:, w:]).double()
        logarithms = output[:, n * (w + 1) :].double().clamp(-LARGEST, LARGEST)
        weighted = jacobian * logarithms[:, None, 1:].exp()
        damped = self.damping * logarithms[:, :1, None].exp() * torch.eye(w, dtype=torch.float64)
        # What h alone would do to the tool is taken back.
        left = due[:, :w, None].double() - jacobian @ null_motion[:, :, None]
        shares = torch.linalg.solve(weighted @ jacobian.transpose(1, 2) + damped, left)
        out = null_motion + (matrices @ left + weighted.transpose(1, 2) @ shares)[:, :, 0]
        return out.float()


class _Shares(nn.Module):
    """Velocities in units as shares of the bound of the box, which Stable-Baselines3 multiplies tanh of them by."""

    def __init__(self, actor: BilinearActor, space: Any) -> None:
        super().__init__()
        self.actor, self.bound = actor, float(space.high[0])

    def forward(self, features: Tensor) -> Tensor:
        """Shape (B, n)."""
        out: Tensor = self.actor(features) / self.bound
        return out


class _Extractor(MlpExtractor):
    """The critic's layers of Stable-Baselines3, and a bilinear actor in place of its own."""

    def __init__(self, actor: BilinearActor, *args: Any) -> None:
        super().__init__(*args)
        self.policy_net, self.latent_dim_pi = nn.Sequential(actor), actor.joints


class _Policy:
    """What the policies have in common: the argument `damping`."""

    def __init__(self, *args: Any, damping: float | None = None, **kwargs: Any) -> None:
        self._damping = damping
        super().__init__(*args, **kwargs)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        """What a saved policy is made from again."""
        return {**super()._get_constructor_parameters(), "damping": self._damping}  # type: ignore[misc]


class BilinearPPOPolicy(_Policy, ActorCriticPolicy):
    """:class:`BilinearActor` for PPO and A2C. Arguments as of Stable-Baselines3's `MlpPolicy`, and `damping`."""

    def _build_mlp_extractor(self) -> None:
        hidden = self.net_arch["pi"] if isinstance(self.net_arch, dict) else self.net_arch
        actor = BilinearActor(self.observation_space, _joints(self.action_space), hidden, self._damping)
        self.mlp_extractor = _Extractor(actor, self.features_dim, self.net_arch, self.activation_fn, self.device)

    def _build(self, lr_schedule: Any) -> None:
        super()._build(lr_schedule)
        self.action_net: nn.Module = nn.Identity()  # what the actor says are the actions
        actor, optimizer = cast(BilinearActor, self.mlp_extractor.policy_net[0]), cast(Any, self.optimizer_class)
        cast(nn.Linear, actor.network[-1]).weight.data.mul_(QUIET)  # after the orthogonal initialisation
        self.optimizer = optimizer(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)


class _BilinearSACActor(SACActor):
    def __init__(self, *args: Any, damping: float | None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        if self.use_sde:
            raise InvalidInputError("use_sde: expected False for a bilinear actor, got True.")
        actor = BilinearActor(self.observation_space, _joints(self.action_space), self.net_arch, damping)
        self.mu: nn.Module = _Shares(actor, self.action_space)
        head: Any = self.log_std
        self.log_std = nn.Sequential(self.latent_pi, head)  # type: ignore[assignment]  # declared for use_sde
        self.latent_pi = nn.Sequential()


class BilinearSACPolicy(_Policy, SACPolicy):
    """:class:`BilinearActor` for SAC, which tanh keeps within the box.

    Arguments as of SAC's `MlpPolicy`, and `damping`.
    """

    def make_actor(self, features_extractor: Any = None) -> _BilinearSACActor:
        """The actor, see Stable-Baselines3."""
        kwargs = self._update_features_extractor(self.actor_kwargs, features_extractor)
        return _BilinearSACActor(**kwargs, damping=self._damping).to(self.device)


class _BilinearTD3Actor(TD3Actor):
    def __init__(self, *args: Any, damping: float | None, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        actor = BilinearActor(self.observation_space, _joints(self.action_space), self.net_arch, damping)
        self.mu = nn.Sequential(_Shares(actor, self.action_space), nn.Tanh())


class BilinearTD3Policy(_Policy, TD3Policy):
    """:class:`BilinearActor` for TD3, which tanh keeps within the box.

    Arguments as of TD3's `MlpPolicy`, and `damping`.
    """

    def make_actor(self, features_extractor: Any = None) -> _BilinearTD3Actor:
        """The actor, see Stable-Baselines3."""
        kwargs = self._update_features_extractor(self.actor_kwargs, features_extractor)
        return _BilinearTD3Actor(**kwargs, damping=self._damping).to(self.device)


def _joints(space: Any) -> int:
    return int(space.shape[0])
