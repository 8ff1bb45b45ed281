"""The damped inverse of a bilinear agent, and joint rates that the reference ahead requires at predicted postures."""

import numpy as np
import pytest

from baselines.agents.bilinear.features import FARTHEST, metric_rows, rate_rows
from baselines.agents.bilinear.kernels import gain_rows
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.network import Network
from ikgym.rl.twists import twist
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, ROWS, batch_of, features, outputs, problem_of, qdot
from tests.baselines.random_agents import network, nothing_held

DAMPING = 4e-3
DAMPED = Bilinear(OFFSETS, DAMPING)
TWISTS = len(OFFSETS) - 1
CASES = [("varga7", "pose"), ("varga7", "position"), ("puma560", "matrix"), ("tiago", "axis")]


def held(problem, q, output):
    out = np.empty((len(q), DAMPED.held_size(problem)))
    gain_rows(problem.task.kind, problem.model.chain, DAMPING, q, output, out)
    return out


def output_of(problem, scale=0.5):
    size = DAMPED.outputs(problem)
    return np.random.default_rng(1).normal(scale=scale, size=(ROWS, size))


@pytest.mark.parametrize(("arm", "task"), CASES)
def test_it_is_the_weighted_damped_inverse(arm, task):
    """In numpy, at joint coordinates of which the first is 0 where twists are seen from its frame."""
    problem = problem_of(arm, task)
    n, output, q = problem.model.joints, output_of(problem), batch_of(problem).q
    w = 3 if task == "position" else 6
    seen = q.copy()
    if arm != "tiago":  # whose joint 1 is prismatic
        seen[:, 0] = 0.0
    jacobian = problem.model.jacobian(seen)[:, :w]
    given = held(problem, q, output).reshape(ROWS, n, w + 1)
    for row in range(ROWS):
        j, metric = jacobian[row], np.diag(np.exp(output[row, n * (w + 1) + 1 :]))
        lambda_ = DAMPING * np.exp(output[row, n * (w + 1)])
        wanted = output[row, : n * (w + 1)].reshape(n, w + 1).copy()
        wanted[:, :w] += metric @ j.T @ np.linalg.inv(j @ metric @ j.T + lambda_ * np.eye(w))
        wanted[:, w] = (np.eye(n) - wanted[:, :w] @ j) @ wanted[:, w]
        np.testing.assert_allclose(given[row], wanted, rtol=1e-8, atol=1e-9)


def test_logarithms_are_cut():
    """Whatever the network says, there is an inverse."""
    problem = problem_of()
    q, output, n = batch_of(problem).q, output_of(problem), problem.model.joints
    output[:, 7 * n :] = [-900.0] + [900.0] * n
    assert np.isfinite(held(problem, q, output)).all()
    output[0, 0] = np.nan
    assert np.isnan(held(problem, q, output)[0]).any()


def test_an_untrained_network_is_damped_least_squares():
    """An output of 0 removes nearly all of a small error, without having learned the arm; nothing does not."""
    problem = problem_of("varga7", "pose")
    arm, batch = problem.model, batch_of(problem)
    near = batch.q + np.random.default_rng(2).normal(scale=1e-4, size=batch.q.shape)
    batch = batch._replace(nominal=np.stack([problem.task.coordinates(*arm.forward(near))] * 3, 1))
    sizes = DAMPED.size(problem), DAMPED.outputs(problem)
    net = Network((np.zeros(sizes[::-1]),), (np.zeros(sizes[1]),), "silu", "linear")
    actions = DAMPED.act(problem, batch, net, 1, nothing_held(DAMPED, problem, len(batch.q)))
    moved = batch.q + problem.dt * actions * problem.velocity_limit
    after = problem.task.error(batch.nominal[:, 0], problem.task.coordinates(*arm.forward(moved)))
    before = problem.task.error(batch.nominal[:, 0], batch.pose)
    assert np.median(np.abs(after).max(1) / np.abs(before).max(1)) < 0.1
    assert not qdot(problem, batch, np.zeros_like(outputs(problem))).any()


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
    output, held = net.forward(seen), np.empty((ROWS, DAMPED.held_size(problem)))
    metric_rows(kind, chain.prismatic, TWISTS, seen, output)
    gain_rows(kind, chain, DAMPED.damping, batch.q, output, held)
    found = DAMPED.act(problem, batch, net, 1, nothing_held(DAMPED, problem, ROWS))
    np.testing.assert_allclose(found, qdot(problem, batch, held) / problem.velocity_limit, rtol=1e-15)
    assert np.ptp(found) > 0.0
