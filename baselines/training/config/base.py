"""The configuration of a run: everything that its result depends on, except the seed."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import tyro

from ikgym import scenarios, tasks
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import Frozen, flag, known_names, number, whole_number

Activation = Literal["silu", "relu", "tanh", "elu"]

#: Largest values of options, so that a typing error ends with a message rather than without memory.
MOST_ARMS, MOST_BATCH = 10_000, 1_000_000
MOST_LAYERS, MOST_NEURONS = 10, 2048
MOST_RATE = 1e30  # weights are float32


@dataclasses.dataclass(frozen=True, kw_only=True)
class Config(Frozen):
    """The options that all methods have in common.

    Raises:
        UnknownNameError: There is no such scenario, activation or the like.
        InvalidInputError: A value is out of its range.
    """

    #: The name of the method on the command line.
    method: ClassVar[str]

    scenario: Annotated[str, tyro.conf.arg(metavar="NAME")] = "varga7-random"
    """The scenario to train on. Random scenarios are trained on seeds of the split "train"."""
    steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Largest number of steps of an episode, in training and validation, for trials. That of the scenario if left
    out."""
    task: Annotated[str | None, tyro.conf.arg(metavar="NAME")] = None
    """Task coordinates to train on, if not those of the scenario. An agent trained on whole poses (pose) also plays
    scenarios that show skew coordinates, whose 90° ambiguity is resolved for it."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 16
    """Number of arms stepped together, at most 10000."""
    segments: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Number of parts of the training. A validation and a checkpoint may follow each of them."""
    evaluate_every: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Segments from one validation to the next; there is also one at the start and one at the end."""
    validation_episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of each validation: the first seeds of the split "validation". A deterministic scenario has one."""
    keep_best: bool = True
    """Keep the agent of the best validation (by the geometric mean of the costs), not the last one."""

    def __post_init__(self) -> None:
        for name in ("segments", "evaluate_every", "validation_episodes"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))
        self._set("n_envs", count("n_envs", self.n_envs, at_most=MOST_ARMS))
        if self.steps is not None:
            self._set("steps", whole_number("steps", self.steps, at_least=1))
        flag("keep_best", self.keep_best)

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
        """All fields, as JSON values."""
        return {f.name: _plain(getattr(self, f.name)) for f in dataclasses.fields(self)}

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> Self:
        """The configuration with some values by name; fields left out have their defaults.

        Raises:
            UnknownNameError: A name is not a field; the message has the nearest one.
            InvalidInputError: A value is refused.
        """
        known_names(f"option of {cls.method}", values, [f.name for f in dataclasses.fields(cls)])
        converted: Any = {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}
        return cls(**converted)

    def _set(self, field: str, value: object) -> None:
        """Sets a field while this frozen object is initialised."""
        object.__setattr__(self, field, value)


@dataclasses.dataclass(frozen=True, kw_only=True)
class ActorOnly(Config):
    """The options of methods that train a network by Adam, without a critic."""

    hidden: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (256, 256)
    """Neurons of the hidden layers: at most 10 layers of at most 2048 neurons."""
    activation: Activation = "silu"
    """Activation of the hidden layers."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 1e-3
    """Learning rate of Adam in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 2e-5
    """Learning rate in the last segment; in between it falls by equal factors."""
    max_grad_norm: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Norm at which gradients are clipped."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known_names("activation", [self.activation], get_args(Activation))
        if not isinstance(self.hidden, tuple) or not 1 <= len(self.hidden) <= MOST_LAYERS:
            raise InvalidInputError(f"hidden: expected 1 to {MOST_LAYERS} layers, got {self.hidden!r}.")
        self._set("hidden", tuple(count("hidden", width, at_most=MOST_NEURONS) for width in self.hidden))
        for name in ("learning_rate", "learning_rate_end", "max_grad_norm"):
            self._set(name, number(name, getattr(self, name), above=0.0, at_most=MOST_RATE))

    def learning_rate_of(self, segment: int) -> float:
        """The learning rate of a segment, counted from 0."""
        part = segment / max(self.segments - 1, 1)
        return float(self.learning_rate * (self.learning_rate_end / self.learning_rate) ** part)


def count(name: str, value: int, *, at_most: int) -> int:
    """A whole number from 1 to a limit.

    Raises:
        InvalidInputError: It is none.
    """
    out = whole_number(name, value, at_least=1)
    if out > at_most:
        raise InvalidInputError(f"{name}: expected a whole number from 1 to {at_most}, got {out}.")
    return out


def _plain(value: Any) -> Any:
    if isinstance(value, pathlib.Path):
        return str(value)
    return list(value) if isinstance(value, tuple) else value
