"""The options of each method of training: everything that the result of a run depends on, except the seed.

One file, although long: most of it is the help text of the options.
"""

from __future__ import annotations

import dataclasses
import json
import pathlib
from collections.abc import Callable, Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import tyro

from baselines.agents.bilinear.processing import Bilinear
from ikgym import rl, scenarios, tasks
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels.tasks import SKEW
from ikgym.scenarios import Scenario
from ikgym.validation import known_names, number, whole_number

Activation = Literal["silu", "relu", "tanh", "elu"]

#: Upper bounds, so that a typing error gives a message and does not exhaust the memory.
MOST_ARMS, MOST_LAYERS, MOST_NEURONS = 10_000, 10, 2048
MOST_STAGES, MOST_WINDOW = 100, 10_000
MOST_RATE = 1e30  # weights are float32


class TrainingError(IkgymError):
    """A run cannot be started or repeated, or its weights diverged."""


@dataclasses.dataclass(frozen=True, kw_only=True)
class APG(Frozen):
    """Analytic policy gradient: back-propagation of the cost through the arm, over windows of some steps.

    The agent is bilinear: its network tunes the matrix that maps the remaining twist to joint velocities.

    Raises:
        UnknownNameError: There is no such scenario, activation or the like.
        InvalidInputError: A value is out of its range.
    """

    #: The name of the method on the command line.
    method: ClassVar[str] = "apg"

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "varga7-random"
    """The scenario to train on. Random scenarios are trained on seeds of the split "train". If it shows skew
    coordinates, whose errors are no twists, the agent is trained on whole poses; it resolves the 90° ambiguity."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Largest number of steps of an episode, in training and validation, for short trials. That of the scenario if left
    out."""
    offsets: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = Bilinear.offsets
    """Steps ahead at which the agent sees the reference trajectory, rising from 1."""
    damping: Annotated[float, tyro.conf.arg(metavar="λ")] = Bilinear.damping
    """λ of the damped inverse of the Jacobian with which the training starts; the network adjusts it and adds to it."""
    hidden: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (256, 256)
    """Neurons of the hidden layers: at most 10 layers of at most 2048 neurons."""
    activation: Activation = "silu"
    """Activation of the hidden layers."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 256
    """Number of arms stepped together, at most 10000. At first they are spread over their episodes."""
    segments: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Number of parts of the training. A validation and a checkpoint may follow each of them."""
    evaluate_every: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Segments between validations; the untrained and the final agent are always validated. The agent with the least
    geometric mean of the costs is kept."""
    validation_episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of each validation: the first seeds of the split "validation". A deterministic scenario has one."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 2e-3
    """Learning rate of Adam in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 5e-5
    """Learning rate in the last segment; in between it decays geometrically."""
    max_grad_norm: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Norm at which gradients are clipped."""
    window: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (64, 120, 240, 480)
    """Steps through which gradients are back-propagated for one step of Adam: these values in turn, each for an equal
    part of the segments. The way through a singularity is decided some hundred steps before it, and costs beyond the
    window have no gradient."""
    segment_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 1920
    """Steps of each arm in a segment: a multiple of each window."""
    hold: Annotated[int, tyro.conf.arg(metavar="N")] = 8
    """Steps for which the network output is held, with feedback at every step: a divisor of each window."""
    max_gradient_share: Annotated[float, tyro.conf.arg(metavar="X")] = 10.0
    """The gradient with respect to the network output of one arm is clipped at this multiple of an equal share of a
    loss of 1: near singularities it would otherwise exceed that of all other arms together."""
    cost_prior_steps: Annotated[float, tyro.conf.arg(metavar="N")] = 100.0
    """Costs are divided by the mean stage cost of their episode up to the end of the window, so that the objective is
    the logarithm of the costs of whole episodes. The mean cost of the reference joint path counts in it as much as this
    many steps."""
    reset_distance: Annotated[float, tyro.conf.arg(metavar="M")] = 0.3
    """Arms farther from their reference position than this, in [m], are put back on the reference path."""
    reset_distance_end: Annotated[float, tyro.conf.arg(metavar="M")] = 1.0
    """The same in the segments of the last window, in which the agent learns to come back from farther away."""
    averaging: Annotated[float, tyro.conf.arg(metavar="β")] = 0.99
    """Factor of the exponential moving average of the weights, which is the agent."""
    init: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The agent.safetensors of an earlier run with the first weights; offsets, damping, hidden and activation must be
    those of that run."""

    def __post_init__(self) -> None:
        self._settle_by(whole_number, "segments", "evaluate_every", "hold", "segment_steps", at_least=1)
        self._settle_by(whole_number, "validation_episodes", at_least=1, at_most=len(scenarios.SPLITS["validation"]))
        self._settle_by(whole_number, "n_envs", at_least=1, at_most=MOST_ARMS)
        if self.steps is not None:
            self._settle_by(whole_number, "steps", at_least=1)
        known_names("activation", [self.activation], get_args(Activation))
        self._settle_by(_whole_numbers, "hidden", most=MOST_LAYERS, at_most=MOST_NEURONS)
        self._settle_by(number, "learning_rate", "learning_rate_end", "max_grad_norm", above=0.0, at_most=MOST_RATE)
        self._settle(offsets=self.processing.offsets, damping=self.processing.damping)
        if self.init is not None:
            self._settle(init=pathlib.Path(self.init))
        self._settle_by(_whole_numbers, "window", most=MOST_STAGES, at_most=MOST_WINDOW)
        for steps in self.window:
            if steps % self.hold or self.segment_steps % steps:
                raise InvalidInputError(
                    f"window: expected multiples of hold, {self.hold}, that divide segment_steps, "
                    f"{self.segment_steps}, got {steps}."
                )
        self._settle_by(
            number, "max_gradient_share", "cost_prior_steps", "reset_distance", "reset_distance_end", above=0.0
        )
        self._settle_by(number, "averaging", at_least=0.0, at_most=1.0)

    def _settle_by(self, check: Callable[..., Any], *names: str, **bounds: Any) -> None:
        """Sets fields to their checked values."""
        self._settle(**{name: check(name, getattr(self, name), **bounds) for name in names})

    @property
    def processing(self) -> Bilinear:
        """The features and the law of the agent."""
        return Bilinear(self.offsets, self.damping, self.hold)

    def window_of(self, segment: int) -> int:
        """The window of a segment, counted from 0."""
        return self.window[self._stage(segment)]

    def reset_distance_of(self, segment: int) -> float:
        """The reset distance of a segment, counted from 0, in [m]."""
        last = self._stage(segment) == len(self.window) - 1
        return self.reset_distance_end if last else self.reset_distance

    def _stage(self, segment: int) -> int:
        return segment * len(self.window) // self.segments

    def learning_rate_of(self, segment: int) -> float:
        """The learning rate of a segment, counted from 0."""
        part = segment / max(self.segments - 1, 1)
        return float(self.learning_rate * (self.learning_rate_end / self.learning_rate) ** part)

    def make_scenario(self) -> Scenario:
        """The scenario, with whole poses in place of skew coordinates, and no more than `steps`.

        Raises:
            UnknownNameError: There is no such scenario.
        """
        scenario = scenarios.get(self.scenario)
        if scenario.task.kind == SKEW:
            scenario = scenario.replace(task=tasks.get("pose"))
        return scenario if self.steps is None else scenario.replace(steps=min(self.steps, scenario.steps))

    def to_json(self) -> dict[str, Any]:
        """All fields as JSON values."""
        values = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        out: dict[str, Any] = json.loads(json.dumps(values, default=str))
        return out

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """A configuration from values by name; fields left out have their defaults.

        Raises:
            UnknownNameError: A name is not a field; the message has the nearest one.
            InvalidInputError: A value is refused.
        """
        known_names(f"option of {cls.method}", values, [f.name for f in dataclasses.fields(cls)])
        converted: Any = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**converted)


def _whole_numbers(name: str, values: object, *, most: int, at_most: int) -> tuple[int, ...]:
    """A tuple of 1 to `most` whole numbers from 1."""
    if not isinstance(values, tuple) or not 1 <= len(values) <= most:
        raise InvalidInputError(f"{name}: expected 1 to {most} whole numbers, got {values!r}.")
    return tuple(whole_number(name, one, at_least=1, at_most=at_most) for one in values)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rewards(Frozen):
    """The options of the algorithms of Stable-Baselines3 and sb3-contrib.

    Raises:
        UnknownNameError: There is no such environment.
        InvalidInputError: A value is out of its range.
    """

    #: The name of the algorithm on the command line.
    method: ClassVar[str]

    env: Annotated[str, tyro.conf.arg(metavar="ID")]
    """The environment, such as ikgym/Track-v0."""
    total_timesteps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Steps of all arms together; n_timesteps of the settings if left out."""
    minutes: Annotated[float | None, tyro.conf.arg(metavar="X")] = None
    """CPU time without validations after which a run ends early."""
    settings: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.yml")] = None
    """Settings in the format of rl-zoo3; the published ones if left out."""
    defaults: bool = False
    """Take the defaults of the library and one arm in place of settings."""
    validations: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Rows of the curve, evenly spaced."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of a validation."""

    def __post_init__(self) -> None:
        known_names("environment", [self.env], rl.IDS)
        for name in ("total_timesteps", "validations", "episodes"):
            if getattr(self, name) is not None:
                whole_number(name, getattr(self, name), at_least=1)
        if self.minutes is not None:
            number("minutes", self.minutes, above=0.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PPO(Rewards):
    """Proximal policy optimisation (Schulman et al. 2017), by Stable-Baselines3 in an environment by id."""

    method: ClassVar[str] = "ppo"


@dataclasses.dataclass(frozen=True, kw_only=True)
class SAC(Rewards):
    """Soft actor-critic (Haarnoja et al. 2018), by Stable-Baselines3 in an environment by id."""

    method: ClassVar[str] = "sac"


@dataclasses.dataclass(frozen=True, kw_only=True)
class TD3(Rewards):
    """Twin delayed DDPG (Fujimoto et al. 2018), by Stable-Baselines3 in an environment by id."""

    method: ClassVar[str] = "td3"


@dataclasses.dataclass(frozen=True, kw_only=True)
class RecurrentPPO(Rewards):
    """PPO with an LSTM, by sb3-contrib in an environment by id; settings for `Camera-v0` and `Payload-v0`."""

    method: ClassVar[str] = "recurrent_ppo"
