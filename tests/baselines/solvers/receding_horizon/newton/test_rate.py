"""Changes of velocity: derivatives of their cost, and IPOPT."""

import dataclasses

import casadi
import numpy as np
import pytest

import baselines
import ikgym
from benchmarks.rivals.casadi_horizon import OPTIONS
from benchmarks.rivals.casadi_kinematics import residual
from tests.baselines.solvers.receding_horizon.newton.problems import Place, place
from tests.baselines.solvers.receding_horizon.newton.test_cost import dense, differences
from tests.baselines.solvers.receding_horizon.test_rhc import planned, states_near

WEIGHT = 0.3


@dataclasses.dataclass
class RatedPlace(Place):
    """A path whose changes of velocity cost something."""

    @property
    def problem(self):
        before = np.linspace(-1.0, 1.0, len(self.start))
        return super().problem._replace(qdot_before=before, rate_weight=WEIGHT)


def rated(**parameters):
    return RatedPlace(**vars(place("varga7", "skew", **parameters)))


@pytest.mark.parametrize("at", [(1,), (1, 2), (1, 2, 4, 7, 12)])
def test_derivatives_against_central_differences(at):
    here = rated(at=at)
    (value, _, _), blocks = here.linearise()
    assert value == pytest.approx(here.merit(), rel=1e-13)
    central = differences(here.merit, here.path, 1e-8).reshape(blocks.gradient.shape)
    np.testing.assert_allclose(blocks.gradient, central, atol=1e-6 * abs(central).max())
    central = differences(lambda path: here.linearise(path)[1].gradient.ravel(), here.path, 1e-8)
    np.testing.assert_allclose(dense(blocks, far=True), central, atol=1e-5 * abs(central).max())


def ipopt(policy, horizon, qdot, start):
    """The cheapest plan with changes of velocity, by IPOPT from a plan; its cost, changes apart."""
    problem, knots, h = policy.problem, horizon.knots, horizon.lengths
    n, e, cost = problem.model.joints, problem.task.error_size, problem.cost
    y, t = casadi.SX.sym("y", n, knots), casadi.SX.sym("t", e, knots)
    error, before, length = residual(problem), casadi.DM(qdot), 1.0
    total, above = casadi.SX(0), []
    for k in range(knots):
        speed = (y[:, k] - (y[:, k - 1] if k else 0.0)) / h[k]
        total += h[k] * casadi.sum1((speed / cost.delta_qdot) ** 4)
        total += horizon.tracking_weights[k] * casadi.sum1(t[:, k])
        total += policy.rate_weight * casadi.sumsqr(speed - before) / (0.5 * (length + h[k]))
        before, length = speed, h[k]
        r = error(horizon.q + problem.dt * y[:, k], horizon.nominal[k])
        above += [t[:, k] - r**2, t[:, k] - r**3, t[:, k] + r**3]
    nlp = {"x": casadi.vertcat(casadi.vec(y), casadi.vec(t)), "f": total, "g": casadi.vertcat(*above)}
    solver = casadi.nlpsol("rated", "ipopt", nlp, OPTIONS)
    first = (start - horizon.q) / problem.dt
    r = np.array(error(start.T, horizon.nominal.T))
    answer = solver(x0=np.concatenate([first.ravel(), np.maximum(r**2, abs(r) ** 3).T.ravel()]), lbg=0.0, ubg=np.inf)
    assert solver.stats()["success"]
    return float(answer["f"])


@pytest.mark.parametrize("parameters", [{"horizon": 8}, {"horizon": 31, "move_blocks": 8}])
def test_plans_are_as_cheap_as_ipopts(parameters):
    scenario = ikgym.scenarios.get("varga7-fast")
    policy = baselines.make("rhc", scenario, rate_weight=5.0, **parameters)
    q, nominal = states_near(scenario, policy.preview, 3, 1e-2)
    qdot = np.random.default_rng(1).normal(size=q.shape)
    costs, horizons, plans, _ = planned(policy, q, nominal, qdot=qdot)
    for cost, horizon, plan, before in zip(costs, horizons, plans, qdot, strict=True):
        speeds = np.diff(np.vstack([horizon.q, plan]), axis=0) / (horizon.lengths[:, None] * scenario.dt)
        changes = np.diff(np.vstack([before, speeds]), axis=0)
        spans = 0.5 * (horizon.lengths + np.append(1.0, horizon.lengths[:-1]))
        cost += policy.rate_weight * np.sum(changes**2 / spans[:, None])
        assert cost == pytest.approx(ipopt(policy, horizon, before, plan), rel=1e-6)
