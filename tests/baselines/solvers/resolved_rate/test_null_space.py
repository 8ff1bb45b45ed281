"""The null space term: no task velocity, and the way to each of the three aims."""

import dataclasses

import numpy as np
import pytest

import baselines
import ikgym
from tests.baselines.solvers.resolved_rate.test_formulas import invert, jacobians, move, objective_gradient


def with_limits(scenario):
    n = scenario.joints
    arm = dataclasses.replace(scenario.arm, lower=np.linspace(-1, -3, n), upper=np.linspace(2, 4, n))
    return scenario.replace(arm=arm, model=arm)


@pytest.mark.parametrize(
    ("aim", "damping"), [({"objective": "posture", "posture": 0.7}, 0.0), ({"objective": "joint_centring"}, 1e-3)]
)
@pytest.mark.parametrize("name", ["varga7-fast", "khan8-q7q8", "zhang6-lspb"])
def test_changes_no_task_velocity(name, aim, damping):
    scenario = with_limits(ikgym.scenarios.get(name))
    gain = 1.0 / scenario.dt
    policy = baselines.make("null_space", scenario, secondary_gain=gain, damping=damping, **aim)
    without = baselines.make("null_space", scenario, secondary_gain=0.0, damping=damping, **aim)
    q = np.random.default_rng(0).uniform(-2, 2, (20, scenario.joints))
    rotation, _, geometric = scenario.model.forward_and_jacobian(q)
    jacobian = scenario.task.jacobian(rotation, geometric)
    shift = np.random.default_rng(1).normal(size=jacobian.shape[:2]) * 1e-3
    step, status = move(policy, q, jacobian, shift)
    plain, same = move(without, q, jacobian, shift)
    assert status.tolist() == same.tolist()
    aims = scenario.dt * gain * objective_gradient(policy, q)
    largest = np.linalg.norm(jacobian, 2, axis=(1, 2))
    for j, a, b, z, sigma in zip(jacobian, step, plain, aims, largest, strict=True):
        size = np.linalg.norm(z) + np.linalg.norm(b)
        np.testing.assert_allclose(j @ (a - b), 0.0, atol=1e-13 * sigma * size)
        # And what is added is the part of z in the null space.
        wanted = z - np.linalg.pinv(j, rcond=1e-12) @ (j @ z)
        np.testing.assert_allclose(a - b, wanted, atol=1e-10 * size)
    if name == "varga7-fast":
        assert np.linalg.norm(step - plain, axis=1).min() > 1e-6


def test_first_part_is_moore_penrose_or_dls():
    scenario = ikgym.scenarios.get("varga7-fast")
    jacobian, shift = jacobians(scenario)
    q = np.zeros((len(jacobian), 7))
    for other, damping in (("moore_penrose", 0.0), ("dls", 0.02)):
        mine, _ = move(baselines.make("null_space", scenario, damping=damping, secondary_gain=0.0), q, jacobian, shift)
        given = {"damping": damping} if damping else {}
        theirs, _ = invert(baselines.make(other, scenario, **given), jacobian, shift)
        np.testing.assert_array_equal(mine, theirs)


def test_centring_leaves_joints_without_limits_alone_and_a_posture_none():
    scenario = ikgym.scenarios.get("varga7-fast")
    lower, upper = np.full(7, -np.inf), np.full(7, np.inf)
    lower[[1, 4]], upper[[1, 4]], upper[2] = [-1.0, 0.0], [3.0, 2.0], 1.0
    arm = dataclasses.replace(scenario.arm, lower=lower, upper=upper)
    policy = baselines.make("null_space", scenario.replace(arm=arm, model=arm), objective="joint_centring")
    q = np.full((1, 7), 0.5)
    np.testing.assert_allclose(objective_gradient(policy, q)[0], [0, 0.5 * 0.25, 0, 0, 0.5, 0, 0])
    posture = baselines.make("null_space", scenario, objective="posture", posture=0.7)
    np.testing.assert_allclose(objective_gradient(posture, q)[0], 0.2)


def test_by_default_joints_with_limits_are_centred_and_others_go_to_0():
    free = ikgym.scenarios.get("varga7-fast")
    bounded = with_limits(free)
    half = free.replace(arm=free.arm.replace(lower=np.full(7, -np.inf), upper=np.full(7, 1.0)))
    q = np.random.default_rng(0).uniform(-1, 1, (3, 7))
    for scenario, parameters, old in [
        (free, {}, {"objective": "posture", "posture": 0.0}),
        (half, {}, {"objective": "posture", "posture": 0.0}),  # the other side is open
        (bounded, {}, {"objective": "joint_centring"}),
        (bounded, {"posture": 0.5}, {"objective": "posture", "posture": 0.5}),
    ]:
        new, wanted = (baselines.make("null_space", scenario, **given) for given in (parameters, old))
        assert new.parameters == wanted.parameters
        np.testing.assert_array_equal(objective_gradient(new, q), objective_gradient(wanted, q))
