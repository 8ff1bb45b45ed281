"""The horizon problem for IPOPT, through CasADi: an independent optimiser of the same cost."""

from __future__ import annotations

import dataclasses
import functools
from typing import Any

import casadi
import numpy as np

from baselines.policy import Problem
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray
from tests.independent.casadi_kinematics import residual
from tests.independent.numpy_horizon import Horizon, Plan, plan_cost

#: Below a tolerance of 1e-10 IPOPT often does not detect convergence, and uses up its iterations;
#: scaled by the gradient it finds its way from a far start in a fraction of the iterations.
OPTIONS: dict[str, Any] = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-10,
    "ipopt.constr_viol_tol": 1e-12,
    "ipopt.compl_inf_tol": 1e-10,
    "ipopt.dual_inf_tol": 1e-8,
    "ipopt.acceptable_iter": 0,
    "ipopt.bound_relax_factor": 0.0,
    "ipopt.nlp_scaling_method": "gradient-based",
    "ipopt.mu_strategy": "adaptive",
    "ipopt.max_iter": 1000,
}


@dataclasses.dataclass(frozen=True, eq=False)
class CasadiHorizon:
    """The optimum of a horizon by an interior point method.

    Φ^X has a kink where |r| = 1 with r = error / Δx: it is the larger of r² and |r|^P, so that a variable t above
    r², r^P and -r^P makes the problem smooth without changing its optimum. Joint coordinates count from the start
    in units of Δt, where all is of order 1.

    Args:
        problem: Arm, task, cost and Δt.
        knots: K, the number of knots.
        limited: Whether the limits of position, velocity and acceleration count.
        braking: Whether the arm has to be able to stop within its joint limits behind the last knot, too.
        rate_weight: Weight of the squared changes of joint velocity, each over the time steps between the two.
        options: Of CasADi's `nlpsol`, over those of :data:`OPTIONS`.

    Raises:
        InvalidInputError: The cost has exponents that this form cannot express: P_X must be a whole number of at
            least 2, P_in = P_out an even number.
    """

    problem: Problem
    knots: int
    limited: bool = False
    braking: bool = False
    rate_weight: float = 0.0
    options: dict[str, Any] = dataclasses.field(default_factory=dict)

    def __post_init__(self) -> None:
        cost = self.problem.cost
        if cost.p_x < 2 or cost.p_x % 1:
            raise InvalidInputError(f"p_x: expected a whole number of at least 2, got {cost.p_x:g}.")
        if cost.p_in != cost.p_out or cost.p_in < 2 or cost.p_in % 2:
            raise InvalidInputError(
                f"p_in and p_out: expected the same even number, so that Φ^U is smooth, got {cost.p_in:g} and "
                f"{cost.p_out:g}."
            )

    @functools.cached_property
    def solver(self) -> Any:
        """The compiled problem, made once: variables y, t; parameters q_0, nominal, h, w, q̇ before, joint weights."""
        problem, knots = self.problem, self.knots
        n, m, e = problem.model.joints, problem.task.size, problem.task.error_size
        y, t = casadi.SX.sym("y", n, knots), casadi.SX.sym("t", e, knots)
        start, nominal = casadi.SX.sym("q", n), casadi.SX.sym("nominal", m, knots)
        h, w, before = casadi.SX.sym("h", knots), casadi.SX.sym("w", knots), casadi.SX.sym("qdot", n)
        weights, error = casadi.SX.sym("weights", n), residual(problem)
        cost, power = casadi.SX(0), int(problem.cost.p_x)
        above, last, length = [], before, casadi.SX(1)
        for k in range(knots):
            qdot = (y[:, k] - (y[:, k - 1] if k else 0.0)) / h[k]
            cost += h[k] * casadi.dot(weights, (qdot / problem.cost.delta_qdot) ** int(problem.cost.p_in))
            cost += w[k] * casadi.sum1(t[:, k])
            cost += self.rate_weight * casadi.sumsqr(qdot - last) / (0.5 * (length + h[k]))
            last, length = qdot, h[k]
            r = error(start + problem.dt * y[:, k], nominal[:, k])
            above.append(t[:, k] - r**2)
            if power > 2:
                above += [t[:, k] - r**power, t[:, k] + r**power] if power % 2 else [t[:, k] - r**power]
        if self.limited:
            above += self._room(start, y, h, before)
        nlp = {
            "x": casadi.vertcat(casadi.vec(y), casadi.vec(t)),
            "p": casadi.vertcat(start, casadi.vec(nominal), h, w, before, weights),
            "f": cost,
            "g": casadi.vertcat(*above),
        }
        return casadi.nlpsol("horizon", "ipopt", nlp, {**OPTIONS, **self.options})

    def _room(self, start: Any, y: Any, h: Any, before: Any) -> list[Any]:
        """The slacks of the limits, which must not be negative; see :func:`numpy_horizon.beyond_limits`."""
        problem, arm, knots = self.problem, self.problem.model, self.knots
        out, fastest, here = [], casadi.DM(problem.largest_qdot), casadi.SX.zeros(arm.joints)
        for k in range(knots):
            qdot, q = (y[:, k] - here) / h[k], start + problem.dt * y[:, k]
            most = problem.dt * casadi.DM(arm.acceleration_limit) * (0.5 * (h[k - 1] + h[k]) if k else 1.0)
            change = qdot - before
            out += [fastest - qdot, fastest + qdot, most - change, most + change]
            if self.braking and k == knots - 1:
                q += qdot * casadi.fabs(qdot) / (2.0 * casadi.DM(arm.acceleration_limit))
            out += [(arm.upper - q) / problem.dt, (q - arm.lower) / problem.dt]
            before, here = qdot, y[:, k]
        return out

    def solve(self, horizon: Horizon, start: FloatArray | None = None) -> Plan:
        """The optimum from one state, begun at joint coordinates (K, n) at the knots, or at rest."""
        problem = self.problem
        rest = np.tile(horizon.q, (self.knots, 1))
        y = ((rest if start is None else start) - horizon.q) / problem.dt
        r = np.array(residual(problem)(horizon.q[:, None] + problem.dt * y.T, horizon.nominal.T))
        t = np.maximum(r**2, np.abs(r) ** problem.cost.p_x)
        answer = self.solver(
            x0=np.concatenate([y.ravel(), t.T.ravel()]),
            p=np.concatenate(
                [
                    *(horizon.q, horizon.nominal.ravel(), horizon.lengths, horizon.tracking_weights),
                    *(horizon.qdot_before, horizon.velocity_weights),
                ]
            ),
            lbg=0.0,
            ubg=np.inf,
        )
        stats = self.solver.stats()
        q = horizon.q + problem.dt * np.array(answer["x"])[: y.size, 0].reshape(y.shape)
        return Plan(q, plan_cost(problem, horizon, q), int(stats["iter_count"]), bool(stats["success"]))
