"""The horizon problem in NumPy, with the errors of CasADi: one cost function for the plans of all solvers.

Over knots 1 … K behind a start q_0, with lengths h_k in steps and weights w_k, a plan q_1 … q_K costs
``Σ_k h_k Φ^U((q_k - q_{k-1}) / (h_k Δt)) + w_k Φ^X(error(X^N_k, F(q_k)))``; the horizon of HL grid points of
Varga 2021, section III, has K = HL - 1 and h = w = 1. Φ^U may weigh the joints. Written anew from
the papers, so that it can find a slip in ikgym's kernels.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from baselines.policy import Problem
from ikgym.validation import FloatArray
from tests.independent.casadi_kinematics import residual


@dataclasses.dataclass(frozen=True, eq=False)
class Horizon:
    """One state of a receding horizon.

    Args:
        q: Joint coordinates at the start, in [rad] or [m]. Shape (n,).
        nominal: Nominal task coordinates at the knots. Shape (K, m).
        steps: Lengths h of the intervals that end at the knots, in time steps; all 1 if left out. Shape (K,).
        weights: Weights w of the tracking costs; all 1 if left out. Shape (K,).
        qdot: Joint velocities of the step that has passed, in [rad/s] or [m/s], where accelerations are limited; at
            rest if left out. Shape (n,).
        joint_weights: Factors of the velocity costs of the joints; all 1 if left out. Shape (n,).
    """

    q: FloatArray
    nominal: FloatArray
    steps: FloatArray | None = None
    weights: FloatArray | None = None
    qdot: FloatArray | None = None
    joint_weights: FloatArray | None = None

    @property
    def knots(self) -> int:
        """K."""
        return len(self.nominal)

    @property
    def lengths(self) -> FloatArray:
        """h, with the default filled in. Shape (K,)."""
        return np.ones(self.knots) if self.steps is None else np.asarray(self.steps, dtype=np.float64)

    @property
    def tracking_weights(self) -> FloatArray:
        """w, with the default filled in. Shape (K,)."""
        return np.ones(self.knots) if self.weights is None else np.asarray(self.weights, dtype=np.float64)

    @property
    def qdot_before(self) -> FloatArray:
        """The joint velocities before, with the default filled in. Shape (n,)."""
        return np.zeros_like(self.q) if self.qdot is None else np.asarray(self.qdot, dtype=np.float64)

    @property
    def velocity_weights(self) -> FloatArray:
        """The weights of the joints, with the default filled in. Shape (n,)."""
        given = self.joint_weights
        return np.ones_like(self.q) if given is None else np.asarray(given, dtype=np.float64)


@dataclasses.dataclass(frozen=True, eq=False)
class Plan:
    """The result of a solver.

    Args:
        q: Joint coordinates at the knots, in [rad] or [m]. Shape (K, n).
        cost: The cost of that plan by :func:`plan_cost`, whatever the solver believes.
        iterations: Iterations made.
        converged: Whether the solver says that it has found an optimum.
    """

    q: FloatArray
    cost: float
    iterations: int
    converged: bool


def plan_cost(problem: Problem, horizon: Horizon, q: FloatArray) -> float:
    """The cost of a plan, joint coordinates (K, n) at the knots in [rad] or [m]."""
    cost, h = problem.cost, horizon.lengths
    qdot = np.diff(np.vstack([horizon.q, q]), axis=0) / (h[:, None] * problem.dt)
    errors = np.array(residual(problem)(q.T, horizon.nominal.T)).T
    velocity = _powers(qdot / cost.delta_qdot, cost.p_in, cost.p_out) @ horizon.velocity_weights
    tracking = _powers(errors, 2.0, cost.p_x).sum(axis=-1)
    return float(h @ velocity + horizon.tracking_weights @ tracking)


def beyond_limits(problem: Problem, horizon: Horizon, q: FloatArray, braking: bool = False) -> dict[str, float]:
    """The largest violation of the limits of the model by a plan (K, n); below 0 within the limits.

    Of positions, velocities and accelerations. A change of velocity between blocks of a and b steps takes (a + b) / 2
    steps, and the first one a step. With ``braking`` the arm has to be able to stop within its joint limits behind the
    last knot.
    """
    arm, h = problem.model, horizon.lengths[:, None]
    qdot = np.diff(np.vstack([horizon.q, q]), axis=0) / (h * problem.dt)
    spans = np.vstack([np.ones((1, 1)), 0.5 * (h[:-1] + h[1:])])
    qddot = np.diff(np.vstack([horizon.qdot_before, qdot]), axis=0) / (spans * problem.dt)
    if braking:
        q = np.vstack([q, q[-1] + qdot[-1] * np.abs(qdot[-1]) / (2.0 * arm.acceleration_limit)])
    return {
        "position": float(np.max([q - arm.upper, arm.lower - q])),
        "velocity": float(np.max(np.abs(qdot) - problem.largest_qdot)),
        "acceleration": float(np.max(np.abs(qddot) - arm.acceleration_limit)),
    }


def _powers(x: FloatArray, inside: float, outside: float) -> FloatArray:
    r = np.abs(x)
    return np.asarray(np.where(r > 1.0, r**outside, r**inside))
