"""What runs of the methods are that know the gradient themselves: imitation, and analytic policy gradient."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar, get_args

import tyro

from baselines.training.config.common import Algorithm, Config
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names, number, whole_number


@dataclasses.dataclass(frozen=True, kw_only=True)
class Direct(Config):
    """What the configurations of these methods have in common."""

    algorithm: Algorithm = "ppo"
    """The kind of model that comes out, which the same algorithm can go on with."""
    envs: Annotated[int, tyro.conf.arg(metavar="N")] = 64
    """Arms that move together."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 1e-3
    """Of Adam, in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 2e-5
    """In the last segment; in between it falls by equal factors."""
    largest_gradient: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Norm at which gradients are cut."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known_names("algorithm", [self.algorithm], get_args(Algorithm))
        self._settle("envs", whole_number("envs", self.envs, at_least=1))
        for name in ("learning_rate", "learning_rate_end", "largest_gradient"):
            self._settle(name, number(name, getattr(self, name), above=0.0))

    def learning_rate_of(self, segment: int) -> float:
        """The learning rate of a segment, counted from 0."""
        part = segment / max(self.segments - 1, 1)
        return float(self.learning_rate * (self.learning_rate_end / self.learning_rate) ** part)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Imitate(Direct):
    """Supervised learning of another policy, with data aggregation (DAgger)."""

    method: ClassVar[str] = "imitate"

    expert: Annotated[str, tyro.conf.arg(metavar="POLICY")] = "rhc_foresight"
    """Who is imitated, as NAME or NAME:PARAMETER=VALUE,…"""
    led: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.2
    """Share of the arms that the expert moves itself, after the first segment, in which it moves all of them."""
    rescue: Annotated[float, tyro.conf.arg(metavar="M")] = 0.05
    """The expert moves arms that are farther from their nominal position than this, in [m]."""
    noise: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.3
    """Largest disturbance of the arms that the expert moves, as a multiple of their joint velocity: what the agent is
    to learn is how to come back, too. It goes through the null space where the agent's answers do."""
    tolerance: Annotated[float, tyro.conf.arg(metavar="X")] = 0.02
    """Error of an answer from which on more of it matters little."""
    every: Annotated[int, tyro.conf.arg(metavar="N")] = 4
    """Of so many steps one is learned from: the others are much like it."""
    memory: Annotated[int, tyro.conf.arg(metavar="N")] = 400_000
    """Examples that are remembered; the oldest make room."""
    gradient_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 500
    """Gradient steps of a segment."""
    batch_size: Annotated[int, tyro.conf.arg(metavar="N")] = 1024
    """Examples of one gradient step."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle("led", number("led", self.led, at_least=0.0))
        if self.led > 1.0:
            raise InvalidInputError(f"led: expected a share between 0 and 1, got {self.led:g}.")
        for name in ("rescue", "tolerance"):
            self._settle(name, number(name, getattr(self, name), above=0.0))
        self._settle("noise", number("noise", self.noise, at_least=0.0))
        for name in ("every", "memory", "gradient_steps", "batch_size"):
            self._settle(name, whole_number(name, getattr(self, name), at_least=1))


@dataclasses.dataclass(frozen=True, kw_only=True)
class APG(Direct):
    """Analytic policy gradient: back-propagation of the cost through the arm, over windows of some steps."""

    method: ClassVar[str] = "apg"

    window: Annotated[int, tyro.conf.arg(metavar="N")] = 100
    """Steps through which gradients go, from one step of Adam to the next. Singularities cast their shadows some
    hundred steps ahead: what lies beyond the window, the agent learns nothing of."""
    windows: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Windows of a segment."""
    largest_share: Annotated[float, tyro.conf.arg(metavar="X")] = 10.0
    """An answer of one arm at one step may have this many times its equal share of the gradient: near singularities
    it would otherwise drown that of all others."""
    credit: Annotated[float, tyro.conf.arg(metavar="N")] = 100.0
    """Costs of an episode are weighed by its mean cost so far, in which the cost of the nominal joint path counts for
    this many steps: what is lowered is the logarithm of the costs of whole episodes."""
    give_up: Annotated[float, tyro.conf.arg(metavar="M")] = 0.5
    """Arms that are farther from their nominal position than this, in [m], begin a new episode."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("window", "windows"):
            self._settle(name, whole_number(name, getattr(self, name), at_least=1))
        for name in ("largest_share", "credit", "give_up"):
            self._settle(name, number(name, getattr(self, name), above=0.0))
