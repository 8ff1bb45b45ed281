"""What a run is: everything that its result depends on, but for the seed."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import tyro

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.features import Processing
from baselines.agents.recurrent.processing import Recurrent
from baselines.agents.relative.processing import Relative
from baselines.training.config.limits import (
    MOST_ARMS,
    MOST_LAYERS,
    MOST_NEURONS,
    MOST_RATE,
    MOST_STEPS_AHEAD,
    between,
    count,
)
from ikgym import scenarios, tasks
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import Frozen, flag, known_names, number, whole_number

Activation = Literal["silu", "relu", "tanh", "elu"]
#: Kinds of models of Stable-Baselines3 that come out of a training.
Algorithm = Literal["ppo", "sac", "td3"]

#: Options that may come with the file of ``init``.
SHAPE = (
    "base_policy", "offsets", "action_scale", "null_space", "damping", "matrix", "predicted_rates", "largest",
    "furthest", "hidden", "activation",
)  # fmt: skip
#: Transforms that files can describe.
Stored = Processing | Bilinear | Relative


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config(Frozen):
    """What all methods have in common.

    Raises:
        UnknownNameError: There is no such scenario, activation or the like.
        InvalidInputError: A value is out of its range.
    """

    #: What the method is called on the command line.
    method: ClassVar[str]

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "varga7-random"
    """What is to be tracked. Random scenarios are trained on seeds of the split "train"."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Most steps of an episode, in training and validation, for trials. The scenario's own number if left out."""
    task: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Task coordinates to train on, if not those of the scenario. An agent trained on whole poses (pose) can be
    evaluated on scenarios that show skew coordinates, too: it gets the full orientation. Skew coordinates have a 90°
    ambiguity, and are singular there."""
    offsets: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = Processing.offsets
    """Steps ahead at which the agent sees the reference trajectory, rising. Those that the base policy needs may, but
    need not, be among them."""
    hidden: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (256, 256, 256)
    """Neurons of the hidden layers, of the actor and of critics alike: at most 10 layers of at most 2048 neurons."""
    activation: Activation = "silu"
    """Of the hidden layers."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 16
    """Arms that are stepped together, at most 10000."""
    segments: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Parts of the training. After each of them there may be a validation and a checkpoint."""
    evaluate_every: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Segments from one validation to the next; there is one at the start and one at the end, too."""
    validation_episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of each: the first seeds of the split "validation". A deterministic scenario has one."""
    keep_best: bool = True
    """Keep the agent of the best validation (by the geometric mean of the costs), not the last one."""
    init: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """A file of an earlier run to begin from: agent.safetensors, for its actor, or model.safetensors, for its critics,
    too, where the algorithm is the same. What the agent sees, what its outputs mean and the shape of its network come
    with the file."""

    def __post_init__(self) -> None:
        known_names("activation", [self.activation], get_args(Activation))
        for name in ("segments", "evaluate_every", "validation_episodes"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))
        self._set("n_envs", count("n_envs", self.n_envs, at_most=MOST_ARMS))
        if self.steps is not None:
            self._set("steps", whole_number("steps", self.steps, at_least=1))
        for name in ("hidden", "offsets"):
            if not isinstance(getattr(self, name), tuple):
                raise InvalidInputError(f"{name}: expected whole numbers, got {getattr(self, name)!r}.")
        if not 1 <= len(self.hidden) <= MOST_LAYERS:
            raise InvalidInputError(
                f"hidden: expected at least one hidden layer, at most {MOST_LAYERS}, got {len(self.hidden)}."
            )
        flag("keep_best", self.keep_best)
        self._set("hidden", tuple(count("hidden", width, at_most=MOST_NEURONS) for width in self.hidden))
        self._check_init()
        self._set("offsets", self.processing.offsets)
        count("offsets", self.offsets[-1], at_most=MOST_STEPS_AHEAD)

    @property
    def processing(self) -> Stored | Recurrent:
        """What the agent sees, and what the outputs of its network mean."""
        raise NotImplementedError

    @classmethod
    def shape_of(cls, processing: Stored, sizes: tuple[int, ...], activation: str) -> dict[str, Any]:
        """The options that come with the file of `init`, by name.

        Args:
            processing: Of the agent in the file.
            sizes: Of its network, see :class:`baselines.agents.network.Network`.
            activation: Likewise.
        """
        return {"offsets": processing.offsets, "hidden": sizes[1:-1], "activation": activation}

    def make_scenario(self) -> Scenario:
        """The scenario, with the task and at most the steps asked for.

        Raises:
            UnknownNameError: There is no such scenario or task.
        """
        scenario = scenarios.get(self.scenario)
        if self.task is not None:
            scenario = scenario.replace(task=tasks.get(self.task))
        return scenario if self.steps is None else scenario.replace(steps=min(self.steps, scenario.steps))

    def to_json(self) -> dict[str, Any]:
        """All fields, as JSON has them."""
        return {f.name: _plain(getattr(self, f.name)) for f in dataclasses.fields(self)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The configuration of some values by name; fields left out have their defaults.

        Raises:
            UnknownNameError: A name is none of the fields; the message has the nearest one.
            InvalidInputError: A value is refused.
        """
        known_names(f"option of {cls.method}", values, [f.name for f in dataclasses.fields(cls)])
        made: Any = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**made)

    def _check_init(self) -> None:
        if self.init is None:
            return
        if not isinstance(self.init, (str, pathlib.Path)):
            raise InvalidInputError(f"init: expected the path of a file, got {self.init!r}.")
        self._set("init", pathlib.Path(self.init))

    def _expect_defaults(self, *names: str, **where: str) -> None:
        """Insists that options are left out which mean nothing where another one has a value."""
        ((option, value),) = where.items()
        usual = {field.name: field.default for field in dataclasses.fields(self)}
        for name in names:
            if getattr(self, name) != usual[name]:
                raise InvalidInputError(
                    f"{name}: expected {usual[name]} for an {option} that is {value}, got {getattr(self, name)!r}."
                )

    def _set(self, field: str, value: object) -> None:
        """Writes a field of this frozen object, while it is made."""
        object.__setattr__(self, field, value)


@dataclasses.dataclass(frozen=True, kw_only=True)
class JointVelocities(Config):
    """A configuration of agents whose network outputs are joint velocities, or corrections of those of a policy."""

    base_policy: Annotated[str | None, tyro.conf.arg(metavar="POLICY")] = None
    """Base policy, as NAME or NAME:PARAMETER=VALUE,…: the agent is a residual policy, which corrects its actions, and
    a network output of 0 is the base policy. The agent stands alone if left out."""
    action_scale: Annotated[float, tyro.conf.arg(metavar="X")] = Processing.action_scale
    """What a network output of 1 means, as a multiple of the speed of the reference trajectory ahead."""
    null_space: Annotated[float | None, tyro.conf.arg(metavar="λ")] = None
    """Projects network outputs into the null space of the task Jacobian, with damping λ: they then move the joints and
    not the tool, but for directions that are nearly singular. Not projected if left out."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("action_scale", self.velocities.action_scale)
        self._set("null_space", self.velocities.null_space)

    @property
    def processing(self) -> Stored:
        """What the agent sees, and what the outputs of its network mean."""
        return self.velocities

    @property
    def velocities(self) -> Processing:
        """The same, where these outputs are joint velocities."""
        return Processing(self.offsets, self.action_scale, self.base_policy, self.null_space)

    @classmethod
    def shape_of(cls, processing: Stored, sizes: tuple[int, ...], activation: str) -> dict[str, Any]:
        """See :meth:`Config.shape_of`."""
        own = {name: getattr(processing, name, None) for name in ("base_policy", "action_scale", "null_space")}
        return super().shape_of(processing, sizes, activation) | own


@dataclasses.dataclass(frozen=True, kw_only=True)
class Annealed(Config):
    """A configuration with a learning rate that falls from segment to segment."""

    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 3e-4
    """Of Adam, in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 3e-5
    """In the last segment; in between it falls by equal factors."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("learning_rate", "learning_rate_end"):
            self._set(name, number(name, getattr(self, name), above=0.0))
            between(name, getattr(self, name), 0.0, MOST_RATE)

    def learning_rate_of(self, segment: int) -> float:
        """The learning rate of a segment, counted from 0."""
        part = segment / max(self.segments - 1, 1)
        return float(self.learning_rate * (self.learning_rate_end / self.learning_rate) ** part)


def differences(there: Mapping[str, Any], here: Mapping[str, Any]) -> list[str]:
    """What differs between two objects of JSON, such as configurations, in words."""
    names = [*there, *(name for name in here if name not in there)]
    return [
        f"{name} ({there.get(name)!r} there, {here.get(name)!r} here)"
        for name in names
        if there.get(name) != here.get(name) or (name in there) != (name in here)
    ]


def _plain(value: Any) -> Any:
    if isinstance(value, pathlib.Path):
        return str(value)
    return list(value) if isinstance(value, tuple) else value
