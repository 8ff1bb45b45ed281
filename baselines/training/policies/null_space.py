"""PPO that explores what a null motion changes, and nothing else.

>>> from stable_baselines3 import PPO
>>> envs = InverseVecEnv(64, "panda-random", null_map=True)
>>> model = PPO(NullSpacePPOPolicy, envs, policy_kwargs={"seen": envs.seen, "freedom": envs.freedom})
"""

from __future__ import annotations

from typing import Any

import torch
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.preprocessing import get_action_dim, get_flattened_obs_dim
from stable_baselines3.common.torch_layers import MlpExtractor
from stable_baselines3.common.type_aliases import Schedule
from torch import Tensor, nn
from torch.distributions import Normal

from baselines.training.policies.asymmetric import AsymmetricPPOPolicy
from ikgym.exceptions import InvalidInputError


class NullSpaceGaussian(Distribution):
    """Normal noise of the null motion, in coordinates of the null space, and of ln λ; none of ln U.

    Actions are h, ln λ and ln U. Of h the arm does M h, of which there are r = n - w numbers. A normal distribution of
    all n numbers of h has noise in w directions that change nothing, and whose share in a policy gradient is noise
    alone. This is the distribution of what is done: a density by (M h, ln λ). The action that stands for it is the mean
    with the smallest change of h.
    """

    mean: Tensor
    maps: Tensor
    noise: Any

    def proba_distribution_net(self, *args: Any, **kwargs: Any) -> nn.Module:
        """The policy has its own layers."""
        raise NotImplementedError

    def proba_distribution(self, mean: Tensor, maps: Tensor, log_std: Tensor) -> NullSpaceGaussian:
        """That of some states.

        Args:
            mean: Shape (B, 2 n + 1).
            maps: M. Shape (B, r, n).
            log_std: Of M h and of ln λ. Shape (r + 1,).
        """
        self.mean, self.maps = mean, maps
        zeros = torch.zeros(len(mean), len(log_std))
        self.noise = Normal(zeros, log_std.exp().expand_as(zeros))
        return self

    def log_prob(self, actions: Tensor) -> Tensor:
        """Of (M h, ln λ). Shape (B,)."""
        n = self.maps.shape[2]
        moved = actions - self.mean
        done = (self.maps @ moved[:, :n, None])[:, :, 0]
        out: Tensor = self.noise.log_prob(torch.cat([done, moved[:, n : n + 1]], dim=1)).sum(dim=1)
        return out

    def entropy(self) -> Tensor:
        """In [nat]. Shape (B,)."""
        out: Tensor = self.noise.entropy().sum(dim=1)
        return out

    def sample(self) -> Tensor:
        """Shape (B, 2 n + 1)."""
        noise, n = self.noise.rsample(), self.maps.shape[2]
        along, damping = noise[:, :-1], noise[:, -1:]
        transposed = self.maps.transpose(1, 2)
        by_joints = (transposed @ torch.linalg.solve(self.maps @ transposed, along[:, :, None]))[:, :, 0]
        return self.mean + torch.cat([by_joints, damping, torch.zeros(len(noise), n)], dim=1)

    def mode(self) -> Tensor:
        """The mean. Shape (B, 2 n + 1)."""
        return self.mean

    def actions_from_params(self, mean: Tensor, maps: Tensor, log_std: Tensor, deterministic: bool = False) -> Tensor:
        """Actions of some states, see :meth:`proba_distribution`."""
        return self.proba_distribution(mean, maps, log_std).get_actions(deterministic)

    def log_prob_from_params(self, mean: Tensor, maps: Tensor, log_std: Tensor) -> tuple[Tensor, Tensor]:
        """Actions of some states, and their log-probability."""
        actions = self.actions_from_params(mean, maps, log_std)
        return actions, self.log_prob(actions)


class _ExtractorWithMaps(MlpExtractor):
    """What is behind the features, unchanged, beside what the layers of the actor make of these."""

    maps: int

    def forward_actor(self, features: Tensor) -> Tensor:
        """Shape (B, hidden + maps)."""
        return torch.cat([self.policy_net(features), features[:, -self.maps :]], dim=1)


class NullSpacePPOPolicy(AsymmetricPPOPolicy):
    """For PPO in an :class:`baselines.training.environment.inverse_env.InverseVecEnv` with `null_map`.

    Arguments as of Stable-Baselines3's `MlpPolicy`, `seen`, and `freedom`, how many joints the task leaves free.

    Raises:
        InvalidInputError: The environment shows no maps of the null space, or `use_sde` is given, which is noise of
            another kind.
    """

    def __init__(self, *args: Any, freedom: int, **kwargs: Any) -> None:
        self._freedom = freedom
        super().__init__(*args, **kwargs)

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return {**super()._get_constructor_parameters(), "freedom": self._freedom}

    @property
    def _joints(self) -> int:
        return (get_action_dim(self.action_space) - 1) // 2

    def _build_mlp_extractor(self) -> None:
        extractor = _ExtractorWithMaps(self.features_dim, self.net_arch, self.activation_fn, self.device)
        extractor.maps = self._freedom * self._joints
        self.mlp_extractor = extractor
        self._narrow(extractor.policy_net)

    def _build(self, lr_schedule: Schedule) -> None:
        self._check()
        super()._build(lr_schedule)
        self.action_dist = NullSpaceGaussian()  # type: ignore[no-untyped-call]
        self.log_std = nn.Parameter(torch.full((self._freedom + 1,), self.log_std_init))
        make: Any = self.optimizer_class
        self.optimizer = make(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    def _check(self) -> None:
        """Insists on what :class:`InverseVecEnv` shows behind the features: for critics, or nothing, and the maps."""
        if self.use_sde:
            raise InvalidInputError("use_sde: expected false, noise is drawn in coordinates of the null space.")
        n, maps = self._joints, self._freedom * self._joints
        behind = get_flattened_obs_dim(self.observation_space) - self._seen
        if behind not in (maps, maps + n + 1):
            raise InvalidInputError(
                f"env: expected {maps} or {maps + n + 1} numbers behind the {self._seen} features, as InverseVecEnv "
                f"shows with null_map=True, got {behind}."
            )

    def _get_action_dist_from_latent(self, latent_pi: Tensor) -> Distribution:
        n, r = self._joints, self._freedom
        latent, maps = latent_pi[:, : -r * n], latent_pi[:, -r * n :].reshape(-1, r, n)
        return self.action_dist.proba_distribution(self.action_net(latent), maps, self.log_std)
