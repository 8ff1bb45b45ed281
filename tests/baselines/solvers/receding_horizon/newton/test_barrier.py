"""The barrier function: its derivatives by differences, and the terms that it is made of by plain NumPy."""

import numpy as np
import pytest

from baselines.solvers.receding_horizon.newton.barrier import ANEW, Barrier, linearise, merit
from baselines.solvers.receding_horizon.newton.cost import true_cost
from baselines.solvers.receding_horizon.newton.workspace import newton_workspace
from tests.baselines.solvers.receding_horizon.newton.states import (
    draw,
    horizon_of,
    path_problem,
    problem_of,
)
from tests.baselines.solvers.receding_horizon.newton.test_cost import dense, differences

BARRIER = Barrier(30.0, 200.0)


def place(at=(1, 2, 4, 7), task="pose", braking=True, **changes):
    """A path near a nominal one, half of it beyond its limits; and what the kernels are handed."""
    rng = np.random.default_rng(len(at))
    problem = problem_of(task=task)
    horizon = horizon_of(problem, draw(rng), at=at)
    here = path_problem(problem, horizon, braking)
    change = here.change_limit * np.array([1, 1, np.inf, 1, 1, 1, 1])  # a joint without a limit of acceleration
    here = here._replace(change_limit=change, **changes)
    path = horizon.q + np.cumsum(rng.normal(size=(len(at), 7)) * 2e-3 * here.grid.length[:, None], axis=0)
    return here, path, newton_workspace(here.data.kind, here.nominal.shape[1], *path.shape, True)


@pytest.mark.parametrize(
    ("task", "at", "braking"),
    [
        *(("pose", (1,), True), ("pose", (3, 5, 6), False), ("pose", (1, 2, 4, 7), True)),
        *(("position", (1,), False), ("position", (3, 5, 6), True), ("position", (1, 2, 4, 7), False)),
    ],
)
def test_derivatives_against_central_differences(at, task, braking):
    load = np.linspace(1e-3, 2e-3, 7) * (np.arange(len(at))[:, None] >= 2)  # from the third knot on
    problem, path, workspace = place(at, task, braking, load=load)
    model = workspace.model
    value = linearise(problem, path, BARRIER, ANEW, False, workspace)
    assert value == pytest.approx(merit(problem, path, BARRIER, workspace), rel=1e-12)
    central = differences(lambda x: merit(problem, x, BARRIER, workspace), path, 1e-8).reshape(path.shape)
    np.testing.assert_allclose(model.gradient, central, atol=1e-5 * abs(central).max())

    def slope(x):
        linearise(problem, x, BARRIER, ANEW, True, workspace)
        return model.gradient.ravel().copy()

    central = differences(slope, path, 1e-7)
    linearise(problem, path, BARRIER, ANEW, True, workspace)
    wrong = dense(model, far=True) - central
    if braking:  # left out where it is concave: between the last two knots, joint by joint
        for rows in (slice(-7, None), slice(-14, -7))[: len(at)]:
            for columns in (slice(-7, None), slice(-14, -7))[: len(at)]:
                left_out = np.diagonal(wrong[rows, columns])
                assert (left_out * (1.0 if rows == columns else -1.0) >= -1e-4 * abs(central).max()).all()
                wrong[rows, columns] -= np.diag(left_out)
    # The second derivatives of a pose are those of small rotations.
    np.testing.assert_allclose(wrong, 0.0, atol=(1e-5 if task == "position" else 1e-2) * abs(central).max())


@pytest.mark.parametrize("at", [(1, 2, 4, 7)])
def test_it_tends_to_the_cost_and_the_weighted_excess(at):
    """With μ to 0 what is left is the cost and w times all that is beyond a limit."""
    problem, path, workspace = place(at, braking=False)
    barrier = Barrier(1e-12, 50.0)
    excess = (merit(problem, path, barrier, workspace) - true_cost(problem, path, workspace)) / 50.0
    arm, h = problem_of().model, problem.grid.length[:, None] * problem.data.dt
    qdot = np.diff(np.vstack([problem.start, path]), axis=0) / h
    spans = np.vstack([[problem.data.dt], 0.5 * (h[:-1] + h[1:])])
    qddot = np.diff(np.vstack([problem.qdot_before, qdot]), axis=0) / spans
    limit = arm.acceleration_limit * np.array([1, 1, np.inf, 1, 1, 1, 1])
    beyond = np.maximum(abs(qdot) / arm.velocity_limit - 1.0, 0.0).sum()
    beyond += np.maximum(abs(qddot) / limit - 1.0, 0.0).sum()
    step = problem.data.dt * arm.velocity_limit
    beyond += (np.maximum(np.maximum(path - arm.upper, arm.lower - path), 0.0) / step).sum()
    assert excess == pytest.approx(beyond, rel=1e-9)
    assert beyond > 0.1
