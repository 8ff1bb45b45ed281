"""The configuration of the training of agents with memory."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar, Literal, get_args

import tyro

from baselines.agents.recurrent.processing import Recurrent
from baselines.training.config.base import MOST_BATCH, ActorOnly, count
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names, number, whole_number

#: How the gradient is estimated.
Estimator = Literal["analytic", "ppo"]
#: Limits of the logarithm of a standard deviation.
LOG_STD = (-20.0, 2.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Observe(ActorOnly):
    """An agent with memory for plants that differ from the model: a recurrent network tunes a Kalman filter.

    Each segment has new random plants: calibration, payload, and noise, rate and losses of the camera. The gradient of
    the costs of the filter's estimates is back-propagated through all measurements of an episode, or estimated from
    costs alone.
    """

    method: ClassVar[str] = "observe"

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "panda-field"
    """The scenario with the arm and the paths; agents are validated on its own plant."""
    base_policy: Annotated[str, tyro.conf.arg(metavar="POLICY")] = Recurrent.base_policy
    """The policy that is corrected, which matters in the validation alone."""
    hidden: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (32,)
    """Units of the recurrent layers."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 128
    """Episodes of a segment, a multiple of the plants."""
    segments: Annotated[int, tyro.conf.arg(metavar="N")] = 40
    """Parts of the training, of about five core-seconds each."""
    evaluate_every: Annotated[int, tyro.conf.arg(metavar="N")] = 40
    """Segments from one validation to the next; there is one at the start and one at the end, too."""
    validation_episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 16
    """Episodes of each: the first seeds of the split "validation"."""
    plants: Annotated[int, tyro.conf.arg(metavar="N")] = 16
    """Random plants in a segment; each episode draws an arm and noise from one of them."""
    measurements: Annotated[int, tyro.conf.arg(metavar="N")] = 96
    """Measurements of an episode; gradients are back-propagated through all of them."""
    gradient_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Gradient steps of a segment."""
    batch_size: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of one gradient step."""
    step_cost: Annotated[float, tyro.conf.arg(metavar="X")] = 0.13
    """The cost of a step without error: the objective is the logarithm of the cost of an episode."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 5e-3
    """Of Adam, in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 3e-4
    """In the last segment; in between it falls by equal factors."""
    estimator: Estimator = "analytic"
    """Of the gradient. analytic: back-propagation through filter and network. ppo: proximal policy optimisation
    (Schulman et al. 2017) from the costs of estimates, with noise on the network outputs; each episode is repeated
    group_size times with different noise."""
    group_size: Annotated[int, tyro.conf.arg(metavar="N")] = 8
    """Of ppo: repetitions of each episode in a batch, at least two."""
    n_epochs: Annotated[int, tyro.conf.arg(metavar="N")] = 4
    """Of ppo: gradient steps on a batch."""
    clip_range: Annotated[float, tyro.conf.arg(metavar="ε")] = 0.2
    """Of ppo: largest distance of the ratio of probabilities from 1."""
    gamma: Annotated[float, tyro.conf.arg(metavar="γ")] = 0.95
    """Of ppo: discount factor, from one measurement to the next."""
    log_std_init: Annotated[float, tyro.conf.arg(metavar="X")] = -1.0
    """Of ppo: logarithm of the standard deviation of the noise on outputs, at the start."""
    log_std_end: Annotated[float, tyro.conf.arg(metavar="X")] = -2.0
    """Of ppo: the same in the last segment; in between it changes by equal steps."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known_names("estimator", [self.estimator], get_args(Estimator))
        for name in ("plants", "gradient_steps", "n_epochs"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))
        for name in ("measurements", "group_size"):
            self._set(name, whole_number(name, getattr(self, name), at_least=2))
        self._set("batch_size", count("batch_size", self.batch_size, at_most=min(self.n_envs, MOST_BATCH)))
        for name in ("clip_range", "step_cost"):
            self._set(name, number(name, getattr(self, name), above=0.0))
        self._set("gamma", number("gamma", self.gamma, above=0.0, at_most=1.0))
        for name in ("log_std_init", "log_std_end"):
            self._set(name, number(name, getattr(self, name), at_least=LOG_STD[0], at_most=LOG_STD[1]))
        if self.n_envs % self.plants:
            raise InvalidInputError(f"n_envs: expected a multiple of {self.plants} plants, got {self.n_envs}.")

    @property
    def processing(self) -> Recurrent:
        """The base policy and the prior of the filter."""
        return Recurrent(self.base_policy)

    def log_std_of(self, segment: int) -> float:
        """The logarithm of the standard deviation in a segment, counted from 0."""
        return self.log_std_init + (self.log_std_end - self.log_std_init) * segment / max(self.segments - 1, 1)
