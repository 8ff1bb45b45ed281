"""What runs of SAC and TD3 are, with the hyperparameters of Stable-Baselines3 by its names."""

from __future__ import annotations

import dataclasses
import re
from typing import Annotated, ClassVar

import tyro

from baselines.agents.relative.processing import Squash
from baselines.training.config.limits import MOST_TRANSITIONS, count, share
from baselines.training.config.reinforcement import Reinforcement, StateDependentExploration
from ikgym.exceptions import InvalidInputError
from ikgym.validation import number, whole_number


@dataclasses.dataclass(frozen=True, kw_only=True)
class OffPolicy(Reinforcement):
    """What SAC and TD3 have in common."""

    squash: ClassVar[Squash] = "tanh"
    buffer_size: Annotated[int, tyro.conf.arg(metavar="N")] = 200_000
    """Transitions in the replay buffer, those of all arms together; at most 10000000."""
    learning_starts: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Steps of the environment, those of all arms together, before learning starts. Meanwhile the agent acts as it is,
    with its noise, where Stable-Baselines3 alone would act at random. Those of the first segment if left out."""
    train_freq: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Steps of each arm between two updates: a divisor of the steps of a segment."""
    gradient_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Gradient steps of an update."""
    tau: Annotated[float, tyro.conf.arg(metavar="τ")] = 0.005
    """Coefficient of the soft update of the target networks."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("train_freq", "gradient_steps"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))
        self._set("buffer_size", count("buffer_size", self.buffer_size, at_most=MOST_TRANSITIONS))
        if self.buffer_size < self.n_envs:
            raise InvalidInputError(
                f"buffer_size: expected at least one transition of each arm, got {self.buffer_size}."
            )
        if self.learning_starts is not None:
            self._set("learning_starts", whole_number("learning_starts", self.learning_starts, at_least=0))
        self._set("tau", share("tau", self.tau))


@dataclasses.dataclass(frozen=True, kw_only=True)
class SAC(OffPolicy, StateDependentExploration):
    """Soft actor-critic (Haarnoja et al. 2018), by Stable-Baselines3."""

    method: ClassVar[str] = "sac"

    ent_coef: Annotated[str, tyro.conf.arg(metavar="C")] = "auto_0.01"
    """Weight of the entropy: auto_X is tuned from X on, auto from 1 on; a number is fixed."""
    target_entropy: Annotated[float | None, tyro.conf.arg(metavar="NAT")] = None
    """Entropy in [nat] of a whole action that ent_coef is tuned for. −3 for each of its numbers if left out;
    Stable-Baselines3 takes −1, which is too much noise here."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("ent_coef", _entropy_coefficient(self.ent_coef))
        if self.target_entropy is not None:
            self._set("target_entropy", number("target_entropy", self.target_entropy))


@dataclasses.dataclass(frozen=True, kw_only=True)
class TD3(OffPolicy):
    """Twin delayed deep deterministic policy gradient (Fujimoto et al. 2018), by Stable-Baselines3."""

    method: ClassVar[str] = "td3"

    action_noise: Annotated[float, tyro.conf.arg(metavar="σ")] = 0.05
    """Standard deviation of what is added to network outputs in training."""
    action_noise_correlation: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Correlation time of this noise in steps. 1: normal noise, independent in each step. More: an Ornstein–Uhlenbeck
    process."""
    policy_delay: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Gradient steps of the critics to one of the actor."""
    target_policy_noise: Annotated[float, tyro.conf.arg(metavar="σ")] = 0.05
    """Standard deviation of what is added to the outputs of the target actor; clipped at 2.5 times as much."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("action_noise", "target_policy_noise"):
            self._set(name, number(name, getattr(self, name), at_least=0.0))
        for name in ("action_noise_correlation", "policy_delay"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))


def _entropy_coefficient(value: object) -> str:
    """``auto``, ``auto_X`` or a number, as text.

    Raises:
        InvalidInputError: It is none of these.
    """
    text = value if isinstance(value, str) else repr(value)
    start = re.sub(r"^auto(_|$)", "", text)
    try:
        if text != "auto" and not 0.0 < float(start) < float("inf"):
            raise ValueError
    except ValueError:
        raise InvalidInputError(
            f"ent_coef: expected auto, auto_X or a number, with numbers above 0, got {value!r}."
        ) from None
    return text
