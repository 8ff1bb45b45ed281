"""Actions of agents within the limits of the arm."""

from __future__ import annotations

import dataclasses
from typing import Self

import numpy as np

from baselines.policy import Batch, Problem
from baselines.solvers.quadratic_program.limits import limits_with_braking
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from ikgym.kernels.jit import kernel
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Bounds:
    """Bounds of joint velocities, those of the policy `qp`: a joint brakes ahead of its stop.

    Args:
        limits: See :func:`limits_with_braking`. Shape (5, n).
        dt: Δt in [s].
        velocity_limit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
    """

    limits: FloatArray
    dt: float
    velocity_limit: FloatArray

    @classmethod
    def of(cls, problem: Problem) -> Self | None:
        """The bounds of a problem; None if the arm has no limits."""
        model = problem.model
        known = np.concatenate([model.lower, model.upper, model.velocity_limit, model.acceleration_limit])
        if not np.isfinite(known).any():
            return None
        return cls(limits_with_braking(problem), problem.dt, problem.velocity_limit)

    def keep(self, batch: Batch, action: FloatArray) -> FloatArray:
        """Actions within the bounds; NaN stays NaN.

        Args:
            batch: Observations.
            action: Fractions of the velocity limit, changed in place. Shape (B, n).
        """
        keep_rows(self.limits, self.dt, self.velocity_limit, batch.q, batch.qdot, action)
        return action


@kernel
def keep_rows(limits, dt, velocity_limit, q, last, action):
    """Bounds actions, row by row.

    Args:
        limits: See :func:`velocity_box`. Shape (5, n).
        dt: Δt in [s].
        velocity_limit: Shape (n,).
        q: Shape (B, n).
        last: Joint velocities last applied. Shape (B, n).
        action: Fractions of the velocity limit, changed in place. Shape (B, n).
    """
    n = q.shape[1]
    lower, upper = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        velocity_box(limits, dt, q[row], last[row], lower, upper)
        for j in range(n):
            share = action[row, j]
            if share * velocity_limit[j] > upper[j]:
                action[row, j] = upper[j] / velocity_limit[j]
            elif share * velocity_limit[j] < lower[j]:
                action[row, j] = lower[j] / velocity_limit[j]
