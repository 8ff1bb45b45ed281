"""What a run is: everything that its result depends on, but for the seed."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, get_args

import tyro

from baselines.agents.features import Processing
from ikgym import scenarios, tasks
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import Frozen, known_names, number, whole_number

Activation = Literal["silu", "relu", "tanh", "elu"]
Reward = Literal["cost", "log"]
#: Kinds of models of Stable-Baselines3 that come out of a training.
Algorithm = Literal["ppo", "sac", "td3"]

#: Fields that a model of ``init`` has settled.
SHAPE = ("base_policy", "offsets", "action_scale", "null_space", "hidden", "activation")


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
    """Task coordinates to train on, if not those of the scenario. Agents that know whole poses (pose) play scenarios
    that show skew coordinates, too, and better: those are folded, and singular where they are."""
    base_policy: Annotated[str | None, tyro.conf.arg(metavar="POLICY")] = None
    """Policy under the agent, as NAME or NAME:PARAMETER=VALUE,…: the agent learns a correction of its actions, and an
    answer of 0 is that policy. The agent stands alone if left out."""
    offsets: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = Processing.offsets
    """Steps ahead at which the agent sees the nominal coordinates, rising. Those that the policy under it must see, 1
    to its preview, have to come first."""
    action_scale: Annotated[float, tyro.conf.arg(metavar="X")] = Processing.action_scale
    """What an answer of 1 means, as a multiple of the speed of what is to come."""
    null_space: Annotated[float | None, tyro.conf.arg(metavar="λ")] = None
    """Lets answers move the arm without moving its tool, but for directions that are nearly singular: λ is the
    damping of the projector. Answers are taken as they are if left out."""
    hidden: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (256, 256, 256)
    """Neurons of the hidden layers, of the actor and of critics alike."""
    activation: Activation = "silu"
    """Of the hidden layers."""
    segments: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Parts of the training. After each of them it may be evaluated, and taken up again."""
    evaluate_every: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Segments from one evaluation on the validation split to the next; there is one at the start and one at the
    end, too."""
    validation_episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 32
    """Episodes of each: the first seeds of the validation split. A scenario without chance has one."""
    keep_best: bool = True
    """Keep the agent of the best evaluation (by the geometric mean of the costs), not the last one."""
    init: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """A model.zip of an earlier run to begin from: its actor, and its critics where the algorithm is the same. What
    the agent sees and the shape of its network come with it: base_policy, offsets, action_scale,
    null_space, hidden and activation."""

    def __post_init__(self) -> None:
        known_names("activation", [self.activation], get_args(Activation))
        for name in ("segments", "evaluate_every", "validation_episodes"):
            self._settle(name, whole_number(name, getattr(self, name), at_least=1))
        if self.steps is not None:
            self._settle("steps", whole_number("steps", self.steps, at_least=1))
        for name in ("hidden", "offsets"):
            if not isinstance(getattr(self, name), tuple):
                raise InvalidInputError(f"{name}: expected whole numbers, got {getattr(self, name)!r}.")
        if not self.hidden:
            raise InvalidInputError("hidden: expected at least one hidden layer, got none.")
        if not isinstance(self.keep_best, bool):
            raise InvalidInputError(f"keep_best: expected true or false, got {self.keep_best!r}.")
        self._settle("hidden", tuple(whole_number("hidden", width, at_least=1) for width in self.hidden))
        if self.init is not None:
            self._settle("init", pathlib.Path(self.init))
        processing = self.processing
        self._settle("offsets", processing.offsets)
        self._settle("action_scale", processing.action_scale)
        self._settle("null_space", processing.null_space)

    @property
    def processing(self) -> Processing:
        """What the agent sees, and what its answers mean."""
        return Processing(self.offsets, self.action_scale, self.base_policy, self.null_space)

    def make_scenario(self) -> Scenario:
        """The scenario, with the task and cut to the steps asked for.

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

    def _settle(self, field: str, value: object) -> None:
        object.__setattr__(self, field, value)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reinforcement(Config):
    """What the methods that learn from rewards have in common."""

    reward: Reward = "log"
    """cost: −stage cost, as in the environment. log: −log(1 + stage cost), which keeps a lost arm, whose costs are
    millions of times larger, from drowning all else; costs are then compared by their ratios."""
    envs: Annotated[int, tyro.conf.arg(metavar="N")] = 16
    """Arms that are stepped together."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Episodes of each arm in one segment."""
    cut: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Steps after which episodes are broken off at first, a divisor of theirs: an agent that knows nothing yet loses
    its arm within tenths of a second, and learns nothing from what comes then. Over the first half of the segments
    episodes grow to their full length. They have it from the beginning if left out."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 3e-4
    """Of Adam, in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 3e-5
    """In the last segment; in between it falls by equal factors."""
    batch_size: Annotated[int, tyro.conf.arg(metavar="N")] = 256
    """Transitions of one gradient step."""
    gamma: Annotated[float, tyro.conf.arg(metavar="γ")] = 0.98
    """Discount of a step."""
    critic_warmup: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """First segments in which only the critics learn: for an agent from --init whose critics do not know it yet."""

    def __post_init__(self) -> None:
        super().__post_init__()
        known_names("reward", [self.reward], get_args(Reward))
        for name in ("envs", "episodes", "batch_size"):
            self._settle(name, whole_number(name, getattr(self, name), at_least=1))
        if self.cut is not None:
            self._settle("cut", whole_number("cut", self.cut, at_least=1))
        for name in ("learning_rate", "learning_rate_end"):
            self._settle(name, number(name, getattr(self, name), above=0.0))
        self._settle("gamma", share("gamma", self.gamma))
        self._settle("critic_warmup", whole_number("critic_warmup", self.critic_warmup, at_least=0))

    def learning_rate_of(self, segment: int) -> float:
        """The learning rate of a segment, counted from 0."""
        part = segment / max(self.segments - 1, 1)
        return float(self.learning_rate * (self.learning_rate_end / self.learning_rate) ** part)


@dataclasses.dataclass(frozen=True, kw_only=True)
class PPO(Reinforcement):
    """Proximal policy optimisation (Schulman et al. 2017), by Stable-Baselines3."""

    method: ClassVar[str] = "ppo"

    rollout: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Steps of each arm between two updates: a divisor of the steps of a segment. A whole episode if left out."""
    epochs: Annotated[int, tyro.conf.arg(metavar="N")] = 10
    """Times that each transition is learned from."""
    gae_lambda: Annotated[float, tyro.conf.arg(metavar="λ")] = 0.95
    """Of the generalised advantage estimation."""
    clip_range: Annotated[float, tyro.conf.arg(metavar="ε")] = 0.2
    """How far the ratio of probabilities may go from 1."""
    target_kl: Annotated[float | None, tyro.conf.arg(metavar="KL")] = None
    """Epochs end early where the policy has gone further than this, in [nat]."""
    entropy: Annotated[float, tyro.conf.arg(metavar="C")] = 0.0
    """Weight of the entropy in the loss."""
    log_std_init: Annotated[float, tyro.conf.arg(metavar="X")] = -2.0
    """Logarithm of the standard deviation of answers at the start, of an agent from --init, too: smaller there."""
    noise_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Steps after which noise is drawn anew. 1: each answer has its own, which averages out before the arm has moved.
    More: noise is a function of what the agent sees (gSDE, Raffin et al. 2021), and drawn anew only so often; its
    standard deviation is then that of the weights of this function."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rollout is not None:
            self._settle("rollout", whole_number("rollout", self.rollout, at_least=1))
        self._settle("epochs", whole_number("epochs", self.epochs, at_least=1))
        self._settle("gae_lambda", share("gae_lambda", self.gae_lambda))
        self._settle("clip_range", number("clip_range", self.clip_range, above=0.0))
        if self.target_kl is not None:
            self._settle("target_kl", number("target_kl", self.target_kl, above=0.0))
        self._settle("entropy", number("entropy", self.entropy, at_least=0.0))
        self._settle("log_std_init", number("log_std_init", self.log_std_init))
        self._settle("noise_steps", whole_number("noise_steps", self.noise_steps, at_least=1))


@dataclasses.dataclass(frozen=True, kw_only=True)
class OffPolicy(Reinforcement):
    """What SAC and TD3 have in common."""

    buffer: Annotated[int, tyro.conf.arg(metavar="N")] = 200_000
    """Transitions that are remembered, of all arms together."""
    collect: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """First segments in which nothing is learned: they fill the memory with what the untrained agent does."""
    train_every: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Steps of each arm between two updates: a divisor of the steps of a segment."""
    gradient_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Gradient steps of an update."""
    tau: Annotated[float, tyro.conf.arg(metavar="τ")] = 0.005
    """How fast the target networks follow."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("buffer", "train_every", "gradient_steps"):
            self._settle(name, whole_number(name, getattr(self, name), at_least=1))
        if self.buffer < self.envs:
            raise InvalidInputError(f"buffer: expected at least one transition of each arm, got {self.buffer}.")
        self._settle("collect", whole_number("collect", self.collect, at_least=0))
        self._settle("tau", share("tau", self.tau))


@dataclasses.dataclass(frozen=True, kw_only=True)
class SAC(OffPolicy):
    """Soft actor-critic (Haarnoja et al. 2018), by Stable-Baselines3."""

    method: ClassVar[str] = "sac"

    log_std_init: Annotated[float, tyro.conf.arg(metavar="X")] = -2.0
    """Logarithm of the standard deviation of answers (before tanh) at the start. An agent from --init that was made
    by SAC keeps its own."""
    noise_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Steps after which noise is drawn anew, see ppo."""
    entropy: Annotated[float, tyro.conf.arg(metavar="NAT")] = -3.0
    """Entropy of each joint's answer in [nat] that the temperature is tuned for; -1 is the usual choice, and wide."""
    temperature: Annotated[float, tyro.conf.arg(metavar="α")] = 0.01
    """Weight of the entropy at the start."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle("log_std_init", number("log_std_init", self.log_std_init))
        self._settle("noise_steps", whole_number("noise_steps", self.noise_steps, at_least=1))
        self._settle("entropy", number("entropy", self.entropy))
        self._settle("temperature", number("temperature", self.temperature, above=0.0))


@dataclasses.dataclass(frozen=True, kw_only=True)
class TD3(OffPolicy):
    """Twin delayed deep deterministic policy gradient (Fujimoto et al. 2018), by Stable-Baselines3."""

    method: ClassVar[str] = "td3"

    noise: Annotated[float, tyro.conf.arg(metavar="σ")] = 0.05
    """Standard deviation of what is added to answers in training."""
    noise_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Steps after which noise has forgotten itself. 1: each answer has its own. More: an Ornstein–Uhlenbeck process
    with this time constant."""
    policy_delay: Annotated[int, tyro.conf.arg(metavar="N")] = 2
    """Gradient steps of the critics to one of the actor."""
    target_noise: Annotated[float, tyro.conf.arg(metavar="σ")] = 0.05
    """Standard deviation of what is added to the answers that the critics learn from, cut at 2.5 times as much."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("noise", "target_noise"):
            self._settle(name, number(name, getattr(self, name), at_least=0.0))
        self._settle("noise_steps", whole_number("noise_steps", self.noise_steps, at_least=1))
        self._settle("policy_delay", whole_number("policy_delay", self.policy_delay, at_least=1))


def share(name: str, value: float) -> float:
    """A number above 0, at most 1.

    Raises:
        InvalidInputError: It is none.
    """
    out = number(name, value, above=0.0)
    if out > 1.0:
        raise InvalidInputError(f"{name}: expected a number above 0, at most 1, got {out:g}.")
    return out


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
