"""Second-order smoothing of the joint path that any policy calculates (Varga 2021, section V)."""

from __future__ import annotations

import dataclasses
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution
from baselines.wrapper import NamedWrapper
from ikgym.exceptions import InvalidInputError
from ikgym.validation import Bounds, FloatArray


class SmoothedMemory(NamedTuple):
    """Memory of the filter; that of the inner policy follows it.

    Attributes:
        known: Whether the rest is known. Shape (B,).
        q: The calculated joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: The calculated joint velocities in [rad/s] or [m/s]. Shape (B, n).
        smooth: q̇ˢ, to be sent next. Shape (B, n).
    """

    known: npt.NDArray[np.bool_]
    q: FloatArray
    qdot: FloatArray
    smooth: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Smoothed(NamedWrapper):
    """Lets the arm follow the joint path of another policy through a filter of second order.

    The smoothed path obeys (Λ + d/dt)² qˢ = Λ² q (eq. 13). The printed eq. 16 lacks a dot; it is
    q̈ˢ = Λ² (q − qˢ) − 2Λ q̇ˢ, integrated by explicit Euler as in eq. 17: q̇ˢ(t+Δt) = q̇ˢ + Δt q̈ˢ and
    qˢ(t+Δt) = qˢ + Δt q̇ˢ(t), with the velocity from before. The arm thus is sent q̇ˢ(t), which was known a step ago.
    At the start, where the paper says nothing, qˢ = q and q̇ˢ = 0. qˢ is the measured q: roundings do not pile up.
    A constant velocity is followed 2/Λ late.

    The paper smooths the calculated q(t) afterwards, so that the calculation does not know of the smoothing: the inner
    policy sees the arm where its velocities would have brought the model, and runs as if it were alone. The effect
    of a wrong model, disturbed drives or a saturated velocity on the pose is then seen by nobody, and stays. (Shown the
    arm as it is, the inner policy has the lag in its loop: a resolved rate of gain 1 and receding horizons diverge.)

    The filter is stable for ΛΔt < 2, and does not overshoot for ΛΔt ≤ 1. Status and iterations are those of the
    inner policy. References, which know more than they see, cannot be smoothed.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the inner policy.
        options: Its parameters; those left out have its defaults.
        relaxation: Λ in [1/s], above 0 and below 2/Δt.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: Λ is out of its range, the policy is a reference, or it refuses its parameters.
    """

    policy: str = "rhc_gradient"
    relaxation: Annotated[float, Bounds(above=0.0)] = 300.0

    name: ClassVar[str] = "smoothed"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.relaxation * self.problem.dt >= 2.0:
            most = 2.0 / self.problem.dt
            raise InvalidInputError(
                f"relaxation: explicit Euler is stable below 2/Δt = {most:g}, got {self.relaxation:g}."
            )

    def own_memory(self, rows: int) -> SmoothedMemory:
        """See :meth:`Wrapper.own_memory`."""
        n = self.problem.model.joints
        return SmoothedMemory(
            np.zeros(rows, dtype=np.bool_), np.zeros((rows, n)), np.zeros((rows, n)), np.zeros((rows, n))
        )

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        outer, inside = self.split(memory)
        dt, lambda_, limit = self.problem.dt, self.relaxation, self.problem.velocity_limit
        known = outer.known[:, None]
        calculated = np.where(known, outer.q, batch.q)
        qdot = np.where(known, outer.qdot, batch.qdot)
        shown = batch._replace(q=calculated, qdot=qdot, pose=self.problem.poses(calculated))
        step = self.ask(shown, self.inner.recall(inside, qdot))
        # The arm does not exceed the limit.
        sent = np.clip(outer.smooth, -limit, limit)
        acceleration = lambda_**2 * (calculated - batch.q) - 2.0 * lambda_ * sent  # eq. 16
        kept = SmoothedMemory(
            np.ones_like(outer.known), calculated + dt * step.qdot, step.qdot, sent + dt * acceleration
        )  # eq. 17
        return self.solution(outer.smooth.copy(), kept, step)
