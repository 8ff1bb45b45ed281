"""Options of training: all that the result of a run depends on, except the seed; and the methods by name."""

from __future__ import annotations

import dataclasses
import functools
import json
import pathlib
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, Self

import tyro

from baselines.agents.bilinear.processing import Bilinear
from ikgym import rl, scenarios, tasks
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.files import read_user_toml
from ikgym.frozen import Frozen
from ikgym.kernels.tasks import SKEW
from ikgym.rl.scoring import EPISODES
from ikgym.scenarios import Scenario
from ikgym.validation import Bounds, known_name, known_names, whole_number

#: Methods by name: what the command line says about them.
METHODS = {
    "apg": "Analytic policy gradient: the cost is differentiated through the arm, over windows of some hundred steps. "
    "The network tunes the matrix that maps the remaining twist to joint velocities.",
    "ppo": "Proximal policy optimisation (Schulman et al. 2017), by Stable-Baselines3 in an environment by id.",
    "sac": "Soft actor-critic (Haarnoja et al. 2018), by Stable-Baselines3 in an environment by id.",
    "td3": "Twin delayed DDPG (Fujimoto et al. 2018), by Stable-Baselines3 in an environment by id.",
    "recurrent_ppo": "PPO with an LSTM, by sb3-contrib in an environment by id; settings for Camera-v0 and Payload-v0.",
}
#: The presets of apg, a table each.
PRESETS = pathlib.Path(__file__).with_name("presets.toml")

Activation = Literal["silu", "relu", "tanh", "elu"]


class TrainingError(IkgymError):
    """A run cannot be started or repeated, or its weights diverged."""


def _whole_numbers(name: str, value: object, *, most: int, at_most: int) -> tuple[int, ...]:
    """A tuple of 1 to `most` whole numbers from 1."""
    if not isinstance(value, tuple) or not 1 <= len(value) <= most:
        raise InvalidInputError(f"{name}: expected 1 to {most} whole numbers, got {value!r}.")
    return tuple(whole_number(name, element, at_least=1, at_most=at_most) for element in value)


_N, _MANY, _X = (tyro.conf.arg(metavar=metavar) for metavar in ("N", "N …", "X"))
#: Options within bounds, so that a typing error gives a message and does not exhaust the memory.
_Count = Annotated[int, _N, Bounds(at_least=1)]
_Number = Annotated[float, _X, Bounds(above=0.0)]
_Layers = Annotated[tuple[int, ...], _MANY, functools.partial(_whole_numbers, most=10, at_most=2048)]
_Windows = Annotated[tuple[int, ...], _MANY, functools.partial(_whole_numbers, most=100, at_most=10_000)]


class Schedule(NamedTuple):
    """Settings of one segment: steps of a window, distance of a reset in [m], and learning rate."""

    window: int
    reset_distance: float
    learning_rate: float


@dataclasses.dataclass(frozen=True, kw_only=True)
class APG(Frozen):
    """The options of apg.

    Raises:
        UnknownNameError: There is no such scenario, activation or the like.
        InvalidInputError: A value is out of its range.
    """

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "varga7-random"
    """The scenario to train on. Random scenarios are trained on seeds of the split "train". If it shows skew
    coordinates, whose errors are no twists, the agent is trained on whole poses; it resolves the 90° ambiguity."""
    steps: Annotated[int | None, _N, Bounds(at_least=1)] = None
    """Largest number of steps of an episode, in training and validation, for short trials. That of the scenario if left
    out."""
    offsets: Annotated[tuple[int, ...], _MANY] = Bilinear.offsets
    """Steps ahead at which the agent sees the reference trajectory, rising from 1."""
    damping: Annotated[float, tyro.conf.arg(metavar="λ")] = Bilinear.damping
    """λ of the damped inverse of the Jacobian with which the training starts; the network adjusts it and adds to it."""
    hidden: _Layers = (256, 256)
    """Neurons of the hidden layers: at most 10 layers of at most 2048 neurons."""
    activation: Activation = "silu"
    """Activation of the hidden layers."""
    n_envs: Annotated[int, _N, Bounds(at_least=1, at_most=10_000)] = 256
    """Number of arms stepped together, at most 10000. At first they are spread over their episodes."""
    segments: _Count = 20
    """Number of parts of the training. A validation and a checkpoint may follow each of them."""
    evaluate_every: _Count = 2
    """Segments between validations; the untrained and the final agent are always validated. The agent with the least
    geometric mean of the costs is kept."""
    validation_episodes: Annotated[int, _N, Bounds(at_least=1, at_most=len(scenarios.SPLITS["validation"]))] = 32
    """Episodes of each validation: the first seeds of the split "validation". A deterministic scenario has one."""
    learning_rate: _Number = 2e-3
    """Learning rate of Adam in the first segment."""
    learning_rate_end: _Number = 5e-5
    """Learning rate in the last segment; in between it decays geometrically."""
    max_grad_norm: _Number = 1.0
    """Norm at which gradients are clipped."""
    window: _Windows = (64, 120, 240, 480)
    """Steps through which gradients are back-propagated for one step of Adam: these values in turn, each for an equal
    part of the segments. The way through a singularity is decided some hundred steps before it, and costs beyond the
    window have no gradient."""
    segment_steps: _Count = 1920
    """Steps of each arm in a segment: a multiple of each window."""
    hold: _Count = 8
    """Steps for which the network output is held, with feedback at every step: a divisor of each window."""
    max_gradient_share: _Number = 10.0
    """The gradient with respect to the network output of one arm is clipped at this multiple of an equal share of a
    loss of 1: near singularities it would otherwise exceed that of all other arms together."""
    cost_prior_steps: _Number = 100.0
    """Costs are divided by the mean stage cost of their episode up to the end of the window, so that the objective is
    the logarithm of the costs of whole episodes. The mean cost of the reference joint path counts in it as much as this
    many steps."""
    reset_distance: _Number = 0.3
    """Arms farther from their reference position than this, in [m], are put back on the reference path."""
    reset_distance_end: _Number = 1.0
    """Displacement in the segments of the last window, in which the agent learns to come back from farther away."""
    averaging: Annotated[float, tyro.conf.arg(metavar="β"), Bounds(at_least=0.0, at_most=1.0)] = 0.99
    """Factor of the exponential moving average of the weights, which is the agent."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(offsets=self.processing.offsets, damping=self.processing.damping)
        for steps in self.window:
            if steps % self.hold or self.segment_steps % steps:
                raise InvalidInputError(
                    f"window: expected multiples of hold, {self.hold}, that divide segment_steps, "
                    f"{self.segment_steps}, got {steps}."
                )

    @property
    def processing(self) -> Bilinear:
        """The features and the law of the agent."""
        return Bilinear(self.offsets, self.damping, self.hold)

    def schedule(self, segment: int) -> Schedule:
        """The settings of a segment, counted from 0."""
        stage, progress = segment * len(self.window) // self.segments, segment / max(self.segments - 1, 1)
        distance = self.reset_distance if stage < len(self.window) - 1 else self.reset_distance_end
        rate = self.learning_rate * (self.learning_rate_end / self.learning_rate) ** progress
        return Schedule(self.window[stage], distance, rate)

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
        out: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(self), default=str))
        return out

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The inverse of :meth:`to_json`; fields left out have their defaults.

        Raises:
            UnknownNameError: A name is not a field; the message has the nearest one.
            InvalidInputError: A value is refused.
        """
        known_names("option of apg", values, [field.name for field in dataclasses.fields(cls)])
        converted: Any = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**converted)

    @classmethod
    def preset(cls, name: str | None) -> Self:
        """The options of a preset.

        Args:
            name: One of :func:`preset_names`, or a file ``NAME.toml`` with options; None for the defaults.

        Raises:
            UnknownNameError: There is no such preset or option.
            InvalidInputError: The file cannot be read, or a value is refused.
        """
        if name is None:
            return cls()
        if name.endswith(".toml"):
            return cls.from_json(read_user_toml(name))
        known_name("preset", name, tables := read_user_toml(PRESETS))
        return cls.from_json(tables[name])


def preset_names() -> tuple[str, ...]:
    """The presets of apg that come with the package."""
    return tuple(read_user_toml(PRESETS))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Rewards(Frozen):
    """The options of the algorithms of Stable-Baselines3 and sb3-contrib.

    Raises:
        UnknownNameError: There is no such environment.
        InvalidInputError: A value is out of its range.
    """

    algorithm: tyro.conf.Suppress[str] = "ppo"
    """One of :data:`METHODS`, except apg."""
    env: Annotated[str, tyro.conf.arg(metavar="ID")]
    """The environment, such as ikgym/Track-v0."""
    total_timesteps: Annotated[int | None, _N, Bounds(at_least=1)] = None
    """Steps of all arms together; n_timesteps of the settings if left out."""
    minutes: Annotated[float | None, _X, Bounds(above=0.0)] = None
    """CPU time without validations after which a run ends early."""
    settings: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE.yml")] = None
    """Settings in the format of rl-zoo3; the published ones if left out."""
    defaults: bool = False
    """Take the defaults of the library and one arm in place of settings."""
    inverse: bool = False
    """Show the policy joint velocities of the model's damped inverse, too, see `ikgym.rl.Task`."""
    validations: _Count = 10
    """Rows of the curve, evenly spaced."""
    episodes: Annotated[int, _N, Bounds(at_least=1, at_most=EPISODES)] = 32
    """Episodes of a validation."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known_name("environment", self.env, rl.IDS)
