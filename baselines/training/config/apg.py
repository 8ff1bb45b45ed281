"""The configuration of analytic policy gradient."""

from __future__ import annotations

import dataclasses
import pathlib
from typing import Annotated, ClassVar

import tyro

from baselines.agents.bilinear.processing import Bilinear
from baselines.training.config.base import ActorOnly
from ikgym.exceptions import InvalidInputError
from ikgym.validation import number, whole_number


@dataclasses.dataclass(frozen=True, kw_only=True)
class APG(ActorOnly):
    """Analytic policy gradient: back-propagation of the cost through the arm, over windows of some steps.

    The agent is bilinear: its network gives the matrix by which the twist that is due becomes joint velocities.
    """

    method: ClassVar[str] = "apg"

    offsets: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = Bilinear.offsets
    """Steps ahead at which the agent sees the reference trajectory, rising from 1."""
    damping: Annotated[float | None, tyro.conf.arg(metavar="λ")] = None
    """The agent begins as the damped inverse of the Jacobian with this λ, which the network adjusts and adds to, and
    sees the joint rates that the reference ahead requires. The network gives the whole matrix if left out. Not for skew
    coordinates."""
    n_envs: Annotated[int, tyro.conf.arg(metavar="N")] = 256
    """Number of arms stepped together, at most 10000. At first they are spread over their episodes."""
    learning_rate: Annotated[float, tyro.conf.arg(metavar="RATE")] = 2e-3
    """Learning rate of Adam in the first segment."""
    learning_rate_end: Annotated[float, tyro.conf.arg(metavar="RATE")] = 5e-5
    """Learning rate in the last segment; in between it falls by equal factors."""
    window: Annotated[tuple[int, ...], tyro.conf.arg(metavar="N …")] = (64, 120, 240, 480)
    """Steps through which gradients are back-propagated for one step of Adam: these values one after the other, each in
    an equal part of the segments. The way through a singularity is decided some hundred steps before it; the agent
    learns nothing from costs beyond the window."""
    segment_steps: Annotated[int, tyro.conf.arg(metavar="N")] = 1920
    """Steps of each arm in a segment: a multiple of each window."""
    hold: Annotated[int, tyro.conf.arg(metavar="N")] = 8
    """Steps for which the output of the network is held, with feedback at every step: a divisor of each window."""
    max_gradient_share: Annotated[float, tyro.conf.arg(metavar="X")] = 10.0
    """The gradient with respect to the network output of one arm is clipped at this many times an equal share of a loss
    of 1: near singularities it would otherwise exceed that of all others together."""
    cost_prior_steps: Annotated[float, tyro.conf.arg(metavar="N")] = 100.0
    """Costs are divided by the mean stage cost of their episode up to the end of the window, in which the mean cost of
    the reference joint path counts as much as this many steps: the objective is the logarithm of the costs of whole
    episodes."""
    reset_distance: Annotated[float, tyro.conf.arg(metavar="M")] = 0.3
    """Arms farther from their reference position than this, in [m], are put back on the reference path."""
    reset_distance_end: Annotated[float, tyro.conf.arg(metavar="M")] = 1.0
    """The same in the segments of the last window, in which the agent learns to come back from farther away."""
    averaging: Annotated[float, tyro.conf.arg(metavar="β")] = 0.99
    """The agent is the exponential moving average of the weights, of which each step of Adam keeps this share."""
    init: Annotated[pathlib.Path | None, tyro.conf.arg(metavar="FILE")] = None
    """The agent.safetensors of an earlier run whose weights to begin from; offsets, damping, hidden and activation must
    be those of that run."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set("offsets", self.processing.offsets)
        self._set("damping", self.processing.damping)
        if self.init is not None:
            self._set("init", pathlib.Path(self.init))
        for name in ("hold", "segment_steps"):
            self._set(name, whole_number(name, getattr(self, name), at_least=1))
        if not isinstance(self.window, tuple) or not self.window:
            raise InvalidInputError(f"window: expected whole numbers, got {self.window!r}.")
        self._set("window", tuple(whole_number("window", steps, at_least=1) for steps in self.window))
        for steps in self.window:
            if steps % self.hold or self.segment_steps % steps:
                raise InvalidInputError(
                    f"window: expected multiples of hold, {self.hold}, that divide segment_steps, "
                    f"{self.segment_steps}, got {steps}."
                )
        for name in ("max_gradient_share", "cost_prior_steps", "reset_distance", "reset_distance_end"):
            self._set(name, number(name, getattr(self, name), above=0.0))
        self._set("averaging", number("averaging", self.averaging, at_least=0.0, at_most=1.0))

    @property
    def processing(self) -> Bilinear:
        """The features and the law of the agent."""
        return Bilinear(self.offsets, self.damping)

    def window_of(self, segment: int) -> int:
        """The window of a segment, counted from 0."""
        return self.window[self._stage(segment)]

    def reset_distance_of(self, segment: int) -> float:
        """The reset distance of a segment, counted from 0, in [m]."""
        last = self._stage(segment) == len(self.window) - 1
        return self.reset_distance_end if last else self.reset_distance

    def _stage(self, segment: int) -> int:
        return segment * len(self.window) // self.segments
