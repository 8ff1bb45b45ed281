"""Joint rates that the reference ahead requires at predicted postures, and the law that uses them."""

import numpy as np
import pytest

from baselines.agents.bilinear.features import FARTHEST, metric_rows, rate_rows
from baselines.agents.bilinear.kernels import held_rows
from baselines.agents.bilinear.processing import Bilinear
from ikgym.rl.twists import twist
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, ROWS, batch_of, features, problem_of, qdot
from tests.baselines.random_agents import network, nothing_held

DAMPED = Bilinear(OFFSETS, 1e-3)
TWISTS = len(OFFSETS) - 1
CASES = [("varga7", "pose"), ("varga7", "position"), ("puma560", "matrix"), ("tiago", "axis")]


def rates_of(problem, batch):
    """Joint rates in [rad/s] or [m/s]. Shape (B, p - 1, n)."""
    speed = np.empty(len(batch.q))
    seen = features(problem, batch, speed)[:, -TWISTS * problem.model.joints :]
    return seen.reshape(len(seen), TWISTS, -1) * speed[:, None, None] / 0.3


def postures(problem, batch):
    """Joint coordinates at the offsets, by damped least squares from one reference pose to the next. (ROWS, p, n)."""
    w, found = 3 if problem.task.name == "position" else 6, []
    for row in range(ROWS):
        q = batch.q[row].copy()
        for nominal in batch.nominal[row]:
            pose, due = problem.task.coordinates(*problem.model.forward(q[None])), np.empty(w)
            twist(problem.task.kind, nominal, pose[0], np.empty(6), due)
            jacobian = problem.model.jacobian(q[None])[0, :w]
            q = q + np.linalg.solve(jacobian @ jacobian.T + 1e-2 * np.eye(w), due) @ jacobian
            found.append(q)
    return np.reshape(found, (ROWS, len(OFFSETS), -1))


@pytest.mark.parametrize(("arm", "task"), CASES)
def test_rates_are_those_between_predicted_postures(arm, task):
    problem = problem_of(arm, task)
    batch = batch_of(problem)
    wanted = np.diff(postures(problem, batch), axis=1) / (np.diff(OFFSETS)[:, None] * problem.dt)
    found = rates_of(problem, batch)
    np.testing.assert_allclose(found, wanted, rtol=2e-4, atol=1e-5 * np.abs(wanted).max())


def test_steps_are_bounded_far_off_the_path():
    problem = problem_of()
    batch = batch_of(problem)
    far = batch._replace(nominal=batch.nominal + np.array([3.0, 0.0, 0.0, *np.zeros(batch.pose.shape[1] - 3)]))
    steps = rates_of(problem, far) * np.diff(OFFSETS)[:, None] * problem.dt
    assert np.abs(steps).max() == pytest.approx(FARTHEST, rel=1e-5)


def test_nan_is_not_taken_for_a_step():
    problem = problem_of()
    batch, n = batch_of(problem), problem.model.joints
    batch.nominal[1, 1, 0] = np.nan
    out = np.zeros((ROWS, TWISTS * n))
    arrays = batch.q, batch.nominal, np.ones(ROWS), out
    rate_rows(problem.task.kind, problem.model.chain, problem.dt, np.array(OFFSETS), *arrays)
    assert np.isnan(out[1]).all()
    assert np.isfinite(np.delete(out, 1, axis=0)).all()


@pytest.mark.parametrize(("arm", "task"), CASES)
def test_one_call_is_the_parts_of_the_law(arm, task):
    """Features, network, metric, inverse and action, bit for bit."""
    problem = problem_of(arm, task)
    batch, kind, chain = batch_of(problem), problem.task.kind, problem.model.chain
    net = network((DAMPED.size(problem), 16, DAMPED.outputs(problem)))
    seen = features(problem, batch)
    output, held = net.forward(seen), np.empty((ROWS, DAMPED.held(problem)))
    metric_rows(kind, chain.prismatic, TWISTS, seen, output)
    held_rows(kind, chain, DAMPED.damping, batch.q, output, held)
    found = DAMPED.act(problem, batch, net, 1, nothing_held(DAMPED, problem, ROWS))
    np.testing.assert_allclose(found, qdot(problem, batch, held) / problem.velocity_limit, rtol=1e-15)
    assert np.ptp(found) > 0.0
