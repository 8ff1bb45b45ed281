"""Agents trained in the environments of :mod:`ikgym.rl`: the same features, and actions of the same meaning."""

from __future__ import annotations

import dataclasses
import functools
from typing import ClassVar

import numpy as np

from baselines.agents.network import Network
from baselines.agents.processing import Held, Processing
from baselines.policy import Batch, Problem
from ikgym.rl.task import steps_ahead
from ikgym.rl.track import joint_scales
from ikgym.rl.track_kernels import track_rows
from ikgym.rl.twists import twist_size
from ikgym.validation import FloatArray, Positive


@dataclasses.dataclass(frozen=True)
class Track(Processing):
    """Joint velocities as a share of the largest, from the features of :class:`ikgym.rl.Task`.

    Times ahead are in [s], so that an agent trained at 100 Hz sees as far at 1 kHz.

    Args:
        ahead: Times ahead at which the reference is seen, in [s], rising.
        share: Share of the largest joint velocities that an output of 1 means, above 0.
        radian: Weight of 1 rad in [m], above 0.
        coarse: Unit of errors in [m], above 0.
        fine: Unit of the hyperbolic tangent of the same, in [m], above 0.

    Raises:
        InvalidInputError: A value is out of its range.
    """

    ahead: tuple[float, ...]
    share: Positive = 1.0
    radian: Positive = 0.3
    coarse: Positive = 0.03
    fine: Positive = 0.01

    kind: ClassVar[str] = "track"
    #: Steps for which an action was held in the training.
    interval = 1
    #: Actions are those of the model; the limits of the arm hold on top.
    bounded: ClassVar[bool] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        steps_ahead(self.ahead, 1.0)
        self._settle(ahead=tuple(map(float, self.ahead)))

    def steps(self, problem: Problem) -> tuple[int, ...]:
        """See :meth:`Processing.steps`."""
        return steps_ahead(self.ahead, problem.dt)

    def size(self, problem: Problem) -> int:
        """The number of features."""
        return 2 * (problem.model.joints + len(self.steps(problem)) * int(twist_size(problem.task.kind)))

    def outputs(self, problem: Problem) -> int:
        """The number of network outputs: one a joint."""
        return problem.model.joints

    def held_size(self, problem: Problem) -> int:
        """The number of values that are held between evaluations of the network: its outputs."""
        return problem.model.joints

    def act(self, problem: Problem, batch: Batch, network: Network, interval: int, held: Held) -> FloatArray:
        """See :meth:`Processing.act`."""
        features, due, arm = np.empty((len(batch.q), network.sizes[0])), held.left == 0, _arm(problem)
        scales, seen = (self.radian, self.coarse, self.fine), (batch.q, batch.qdot, batch.pose, batch.nominal)
        track_rows(problem.task.kind, problem.model.chain, scales, *arm, *seen, features)
        if due.any():
            held.values[due] = network.forward(features[due].astype(np.float32))
            held.left[due] = interval
        held.left[:] -= 1
        fractions: FloatArray = held.values * (self.share * arm[-1] / problem.velocity_limit)
        return fractions


@functools.lru_cache
def _arm(problem: Problem) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where joints are seen from, their units, and their largest velocities. Shapes (n,)."""
    return *joint_scales(problem.model), problem.largest_qdot
