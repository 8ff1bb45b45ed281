"""The horizon problem for Crocoddyl: feasibility-driven differential dynamic programming (FDDP).

Crocoddyl has no residual for Varga's task coordinates and no activation for Φ^X, and its interface for new ones is
a class in Python. To do it as little wrong as possible, the arithmetic of a knot is one call of a compiled kernel;
what remains of Python is a call per knot, and the solver itself is Crocoddyl's C++.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import crocoddyl
import numpy as np

from baselines.policy import Problem
from benchmarks.rivals.numpy_horizon import Horizon, Plan, plan_cost
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import kernel
from ikgym.kernels.kinematics import forward, forward_and_jacobian
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class CrocoddylHorizon:
    """A horizon by FDDP with the Hessian of Gauss and Newton.

    The state is y = (q - q_0) / Δt and the control q̇, with y⁺ = y + h q̇; the tracking cost of a knot belongs to
    the action that leaves it, or to the end.

    Args:
        problem: Arm, task, cost and Δt.
        knots: K, the number of knots.
        iterations: Most iterations of a solve.
        tolerance: Where FDDP stops, its `th_stop`.
    """

    problem: Problem
    knots: int
    iterations: int = 450
    tolerance: float = 1e-9

    @functools.cached_property
    def _actions(self) -> list[Any]:
        return [_Action(self.problem) for _ in range(self.knots + 1)]

    @functools.cached_property
    def solver(self) -> Any:
        """Crocoddyl's solver, made once."""
        *running, end = self._actions
        solver = crocoddyl.SolverFDDP(crocoddyl.ShootingProblem(np.zeros(self.problem.model.joints), running, end))
        solver.th_stop = self.tolerance
        return solver

    def solve(self, horizon: Horizon, start: FloatArray | None = None) -> Plan:
        """The optimum from one state.

        Args:
            horizon: The state, of K knots.
            start: Where to begin: joint coordinates at the knots; at rest if left out. Shape (K, n).
        """
        n, h, w = self.problem.model.joints, horizon.lengths, horizon.tracking_weights
        for k, action in enumerate(self._actions):
            action.origin = horizon.q
            action.length = h[k] if k < self.knots else 0.0
            action.weight = w[k - 1] if k else 0.0
            action.nominal = horizon.nominal[max(k - 1, 0)]
        rest = np.tile(horizon.q, (self.knots, 1))
        y = np.vstack([np.zeros(n), ((rest if start is None else start) - horizon.q) / self.problem.dt])
        qdot = np.diff(y, axis=0) / h[:, None]
        converged = self.solver.solve(list(y), list(qdot), self.iterations, False)
        q = horizon.q + self.problem.dt * np.array(self.solver.xs)[1:]
        return Plan(q, plan_cost(self.problem, horizon, q), int(self.solver.iter), bool(converged))


class _Action(crocoddyl.ActionModelAbstract):  # type: ignore[misc]
    """A knot and the interval behind it; ``origin``, ``length``, ``weight`` and ``nominal`` belong to the state."""

    def __init__(self, problem: Problem) -> None:
        n = problem.model.joints
        super().__init__(crocoddyl.StateVector(n), n)
        self.given = problem.model.chain, problem.task.kind, problem.cost.parameters, problem.dt
        self.by_x, self.by_u, self.by_xx, self.by_uu = np.zeros(n), np.zeros(n), np.zeros((n, n)), np.zeros((n, n))
        self.origin, self.length, self.weight, self.nominal = np.zeros(n), 1.0, 1.0, np.zeros(problem.task.size)

    def calc(self, data: Any, x: FloatArray, u: FloatArray | None = None) -> None:
        """The next state and the cost."""
        data.xnext = x if u is None else x + self.length * u
        qdot, length = (self.origin, 0.0) if u is None else (u, self.length)
        data.cost = _cost(*self.given, self.origin, length, self.weight, self.nominal, x, qdot)

    def calcDiff(self, data: Any, x: FloatArray, u: FloatArray | None = None) -> None:  # noqa: N802  # Crocoddyl's name
        """Derivatives of both."""
        qdot, length = (self.origin, 0.0) if u is None else (u, self.length)
        _derivatives(
            *self.given, self.origin, length, self.weight, self.nominal, x, qdot,
            self.by_x, self.by_u, self.by_xx, self.by_uu,
        )  # fmt: skip
        data.Lx, data.Lxx = self.by_x, self.by_xx
        if u is not None:
            data.Lu, data.Luu = self.by_u, self.by_uu
            data.Fx, data.Fu = np.eye(len(x)), self.length * np.eye(len(x))


# Numbers and arrays one by one in both kernels: a call a knot, the time of which is compared, enters them from Python.
@kernel
def _cost(chain, kind, cost, dt, origin, length, weight, nominal, x, qdot):
    total = 0.0
    if length > 0.0:
        total += length * cost_kernels.velocity(cost, qdot)
    if weight > 0.0:
        rotation, position, pose = np.empty((3, 3)), np.empty(3), np.empty(nominal.shape[0])
        error = np.empty(task_kernels.error_size(kind, nominal.shape[0]))
        forward(chain, origin + dt * x, rotation, position)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.error(kind, nominal, pose, error)
        total += weight * cost_kernels.tracking(cost, error)
    return total


@kernel
def _derivatives(chain, kind, cost, dt, origin, length, weight, nominal, x, qdot, by_x, by_u, by_xx, by_uu):
    n = x.shape[0]
    by_x[:], by_u[:], by_xx[:], by_uu[:] = 0.0, 0.0, 0.0, 0.0
    if length > 0.0:
        curvature = np.empty(n)
        cost_kernels.velocity_gradient(cost, qdot, by_u)
        cost_kernels.velocity_curvature(cost, qdot, curvature)
        for j in range(n):
            by_u[j] *= length
            by_uu[j, j] = length * curvature[j]
    if weight > 0.0:
        e = task_kernels.error_size(kind, nominal.shape[0])
        rotation, position, geometric = np.empty((3, 3)), np.empty(3), np.empty((6, n))
        error, gradient, curvature = np.empty(e), np.empty(e), np.empty(e)
        pose, jacobian, by_q = np.empty(nominal.shape[0]), np.empty((e, n)), np.empty((e, n))
        forward_and_jacobian(chain, origin + dt * x, rotation, position, geometric)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.error(kind, nominal, pose, error)
        task_kernels.jacobian(kind, rotation, geometric, jacobian)
        task_kernels.error_jacobian(kind, nominal, pose, error, jacobian, by_q)
        cost_kernels.tracking_gradient(cost, error, gradient)
        cost_kernels.tracking_curvature(cost, error, curvature)
        for k in range(e):
            for i in range(n):
                by_x[i] += weight * dt * gradient[k] * by_q[k, i]
                for j in range(n):
                    by_xx[i, j] += weight * dt * dt * curvature[k] * by_q[k, i] * by_q[k, j]
