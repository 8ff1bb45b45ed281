"""The damped inverse of a bilinear agent."""

import numpy as np
import pytest

from baselines.agents.bilinear.kernels import held_rows
from baselines.agents.bilinear.processing import Bilinear
from baselines.agents.network import Network
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, ROWS, batch_of, outputs, problem_of, qdot
from tests.baselines.random_agents import nothing_held

DAMPING = 4e-3
DAMPED = Bilinear(OFFSETS, DAMPING)
CASES = [("varga7", "pose"), ("varga7", "position"), ("puma560", "matrix"), ("tiago", "axis")]


def held(problem, q, output):
    out = np.empty((len(q), DAMPED.held(problem)))
    held_rows(problem.task.kind, problem.model.chain, DAMPING, q, output, out)
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
