"""What twists ahead would ask of the joints, and the metric that begins with it."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines.agents.bilinear.damped_kernels import LARGEST, held_rows
from baselines.agents.bilinear.processing import Bilinear, held
from baselines.agents.bilinear.rate_kernels import metric_rows
from baselines.training.gradients.law import Law
from ikgym import scenarios, tasks
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, ROWS, batch_of, problem_of

DAMPED = Bilinear(OFFSETS, 1e-3)
TWISTS = len(OFFSETS) - 1
CASES = [("varga7", "pose"), ("varga7", "position"), ("puma560", "matrix"), ("tiago", "axis")]


def seen_jacobian(problem, q):
    """That of the twist, at joint coordinates of which the first is 0 where twists are seen from its frame."""
    seen = q.copy()
    if problem.model.name != "tiago":  # whose joint 1 is prismatic
        seen[:, 0] = 0.0
    return problem.model.jacobian(seen)[:, : 3 if problem.task.name == "position" else 6]


def rates_of(problem, features):
    return features[:, -TWISTS * problem.model.joints :].reshape(len(features), TWISTS, -1)


@pytest.mark.parametrize(("arm", "task"), CASES)
def test_rates_are_damped_least_squares(arm, task):
    problem = problem_of(arm, task)
    batch, n = batch_of(problem), problem.model.joints
    features = DAMPED.features(problem, batch)
    plain = Bilinear(OFFSETS).features(problem, batch)
    assert np.array_equal(features[:, : -TWISTS * n], plain)
    jacobian = seen_jacobian(problem, batch.q)
    twists = plain[:, -2 - TWISTS * jacobian.shape[1] : -2].reshape(ROWS, TWISTS, -1)
    for row in range(ROWS):
        j = jacobian[row]
        wanted = 0.3 * twists[row] @ np.linalg.inv(j @ j.T + 1e-2 * np.eye(len(j))) @ j
        np.testing.assert_allclose(rates_of(problem, features)[row], wanted, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("name", ["varga7-random", "panda-random", "tiago-circle"])
def test_gradients_through_the_law(name):
    """Of features and of (G, h), against central differences."""
    scenario = scenarios.get(name)
    scenario = scenario.replace(task=tasks.get("pose"))
    law, rng = Law(scenario, DAMPED), np.random.default_rng(0)
    q = torch.from_numpy(rng.uniform(-1.0, 1.0, (ROWS, scenario.joints)))
    near = q[:, None].numpy() + 0.05 * rng.normal(size=(ROWS, len(OFFSETS), scenario.joints))
    nominal = scenario.task.coordinates(*scenario.model.forward(near))
    remaining = np.full((ROWS, 1), 100.0)
    output = torch.from_numpy(rng.normal(scale=0.3, size=(ROWS, law.outputs)))
    of_features = torch.from_numpy(rng.normal(size=(ROWS, law.inputs)))
    of_held = torch.from_numpy(rng.normal(size=(ROWS, scenario.joints * 7)))

    def value(q):
        features, _ = law.features(q, nominal, remaining)
        return (features * of_features).sum(1) + (law.held(q, features, output) * of_held).sum(1)

    at = q.clone().requires_grad_()
    (given,) = torch.autograd.grad(value(at).sum(), at)
    for j in range(scenario.joints):
        step = torch.zeros_like(q)
        step[:, j] = 1e-6
        wanted = (value(q + step) - value(q - step)) / 2e-6
        torch.testing.assert_close(given[:, j], wanted, rtol=1e-5, atol=1e-5 * float(given.abs().max()))


def test_training_and_playing_have_one_metric():
    """(G, h) of the training in float64, and of the kernels that play."""
    scenario = scenarios.get("varga7-pose-random")
    law, problem = Law(scenario, DAMPED), problem_of()
    batch, rng = batch_of(problem), np.random.default_rng(1)
    output = rng.normal(scale=0.3, size=(ROWS, law.outputs))
    features, _ = law.features(torch.from_numpy(batch.q), batch.nominal, batch.remaining)
    with_metric, played = output.copy(), np.empty((ROWS, 49))
    metric_rows(problem.task.kind, problem.model.chain.prismatic, TWISTS, features.numpy(), with_metric)
    assert (with_metric[:, :-7] == output[:, :-7]).all()
    assert np.ptp(with_metric[:, -7:] - output[:, -7:]) > 0.1
    held_rows(problem.task.kind, problem.model.chain, DAMPED.damping, batch.q, with_metric, played)
    trained = law.held(torch.from_numpy(batch.q), features, torch.from_numpy(output)).numpy()
    np.testing.assert_allclose(trained, played, rtol=1e-9, atol=1e-12)


def test_the_metric_spares_fast_joints():
    """What costs, the sum of fourth powers, is less than that of least squares, for the same twists."""
    problem, ratios = problem_of("varga7", "pose"), []
    for seed in range(20):
        batch = batch_of(problem, seed)
        features, output = DAMPED.features(problem, batch), np.zeros((ROWS, DAMPED.outputs(problem)))
        output[:, 49] = -LARGEST
        metric_rows(problem.task.kind, problem.model.chain.prismatic, TWISTS, features, output)
        of_metric = held(problem, 1e-3, batch.q, output).reshape(ROWS, 7, 7)[:, :, :6]
        output[:, 50:] = 0.0
        of_least_squares = held(problem, 1e-3, batch.q, output).reshape(ROWS, 7, 7)[:, :, :6]
        twist = features[:, 11:17, None]
        costs = [((matrix @ twist) ** 4).sum((1, 2)) for matrix in (of_metric, of_least_squares)]
        ratios.append(costs[0] / costs[1])
    assert np.median(ratios) < 0.995
    assert np.quantile(ratios, 0.1) < 0.95
    assert np.quantile(ratios, 0.9) < 1.05


def test_nothing_due_gives_a_metric_all_the_same():
    """An arm that stands at the end of its path."""
    problem = problem_of()
    batch = batch_of(problem)
    batch = batch._replace(nominal=np.repeat(batch.pose[:, None], len(OFFSETS), 1))
    action = DAMPED.action(problem, batch, np.zeros((ROWS, DAMPED.outputs(problem))))
    np.testing.assert_allclose(action, 0.0, atol=1e-9)
