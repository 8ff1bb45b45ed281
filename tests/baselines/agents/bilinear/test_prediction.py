"""What the reference ahead will ask of the joints at the postures where the arm will be then."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from baselines.agents.bilinear.prediction_kernels import FARTHEST, predicted_rate_rows
from baselines.agents.bilinear.processing import Bilinear
from baselines.training.gradients.law import Law
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.rl.twists import twist
from tests.baselines.agents.bilinear.test_bilinear import OFFSETS, ROWS, batch_of, problem_of

PREDICTED = Bilinear(OFFSETS, 1e-3, predicted_rates=True)
TWISTS = len(OFFSETS) - 1
CASES = [("varga7", "pose"), ("varga7", "position"), ("puma560", "matrix"), ("tiago", "axis")]


def rates_of(problem, features):
    return features[:, -TWISTS * problem.model.joints :].reshape(len(features), TWISTS, -1)


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
    features, here = PREDICTED.features(problem, batch), Bilinear(OFFSETS, 1e-3).features(problem, batch)
    own = TWISTS * problem.model.joints
    assert np.array_equal(features[:, :-own], here[:, :-own])
    _, speed = PREDICTED.due(problem, batch)
    wanted = 0.3 * np.diff(postures(problem, batch), axis=1) / (np.diff(OFFSETS)[:, None] * problem.dt)
    np.testing.assert_allclose(rates_of(problem, features), wanted / speed[:, None, None], rtol=2e-4, atol=1e-5)


def test_rates_towards_a_singularity_are_those_that_it_will_ask_for():
    """An elbow that is straightened evenly: its rate stays the same, which its Jacobian of now does not show."""
    problem = problem_of("planar2", "position").replace(dt=1e-3)
    offsets, rate = (1, 100, 200, 300, 400, 450), np.array([0.0, -2.0])
    way = np.array([0.0, 0.91]) + rate * problem.dt * np.array([0, *offsets])[:, None]
    poses, batch = problem.task.coordinates(*problem.model.forward(way)), batch_of(problem)
    batch = batch._replace(q=way[:1], pose=poses[:1], nominal=poses[None, 1:], remaining=np.array([[500.0]]))
    wrong = []
    for predicted in (True, False):
        processing = Bilinear(offsets, 1e-6, predicted_rates=predicted)
        _, speed = processing.due(problem, batch)
        rates = processing.features(problem, batch)[0, -10:].reshape(5, 2) * speed / 0.3
        wrong.append(np.linalg.norm(rates - rate, axis=1))
    assert (wrong[0] < wrong[1]).all()
    assert (wrong[0][1:] < 0.5 * wrong[1][1:]).all()  # the first interval begins at the posture of now


def test_a_turn_of_joint_1_changes_nothing():
    problem = problem_of()
    here, there = batch_of(problem), batch_of(problem, turned=0.8)
    np.testing.assert_allclose(PREDICTED.features(problem, there), PREDICTED.features(problem, here), atol=2e-5)


def test_an_arm_far_off_its_path_is_not_guessed_beyond_bounds():
    problem = problem_of()
    batch = batch_of(problem)
    far = batch._replace(nominal=batch.nominal + np.array([3.0, 0.0, 0.0, *np.zeros(batch.pose.shape[1] - 3)]))
    _, speed = PREDICTED.due(problem, far)
    rates = rates_of(problem, PREDICTED.features(problem, far)) * speed[:, None, None] / 0.3
    steps = rates * np.diff(OFFSETS)[:, None] * problem.dt
    assert np.abs(steps).max() == pytest.approx(FARTHEST, rel=1e-5)


def test_nan_is_not_taken_for_a_step():
    problem = problem_of()
    batch, chain, n = batch_of(problem), problem.model.chain, problem.model.joints
    batch.nominal[1, 1, 0] = np.nan
    out = np.zeros((ROWS, TWISTS * n))
    arrays = batch.q, batch.nominal, np.ones(ROWS), out, TWISTS
    predicted_rate_rows(problem.task.kind, chain, problem.dt, np.array(OFFSETS), *arrays)
    assert np.isnan(out[1]).all()
    assert np.isfinite(np.delete(out, 1, axis=0)).all()


def test_what_is_seen_has_no_gradient_and_what_is_done_has():
    scenario = scenarios.get("varga7-pose-random")
    law, problem = Law(scenario, PREDICTED), problem_of()
    batch = batch_of(problem)
    q = torch.from_numpy(batch.q).requires_grad_()
    features, speed = law.features(q, batch.nominal, batch.remaining)
    assert not features.requires_grad
    np.testing.assert_array_equal(features.numpy().astype(np.float32), PREDICTED.features(problem, batch))
    np.testing.assert_array_equal(speed, PREDICTED.due(problem, batch)[1])
    assert law.held(q, features, torch.zeros(ROWS, law.outputs, dtype=torch.float64)).requires_grad


def test_where_no_network_looks_what_an_inverse_needs_is_seen_alone():
    scenario, batch = scenarios.get("varga7-pose-random"), batch_of(problem_of())
    law, n = Law(scenario, PREDICTED), scenario.joints
    (features, speed), zeros = law.features(torch.from_numpy(batch.q), batch.nominal, batch.remaining), np.zeros(ROWS)
    some = np.full(features.shape, 7.0)
    law.see(batch.q, batch.nominal, batch.remaining, some, zeros, for_network=False)
    rest = law.inputs - (TWISTS - 1) * n
    np.testing.assert_array_equal(some[:, :rest], features[:, :rest])
    assert (some[:, rest:] == 7.0).all()
    np.testing.assert_array_equal(zeros, speed)
    q, output = torch.from_numpy(batch.q), torch.zeros(ROWS, law.outputs, dtype=torch.float64)
    assert torch.equal(law.held(q, torch.from_numpy(some), output), law.held(q, features, output))


def test_files():
    assert Bilinear.from_json(PREDICTED.to_json()) == PREDICTED
    assert "predicted_rates" not in Bilinear(OFFSETS, 1e-3).to_json()  # those of before


def test_without_an_inverse_nothing_is_predicted():
    with pytest.raises(InvalidInputError, match="damping: expected a number where joint rates are predicted, got None"):
        Bilinear(OFFSETS, predicted_rates=True)
    with pytest.raises(InvalidInputError, match="predicted_rates"):
        Bilinear(OFFSETS, 1e-3, predicted_rates="yes")
