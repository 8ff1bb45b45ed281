"""What runs of the methods are that learn from rewards, with the hyperparameters of Stable-Baselines3 by its names."""

from __future__ import annotations

import dataclasses
import re
from typing import Annotated, Any, ClassVar, Literal, get_args

import tyro

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.relative.processing import Relative, Squash
from baselines.training.config.base import Annealed, Config, JointVelocities, Stored
from baselines.training.config.limits import MOST_BATCH, MOST_TRANSITIONS, between, count, share
from ikgym.exceptions import InvalidInputError
from ikgym.rl import Learning
from ikgym.validation import flag, known_names, number, whole_number

Reward = Literal["cost", "log"]
Output = Literal["velocities", "bilinear", "inverse"]

#: Limits of the logarithm of a standard deviation: those that SAC has for it.
LOG_STD = (-20.0, 2.0)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Reinforcement(Annealed, JointVelocities):
    """What the methods that learn from rewards have in common."""

    #: What keeps actions within their bounds.
    squash: ClassVar[Squash]

    output: Output = "velocities"
    """What the network gives. velocities: those of the joints, as multiples of action_scale. bilinear: G and h, see
    baselines.training.policies, with the environment of ikgym.rl: lost tracks end an episode there, rewards are never
    negative, and offsets are what is seen of the reference, to the first of which the arm is led. inverse: null motion,
    damping and metric of a damped inverse, held for some steps, see baselines.training.environment.inverse_env."""
    lost_distance: Annotated[float, tyro.conf.arg(metavar="M")] = 0.01
    """Position error in [m] at which an episode ends in training, unless the output is velocities."""
    hold: Annotated[int, tyro.conf.arg(metavar="N")] = 20
    """Steps for which an output that is inverse is held, with feedback at every step: a divisor of those of an episode.
    A step of n_steps, train_freq and gamma is then as many of the arm."""
    privileged: bool = False
    """Whether critics see more than the features: the velocities of the joints, and the cost of the reference joint
    path. Rewards depend on both; the actor never sees them. Only for an output that is inverse."""
    log_above: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Costs of more than about this many times the mean of the reference joint path count by their logarithm in the
    rewards of an output that is inverse."""
    null_noise: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Noise of exploration of the null motion at the start, as a multiple of that of the damping and the metric. Only
    for an output that is inverse."""
    largest: Annotated[float, tyro.conf.arg(metavar="X")] = Learning.largest
    """Largest velocity of a joint of bilinear agents, in units of what is asked for."""
    furthest: Annotated[float, tyro.conf.arg(metavar="X")] = Learning.furthest
    """Where the twist that is due is cut that bilinear agents see, in units of the speed of what is ahead."""
    damping: Annotated[float | None, tyro.conf.arg(metavar="λ")] = None
    """A bilinear agent begins as the damped inverse of the Jacobian with this λ, which the network changes, weighs and
    adds to. The network gives the whole matrix if left out. Not for skew coordinates."""
    reward: Reward = "log"
    """cost: −stage cost, as in the environment. log: −log(1 + stage cost), which keeps an arm that has lost its path,
    whose costs are millions of times larger, from dominating; costs are then compared by their ratios."""
    episodes: Annotated[int, tyro.conf.arg(metavar="N")] = 1
    """Episodes of each arm in one segment."""
    initial_episode_steps: Annotated[int | None, tyro.conf.arg(metavar="N")] = None
    """Curriculum over the episode length: steps of an episode at first, a divisor of the scenario's. An untrained agent
    loses its path within tenths of a second, and learns nothing from what follows. Over the first half of the segments
    episodes grow to their full length. They have it from the beginning if left out."""
    batch_size: Annotated[int, tyro.conf.arg(metavar="N")] = 256
    """Transitions of one gradient step."""
    gamma: Annotated[float, tyro.conf.arg(metavar="γ")] = 0.98
    """Discount factor."""
    critic_warmup: Annotated[int, tyro.conf.arg(metavar="N")] = 0
    """First segments in which only the critics learn: for an actor from --init whose critics do not know it yet."""

    def __post_init__(self) -> None:
        known_names("output", [self.output], get_args(Output))
        for name in ("lost_distance", "log_above", "null_noise", "largest", "furthest"):
            self._set(name, number(name, getattr(self, name), above=0.0))
        self._set("hold", whole_number("hold", self.hold, at_least=1))
        if self.output == "inverse" and self.damping is None:
            raise InvalidInputError("damping: expected a number for an output that is inverse, got None.")
        flag("privileged", self.privileged)
        if self.privileged and self.output != "inverse":
            raise InvalidInputError(f"privileged: expected false for an output that is {self.output}, got true.")
        if self.null_noise != 1.0 and self.output != "inverse":
            raise InvalidInputError(
                f"null_noise: expected 1 for an output that is {self.output}, got {self.null_noise!r}."
            )
        if self.output != "velocities":
            self._expect_none("base_policy", "null_space", "initial_episode_steps", output=self.output)
        elif self.damping is not None:
            raise InvalidInputError(f"damping: expected none for an output of velocities, got {self.damping!r}.")
        super().__post_init__()
        known_names("reward", [self.reward], get_args(Reward))
        self._set("episodes", whole_number("episodes", self.episodes, at_least=1))
        self._set("batch_size", count("batch_size", self.batch_size, at_most=MOST_BATCH))
        if self.initial_episode_steps is not None:
            self._set(
                "initial_episode_steps",
                whole_number("initial_episode_steps", self.initial_episode_steps, at_least=1),
            )
        self._set("gamma", share("gamma", self.gamma))
        self._set("critic_warmup", whole_number("critic_warmup", self.critic_warmup, at_least=0))

    @property
    def processing(self) -> Stored:
        """What the agent sees, and what the outputs of its network mean."""
        if self.output == "velocities":
            return self.velocities
        if self.output == "inverse":
            return Bilinear(self.offsets, self.damping, matrix=False)
        return Relative(
            self.offsets,
            self.furthest,
            self.largest,
            squash=self.squash,
            bilinear=True,
            damping=self.damping,
        )

    @property
    def learning(self) -> Learning:
        """How the environment of bilinear agents is wrapped."""
        return Learning(
            preview=self.offsets,
            largest=self.largest,
            furthest=self.furthest,
            lost_distance=self.lost_distance,
            jacobian=self.damping is not None,
        )

    @classmethod
    def shape_of(cls, processing: Stored, sizes: tuple[int, ...], activation: str) -> dict[str, Any]:
        """See :meth:`Config.shape_of`."""
        if isinstance(processing, Bilinear):
            return Config.shape_of(processing, sizes, activation) | {"damping": processing.damping}
        if not isinstance(processing, Relative):
            return super().shape_of(processing, sizes, activation)
        bounds = {name: getattr(processing, name) for name in ("largest", "furthest", "damping")}
        return Config.shape_of(processing, sizes, activation) | bounds


@dataclasses.dataclass(frozen=True, kw_only=True)
class _StateDependentExploration(Reinforcement):
    """The noise of PPO and SAC."""

    log_std_init: Annotated[float, tyro.conf.arg(metavar="X")] = -2.0
    """Logarithm of the standard deviation of network outputs at the start, from -20 to 2; before tanh for SAC. With
    --init, PPO starts from it again, so choose it smaller there; an actor that was trained by SAC keeps its own."""
    use_sde: bool = False
    """Generalised state-dependent exploration (gSDE, Raffin et al. 2021): noise is a function of what the agent sees,
    and log_std_init that of the weights of this function. Independent noise in each step averages out before the arm
    has moved."""
    sde_sample_freq: Annotated[int, tyro.conf.arg(metavar="N")] = -1
    """Steps after which the function of --use-sde is drawn anew; -1 for once a rollout."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("log_std_init", between("log_std_init", self.log_std_init, *LOG_STD))
        flag("use_sde", self.use_sde)
        if self.sde_sample_freq != -1:
            self._set("sde_sample_freq", whole_number("sde_sample_freq", self.sde_sample_freq, at_least=1))
            if not self.use_sde:
                raise InvalidInputError(f"sde_sample_freq: expected use_sde beside it, got {self.sde_sample_freq}.")


@dataclasses.dataclass(frozen=True, kw_only=True)
class PPO(_StateDependentExploration):
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
            for name, usual in (("group_size", 1), ("null_space_noise", False)):
                if getattr(self, name) != usual:
                    raise InvalidInputError(
                        f"{name}: expected {usual} for an output that is {self.output}, got {getattr(self, name)!r}."
                    )
        if self.null_space_noise and (self.use_sde or not self.privileged):
            raise InvalidInputError("null_space_noise: expected false with use_sde and without privileged, got true.")
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
class SAC(OffPolicy, _StateDependentExploration):
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
