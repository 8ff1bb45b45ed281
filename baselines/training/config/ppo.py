"""What runs of PPO are, with the hyperparameters of Stable-Baselines3 by its names."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar

import tyro

from baselines.agents.relative.processing import Squash
from baselines.training.config.limits import between, share
from baselines.training.config.reinforcement import LOG_STD, StateDependentExploration
from ikgym.exceptions import InvalidInputError
from ikgym.validation import flag, number, whole_number


@dataclasses.dataclass(frozen=True, kw_only=True)
class PPO(StateDependentExploration):
    """Proximal policy optimisation (Schulman et al. 2017), by Stable-Baselines3."""

    method: ClassVar[str] = "ppo"
    squash: ClassVar[Squash] = "clip"

    n_steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Steps of each arm between two updates: a divisor of the steps of a segment. A whole segment if left out."""
    n_epochs: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Passes over the transitions of an update."""
    gae_lambda: Annotated[float, tyro.conf.arg(metavar="λ")] = 0.95
    """Of the generalised advantage estimation."""
    clip_range: Annotated[float, tyro.conf.arg(metavar="ε")] = 0.2
    """How far the ratio of probabilities may go from 1."""
    target_kl: Annotated[float | None, tyro.conf.arg(metavar="KL")] = None
    """An update ends early where the policy has gone further than this, in [nat]."""
    ent_coef: Annotated[float, tyro.conf.arg(metavar="C")] = 0.0
    """Weight of the entropy in the loss."""
    critic_epochs: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """Passes over the transitions of an update in which the critic learns by itself, before the actor does. With 0 it
    learns with the actor, in n_epochs passes, at the same learning rate."""
    critic_learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 1e-3
    """Of Adam, in these passes."""
    group_size: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Arms that play the same episodes, each with its own actions. From the advantage of each, the mean of those of the
    others at the same time is taken: what is left is due to the actions (leave-one-out baseline, Kool et al. 2019).
    Only for an output that is inverse."""
    critic_group_weight: Annotated[float, tyro.conf.arg(metavar="X")] = 0.0
    """Weight of the differences within groups in the loss of the critic, beside that of values, whose weight is 1:
    groups differ by more than what is in them. Only where the critic learns by itself."""
    null_space_noise: bool = False
    """Whether noise of exploration is drawn in coordinates of the null space, of which there are as many as joints that
    the task leaves free, and of the damping; none of the metric. Otherwise it is drawn in all outputs, of which most
    change nothing and add to the variance of gradients alone. Only for an output that is inverse."""
    log_std_end: Annotated[float | None, tyro.conf.arg(metavar="X")] = None
    """The logarithm of the standard deviation goes from log_std_init to this one, from segment to segment by equal
    parts. It is learned if left out."""

    def __post_init__(self) -> None:
        super().__post_init__()
        # Advantages are divided by their standard deviation in the batch.
        self._set("batch_size", whole_number("batch_size", self.batch_size, at_least=2))
        if self.n_steps is not None:
            self._set("n_steps", whole_number("n_steps", self.n_steps, at_least=1))
        self._set("n_epochs", whole_number("n_epochs", self.n_epochs, at_least=1))
        self._set("critic_epochs", whole_number("critic_epochs", self.critic_epochs, at_least=0))
        self._set("group_size", whole_number("group_size", self.group_size, at_least=1))
        weight = number("critic_group_weight", self.critic_group_weight, at_least=0.0)
        self._set("critic_group_weight", weight)
        flag("null_space_noise", self.null_space_noise)
        if self.n_envs % self.group_size:
            raise InvalidInputError(f"n_envs: expected a multiple of group_size, {self.group_size}, got {self.n_envs}.")
        if weight and (self.group_size == 1 or not self.critic_epochs):
            raise InvalidInputError(
                f"critic_group_weight: expected 0 without a group_size above 1 and critic_epochs, got {weight}."
            )
        if self.output != "inverse":
            self._expect_defaults("group_size", "null_space_noise", output=self.output)
        if self.null_space_noise and self.use_sde:
            raise InvalidInputError("null_space_noise: expected false with use_sde, got true.")
        self._set("critic_learning_rate", number("critic_learning_rate", self.critic_learning_rate, above=0.0))
        self._set("gae_lambda", share("gae_lambda", self.gae_lambda))
        self._set("clip_range", number("clip_range", self.clip_range, above=0.0))
        if self.target_kl is not None:
            self._set("target_kl", number("target_kl", self.target_kl, above=0.0))
        self._set("ent_coef", number("ent_coef", self.ent_coef, at_least=0.0))
        if self.log_std_end is not None:
            self._set("log_std_end", between("log_std_end", self.log_std_end, *LOG_STD))

    def log_std_of(self, segment: int) -> float | None:
        """The logarithm of the standard deviation in a segment, counted from 0; None where it is learned."""
        if self.log_std_end is None:
            return None
        return self.log_std_init + (self.log_std_end - self.log_std_init) * segment / max(self.segments - 1, 1)
