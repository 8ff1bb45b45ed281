"""What runs of the methods are that train an actor without rewards and critics: imitation, analytic policy gradient."""

from __future__ import annotations

import dataclasses
from typing import Annotated, Any, ClassVar, Literal, get_args

import tyro

from baselines.agents.bilinear.processing import Bilinear
from baselines.training.config.base import Algorithm, Annealed, JointVelocities, Stored
from baselines.training.config.limits import MOST_BATCH, MOST_TRANSITIONS, between, count
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names, number, whole_number

#: What the network of an agent gives that imitates an expert.
StudentOutput = Literal["velocities", "bilinear"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class ActorOnly(Annealed):
    """What the configurations of these methods have in common."""

    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 64
    """Arms that are stepped together, at most 10000."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 1e-3
    """Of Adam, in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 2e-5
    """In the last segment; in between it falls by equal factors."""
    max_grad_norm: Annotated[float, tyro.conf.arg(metavar="X")] = 1.0
    """Norm at which gradients are clipped."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("max_grad_norm", number("max_grad_norm", self.max_grad_norm, above=0.0))


@dataclasses.dataclass(frozen=True, kw_only=True)
class Imitate(ActorOnly, JointVelocities):
    """Supervised learning of another policy, with data aggregation (DAgger, Ross et al. 2011)."""

    method: ClassVar[str] = "imitate"

    output: StudentOutput = "velocities"
    """What the network gives. velocities: those of the joints, as multiples of action_scale. bilinear: G and h, as that
    of apg, which can go on with it."""
    damping: Annotated[float | None, tyro.conf.arg(metavar="λ")] = None
    """A bilinear agent begins as the damped inverse of the Jacobian with this λ, see apg."""
    matrix: bool = True
    """Whether the network of a bilinear agent adds a matrix to the damped inverse, see apg."""
    predicted_rates: bool = False
    """Whether a bilinear agent is shown joint rates at predicted postures, see apg."""
    algorithm: Algorithm = "ppo"
    """The kind of model that comes out where the output is velocities, which the same algorithm can go on with."""
    expert: Annotated[str, tyro.conf.arg(metavar="POLICY")] = "rhc_foresight"
    """Who is imitated, as NAME or NAME:PARAMETER=VALUE,…"""
    beta: Annotated[float, tyro.conf.arg(metavar="β")] = 0.2
    """DAgger's mixing β: share of the arms that the expert moves, after the first segment, where β is 1."""
    intervention_distance: Annotated[float, tyro.conf.arg(metavar="M")] = 0.05
    """The expert takes over arms that are farther from their reference position than this, in [m]."""
    expert_noise: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.3
    """Largest disturbance of the arms that the expert moves, as a multiple of their joint velocity, so that examples
    show how to come back. Projected into the null space where network outputs are."""
    tolerance: Annotated[float, tyro.conf.arg(metavar="X")] = 0.02
    """Scale c of the Cauchy loss ln(1 + |error|²/c²) of network outputs, in which larger errors matter little. Of
    bilinear agents the error is that of the joint velocities, in units of the speed of the reference ahead."""
    example_every: Annotated[int, tyro.conf.arg(metavar="N")] = 4
    """Steps from one example to the next: those in between are much like it."""
    buffer_size: Annotated[int, tyro.conf.arg(metavar="N")] = 400_000
    """Examples that are kept, at most 10000000; the newest replace the oldest."""
    gradient_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 500
    """Gradient steps of a segment."""
    batch_size: Annotated[int, tyro.conf.arg(metavar="N")] = 1024
    """Examples of one gradient step."""

    def __post_init__(self) -> None:
        known_names("output", [self.output], get_args(StudentOutput))
        if self.output == "velocities":
            self._expect_defaults("damping", "matrix", "predicted_rates", output=self.output)
        else:
            self._expect_defaults("base_policy", "null_space", output=self.output)
        super().__post_init__()
        known_names("algorithm", [self.algorithm], get_args(Algorithm))
        self._set("beta", between("beta", self.beta, 0.0, 1.0))
        for name in ("intervention_distance", "tolerance"):
            self._set(name, number(name, getattr(self, name), above=0.0))
        self._set("expert_noise", number("expert_noise", self.expert_noise, at_least=0.0))
        for name in ("example_every", "gradient_steps"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))
        self._set("buffer_size", count("buffer_size", self.buffer_size, at_most=MOST_TRANSITIONS))
        self._set("batch_size", count("batch_size", self.batch_size, at_most=MOST_BATCH))

    @property
    def processing(self) -> Stored:
        """What the agent sees, and what the outputs of its network mean."""
        return self.velocities if self.output == "velocities" else self.bilinear

    @property
    def bilinear(self) -> Bilinear:
        """The same, where these outputs are G and h."""
        return Bilinear(self.offsets, self.damping, self.matrix, self.predicted_rates)

    @classmethod
    def shape_of(cls, processing: Stored, sizes: tuple[int, ...], activation: str) -> dict[str, Any]:
        """See :meth:`Config.shape_of`."""
        if isinstance(processing, Bilinear):
            return APG.shape_of(processing, sizes, activation)
        return super().shape_of(processing, sizes, activation)


@dataclasses.dataclass(frozen=True, kw_only=True)
class APG(ActorOnly):
    """Analytic policy gradient: back-propagation of the cost through the arm, over windows of some steps.

    The agent is bilinear: its network gives the matrix by which the twist that is due becomes joint velocities.
    """

    method: ClassVar[str] = "apg"

    offsets: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = Bilinear.offsets
    """Steps ahead at which the agent sees the reference trajectory, rising from 1."""
    damping: Annotated[float | None, tyro.conf.arg(metavar="λ")] = None
    """The agent begins as the damped inverse of the Jacobian with this λ, which the network changes, weighs and adds
    to. The network gives the whole matrix if left out. Not for skew coordinates."""
    matrix: bool = True
    """Whether the network adds a matrix to the damped inverse. Without it it gives the null motion, the damping and the
    metric alone."""
    predicted_rates: bool = False
    """Whether the agent is shown what the reference ahead will ask of the joints at the postures that a damped inverse
    would lead to by then, rather than at the posture of now. Of what is shown no gradient is taken then."""
    hidden: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (256, 256)
    """Neurons of the hidden layers: at most 10 layers of at most 2048 neurons."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 256
    """Arms that are stepped together, at most 10000. At first they are spread over their episodes."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 2e-3
    """Of Adam, in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 5e-5
    """In the last segment; in between it falls by equal factors."""
    window: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (64, 120, 240, 480)
    """Steps through which gradients are back-propagated, from one step of Adam to the next: these one after the other,
    each in an equal part of the segments. The way through a singularity is decided some hundred steps before it; of
    what lies beyond the window, the agent learns nothing."""
    segment_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 1920
    """Steps of each arm in a segment: a multiple of each window."""
    hold: Annotated[int, tyro.conf.arg(metavar="N")] = 8
    """Steps for which the output of the network is held, with feedback at every step: a divisor of each window."""
    max_gradient_share: Annotated[float, tyro.conf.arg(metavar="X")] = 10.0
    """The gradient by what the network gives one arm is cut at this many times an equal share of a loss of 1: near
    singularities it would otherwise exceed that of all others together."""
    cost_prior_steps: Annotated[float, tyro.conf.arg(metavar="N")] = 100.0
    """Costs are divided by the mean stage cost of their episode up to the end of the window, in which the mean cost of
    the reference joint path counts as much as this many steps: what is minimised is the logarithm of the costs of
    whole episodes."""
    reset_distance: Annotated[float, tyro.conf.arg(metavar="M")] = 0.3
    """Arms that are farther from their reference position than this, in [m], are put back on the reference path."""
    reset_distance_end: Annotated[float, tyro.conf.arg(metavar="M")] = 1.0
    """The same in the segments of the last window, in which the agent learns to come back from farther away."""
    replay_share: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.0
    """Share of the episodes that are drawn from those that were lost or cost most so far, rather than anew."""
    singular_share: Annotated[float, tyro.conf.arg(metavar="SHARE")] = 0.0
    """Share of the episodes that are entered just before their reference joint path is closest to a singularity, rather
    than begun at their beginning."""
    start_noise: Annotated[float, tyro.conf.arg(metavar="X")] = 0.0
    """Standard deviation of the joint coordinates, off the path, where an episode begins, in [rad] or [m]."""
    averaging: Annotated[float, tyro.conf.arg(metavar="β")] = 0.99
    """The agent is the exponential moving average of the weights, of which each step of Adam keeps this share."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("damping", self.processing.damping)
        if not isinstance(self.window, tuple) or not self.window:
            raise InvalidInputError(f"window: expected whole numbers, got {self.window!r}.")
        self._set("hold", whole_number("hold", self.hold, at_least=1))
        self._set("segment_steps", whole_number("segment_steps", self.segment_steps, at_least=1))
        self._set("window", tuple(whole_number("window", steps, at_least=1) for steps in self.window))
        for steps in self.window:
            if steps % self.hold or self.segment_steps % steps:
                raise InvalidInputError(
                    f"window: expected multiples of hold, {self.hold}, that divide segment_steps, "
                    f"{self.segment_steps}, got {steps}."
                )
        for name in ("max_gradient_share", "cost_prior_steps", "reset_distance", "reset_distance_end"):
            self._set(name, number(name, getattr(self, name), above=0.0))
        self._set("start_noise", number("start_noise", self.start_noise, at_least=0.0))
        for name in ("averaging", "replay_share", "singular_share"):
            self._set(name, between(name, getattr(self, name), 0.0, 1.0))

    @property
    def processing(self) -> Bilinear:
        """What the agent sees, and what the outputs of its network mean."""
        return Bilinear(self.offsets, self.damping, self.matrix, self.predicted_rates)

    @classmethod
    def shape_of(cls, processing: Stored, sizes: tuple[int, ...], activation: str) -> dict[str, Any]:
        """See :meth:`Config.shape_of`."""
        first = {"damping": None, "matrix": True, "predicted_rates": False}
        own = {name: getattr(processing, name, value) for name, value in first.items()}
        return super().shape_of(processing, sizes, activation) | own

    def window_of(self, segment: int) -> int:
        """The window of a segment, counted from 0."""
        return self.window[self._stage(segment)]

    def reset_distance_of(self, segment: int) -> float:
        """The reset distance of a segment, counted from 0, in [m]."""
        last = self._stage(segment) == len(self.window) - 1
        return self.reset_distance_end if last else self.reset_distance

    def _stage(self, segment: int) -> int:
        return segment * len(self.window) // self.segments
