"""Minima within limits of acceleration: between uneven knots against IPOPT's, and by hand; see test_limits, too."""

import dataclasses

import numpy as np
import pytest

import ikgym
from baselines.solvers.receding_horizon.newton.minimise import CONVERGED, STALLED
from tests.baselines.solvers.receding_horizon.newton.states import (
    draw,
    horizon_of,
    problem_of,
    solved,
)
from tests.independent.casadi_horizon import CasadiHorizon
from tests.independent.numpy_horizon import Horizon, beyond_limits


@pytest.mark.parametrize(("at", "braking"), [((1,), True), ((2, 5), False), ((1, 2, 4, 8, 15, 25), True)])
def test_optimum_between_uneven_knots_is_ipopts(at, braking):
    problem, rng = problem_of(), np.random.default_rng(len(at))
    solver = CasadiHorizon(problem, len(at), limited=True, braking=braking)
    for _ in range(2):
        weights = np.linspace(5.0, 1.0, 7)
        horizon = dataclasses.replace(horizon_of(problem, draw(rng), at=at), joint_weights=weights)
        best = solver.solve(horizon)
        minimum, path = solved(problem, horizon, braking=braking)
        assert best.converged
        assert minimum.outcome == CONVERGED
        assert minimum.cost == pytest.approx(best.cost, rel=1e-6)
        assert max(beyond_limits(problem, horizon, path, braking).values()) < 1e-9


# One joint that slides along x, 10 m/s² at most.
def slider(**limits):
    unlimited = {"lower": [-np.inf], "upper": [np.inf], "velocity_limit": [100.0], "acceleration_limit": [10.0]}
    return ikgym.Arm("slider", np.zeros((1, 3)), [[1.0, 0.0, 0.0]], (True,), **(unlimited | limits))


def goals(x, knots):
    nominal = np.zeros((knots, 3))
    nominal[:, 0] = x
    return nominal


def test_it_stops_before_the_end_of_its_joint():
    """With the goal beyond the limit the arm goes as fast as it can still stop, behind the last knot, too."""
    problem = problem_of(slider(upper=[0.03]), "position")
    horizon = Horizon(np.zeros(1), goals(0.05, 30), qdot=np.zeros(1))
    minimum, path = solved(problem, horizon)
    assert minimum.outcome == CONVERGED
    speed = (path[-1, 0] - path[-2, 0]) / 2e-3
    assert path[-1, 0] + speed**2 / 20.0 <= 0.03
    longer = Horizon(np.zeros(1), goals(0.05, 80), qdot=np.zeros(1))
    _, whole = solved(problem, longer)
    assert whole[-1, 0] == pytest.approx(0.03, abs=1e-6)
    assert (whole <= 0.03).all()
    without, blind = solved(problem, horizon, braking=False)
    assert without.cost < minimum.cost
    assert blind[-1, 0] + ((blind[-1, 0] - blind[-2, 0]) / 2e-3) ** 2 / 20.0 > 0.03


def test_where_limits_cannot_be_kept_it_says_so():
    """Too fast to stop in time."""
    problem = problem_of(slider(upper=[0.01]), "position")
    horizon = Horizon(np.zeros(1), goals(0.0, 10), qdot=np.full(1, 2.0))
    minimum, path = solved(problem, horizon)
    assert minimum.outcome == STALLED
    assert np.isfinite(path).all()
    assert max(beyond_limits(problem, horizon, path).values()) > 0.0
