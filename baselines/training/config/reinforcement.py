"""What runs of the methods have in common that learn from rewards, with the names of Stable-Baselines3."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, ClassVar, Literal, get_args

import tyro

from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.relative.processing import Relative, Squash
from baselines.training.config.base import Annealed, Config, JointVelocities, Stored
from baselines.training.config.limits import MOST_BATCH, between, count, share
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
    predicted_rates: bool = False
    """Whether agents with an output that is inverse are shown joint rates at predicted postures, see apg."""
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
        if self.output != "inverse":
            self._expect_defaults("privileged", "null_noise", "predicted_rates", output=self.output)
        if self.output != "velocities":
            self._expect_defaults("base_policy", "null_space", "initial_episode_steps", output=self.output)
        else:
            self._expect_defaults("damping", output=self.output)
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
            return Bilinear(self.offsets, self.damping, matrix=False, predicted_rates=self.predicted_rates)
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
            own = {name: getattr(processing, name) for name in ("damping", "predicted_rates")}
            return Config.shape_of(processing, sizes, activation) | own
        if not isinstance(processing, Relative):
            return super().shape_of(processing, sizes, activation)
        bounds = {name: getattr(processing, name) for name in ("largest", "furthest", "damping")}
        return Config.shape_of(processing, sizes, activation) | bounds


@dataclasses.dataclass(frozen=True, kw_only=True)
class StateDependentExploration(Reinforcement):
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
