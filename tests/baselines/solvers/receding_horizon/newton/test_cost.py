"""The cost of a path against the environment's, its derivatives against central differences."""

import itertools

import numpy as np
import pytest

import ikgym
from baselines.solvers.receding_horizon.horizon import HorizonModel
from baselines.solvers.receding_horizon.newton.cost import true_cost
from baselines.solvers.receding_horizon.newton.second_order import second_order
from baselines.solvers.receding_horizon.newton.workspace import knot_workspace
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.kinematics import forward_and_jacobian
from tests.baselines.solvers.receding_horizon.data import horizon_cost
from tests.baselines.solvers.receding_horizon.newton.problems import place

ARMS = ["varga7_literal", "tiago", "zhang3"]
every_task = pytest.mark.parametrize(("task", "arm"), list(zip(ikgym.tasks.names(), itertools.cycle(ARMS))))


def scale_of(task):
    """Δx: the second derivatives of the rotation error of a pose, or of an axis, are those of a small one."""
    return 1e-4 if task in ("pose", "axis") else 1e-3


def symmetric(lower):
    return np.tril(lower) + np.swapaxes(np.tril(lower, -1), -1, -2)


def dense(blocks, second=True, far=False):
    """The Hessian of the blocks, with those two away from the diagonal where they count. Shape (K n, K n)."""
    knots, n = blocks.gradient.shape
    out = np.zeros((knots, n, knots, n))
    for k in range(knots):
        out[k, :, k] = symmetric(blocks.diagonal[k]) + (symmetric(blocks.second[k]) if second else 0.0)
        if k > 0:
            out[k, :, k - 1] = out[k - 1, :, k] = -np.diag(blocks.coupling[k])
        if far and k > 1:
            out[k, :, k - 2] = out[k - 2, :, k] = np.diag(blocks.far[k])
    return out.reshape(knots * n, knots * n)


def differences(function, path, step):
    """Central differences by the joint coordinates of all knots, their axis last."""
    columns = []
    for index in np.ndindex(path.shape):
        up, down = path.copy(), path.copy()
        up[index] += step
        down[index] -= step
        columns.append((function(up) - function(down)) / (2.0 * step))
    return np.stack(columns, axis=-1)


def everything_plays(at):
    """Whether kinks are held, pressed on and passed, and both limits pressed on and not, so that no term is idle."""
    e, n, moved = at.error_size, len(at.start), at.multipliers.copy()
    at.linearise(advance=True)
    held, at.multipliers = at.multipliers.copy(), moved
    kinks, speeds, joints = abs(held[:, :e]), held[:, e : e + n], held[:, e + n :]
    return (
        {0.0, 1.0} <= set(kinks.ravel())
        and (speeds != 0.0).any()
        and (speeds == 0.0).any()
        and (joints != 0.0).any()
        and (joints == 0.0).any()
    )


def busy(arm, task, home):
    """A place of which no term is idle; the first one drawn, as a rule."""
    places = (place(arm, task, seed=seed, home=home, delta_x=scale_of(task)) for seed in range(50))
    return next(at for at in places if everything_plays(at))


@every_task
def test_second_derivatives_of_the_error_alone(arm, task):
    """Of any weighted sum of its components; a pose has reached its orientation, and is anywhere else."""
    arm, task, rng = ikgym.arms.get(arm), ikgym.tasks.get(task), np.random.default_rng(0)
    n, workspace = arm.joints, knot_workspace(task.kind, task.size, arm.joints)
    workspace.gradient[:] = rng.normal(size=task.error_size)
    for q in (np.zeros(n), *rng.uniform(-2.0, 2.0, (2, n))):
        nominal = task.coordinates(*arm.forward(q))
        nominal[-3:] += rng.normal(size=3)

        def weighted(here, nominal=nominal):
            return workspace.gradient @ task.error(nominal, task.coordinates(*arm.forward(here)))

        central = differences(lambda a, q=q: differences(weighted, a, 1e-3), q, 1e-3)
        out = np.empty((n, n))
        forward_and_jacobian(arm.chain, q, workspace.rotation, workspace.position, workspace.geometric)
        task_kernels.coordinates(task.kind, workspace.rotation, workspace.position, workspace.pose)
        task_kernels.error(task.kind, nominal, workspace.pose, workspace.error)
        second_order(task.kind, workspace, out)
        np.testing.assert_allclose(symmetric(out), central, atol=2e-5 * max(abs(central).max(), 1.0))


def check_derivatives(at, step):
    """Gradient and Hessian of the merit; what is left out at slow joints is the least curvature of Φ^U."""
    (value, _, _), blocks = at.linearise()
    assert value == pytest.approx(at.merit(), rel=1e-13)
    central = differences(at.merit, at.path, step).reshape(blocks.gradient.shape)
    np.testing.assert_allclose(blocks.gradient, central, atol=1e-6 * abs(central).max())
    central = differences(lambda path: at.linearise(path)[1].gradient.ravel(), at.path, step)
    rated = "rate_weight" in at.more
    np.testing.assert_allclose(dense(at.linearise()[1], far=rated), central, atol=1e-5 * abs(central).max())


@every_task
def test_derivatives_against_central_differences(arm, task):
    check_derivatives(busy(arm, task, home=ARMS.index(arm) % 2 == 0), 1e-5 * scale_of(task))


@pytest.mark.parametrize("at", [(1,), (1, 2), (1, 2, 4, 7, 12)])
def test_derivatives_where_changes_of_velocity_cost_something(at):
    before = np.linspace(-1.0, 1.0, 7)
    check_derivatives(place("varga7", "skew", at=at, qdot_before=before, rate_weight=0.3), 1e-8)


def payload(first, knots=4):
    """From one of the knots on, in [rad]."""
    return np.where(np.arange(knots)[:, None] >= first, np.linspace(1e-3, 2e-3, 7), 0.0)


def test_a_payload_from_the_start_is_an_arm_that_stands_elsewhere():
    at, shift = place("panda", "pose", limits=False), payload(0)[0]
    elsewhere = at.problem._replace(start=at.start + shift)
    loaded = true_cost(at.problem._replace(load=payload(0)), at.path, at.workspace)
    assert loaded == pytest.approx(true_cost(elsewhere, at.path + shift, at.workspace), rel=1e-9)
    assert loaded != pytest.approx(true_cost(at.problem, at.path, at.workspace), rel=1e-3)


def test_the_gradient_with_a_payload_on_the_way():
    at = place("panda", "pose", delta_x=1e-4, load=payload(2))
    central = differences(at.merit, at.path, 1e-8)
    np.testing.assert_allclose(at.linearise()[1].gradient.ravel(), central, atol=1e-4 * abs(central).max())


@pytest.mark.parametrize("p_x", [1.5, 2.0, 3.5])
def test_other_exponents(p_x):
    """With P_X up to 2 there is nothing to hold: a kink inwards, or none."""
    at = place("varga7", "skew", p_x=p_x)
    _, blocks = at.linearise()
    central = differences(at.merit, at.path, 1e-8).reshape(blocks.gradient.shape)
    np.testing.assert_allclose(blocks.gradient, central, atol=1e-6 * abs(central).max())
    held = at.multipliers.copy()
    at.linearise(advance=True)
    assert p_x > 2.0 or not at.multipliers[:, : at.error_size].any()
    assert held[:, : at.error_size].any()


@every_task
def test_true_cost_is_that_of_the_horizon(arm, task):
    at = place(arm, task, at=range(1, 7), terminal=1.0, limits=False)
    qdot = np.diff(np.vstack([at.start, at.path]), axis=0) / at.data.dt
    data = HorizonModel(at.data, at.problem.joint_weights)
    kernels = horizon_cost(data, at.start, at.nominal, qdot)
    mine = true_cost(at.problem, at.path, at.workspace)
    assert mine == pytest.approx(kernels, rel=1e-10)  # q is the sum of Δt q̇ up to rounding
    assert at.linearise()[0][1] == pytest.approx(mine, rel=1e-13)
