"""MFAPC against (34)-(41) written down once more in plain NumPy, its identities, and both examples."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status
from tests.baselines.solvers.levenberg_marquardt.test_block_tridiagonal import printed as dense
from tests.baselines.solvers.levenberg_marquardt.test_mfac import (
    RULES,
    batch_of,
    condition_of,
    lambda_next,
    lambda_now,
    problems,
    task_jacobian,
)


def solve(name, scenario, batch, **numbers):
    policy = baselines.make(name, scenario, **numbers)
    return policy.solve(batch, policy.memory(len(batch.q)))


def printed(scenario, q, nominal, rule, numbers, *, n, predicted, stop, tolerance, most):
    """(34)-(41) with the dense (36) and (56)."""
    task, model = scenario.task, scenario.model
    path, before = [q] * n, None
    damping = numbers.get("damping", 0.0)
    for i in range(most + 1):
        poses = [task.coordinates(*model.forward(p)) for p in path]  # (34)
        jacobians = np.stack([task_jacobian(scenario, p if predicted else path[0]) for p in path])  # (35)
        errors = [np.linalg.norm(task.error(nominal[j], poses[j])) for j in range(n)]
        error = np.linalg.norm(errors)
        if (error if stop == "horizon" else errors[0]) <= tolerance or i == most:  # (40)
            return path[0], i
        damping = lambda_now(rule, numbers, error, max(condition_of(scenario, j) for j in jacobians), damping)
        residuals = np.stack([task.error(nominal[j], poses[0]) for j in range(n)])
        shifts = dense(jacobians, residuals, damping)  # (36)
        path = list(path[0] + np.cumsum(shifts, axis=0))  # (56), (57)
        damping = lambda_next(rule, numbers, damping, error, error if before is None else before)
        before = error
    raise AssertionError


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("name", "n", "jacobians", "stop"),
    [
        ("varga7-fast", 2, "predicted", "horizon"),
        ("zhang3-helix", 3, "constant", "horizon"),
        ("zhang6-lspb", 3, "predicted", "first_point"),
        ("khan8-q1", 5, "predicted", "horizon"),
    ],
)
def test_follows_the_printed_iteration(name, n, jacobians, stop, rule):
    scenario = ikgym.scenarios.get(name)
    batch = problems(scenario, n, far=0.02, rows=2)
    end = {"tolerance": 1e-3, "stop": stop}
    for most in (1, 2, 6):
        solution = solve(
            "mfapc", scenario, batch, rule=rule, horizon=n, jacobians=jacobians, iterations=most, **end, **RULES[rule]
        )
        for row, q in enumerate(batch.q):
            wanted, made = printed(
                scenario,
                q,
                batch.nominal[row],
                rule,
                RULES[rule],
                n=n,
                predicted=jacobians == "predicted",
                most=most,
                **end,
            )
            np.testing.assert_allclose(q + scenario.dt * solution.qdot[row], wanted, atol=1e-9)
            assert solution.iterations[row] == made


@pytest.mark.parametrize("one_step", [False, True])
@pytest.mark.parametrize("rule", RULES)
def test_with_one_point_it_is_mfac(rule, one_step):
    name = "zhang6-lspb"
    scenario = ikgym.scenarios.get(name)
    batch = problems(scenario, 1)
    numbers = {"rule": rule, "iterations": 20, "tolerance": 1e-10, "one_step": one_step, **RULES[rule]}
    one, other = solve("mfac", scenario, batch, **numbers), solve("mfapc", scenario, batch, horizon=1, **numbers)
    np.testing.assert_array_equal(one.qdot, other.qdot)
    np.testing.assert_array_equal(one.status, other.status)
    np.testing.assert_array_equal(one.iterations, other.iterations)
    for a, b in zip(one.memory, other.memory, strict=True):
        np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("name", "n"), [("varga7-fast", 2), ("zhang3-helix", 3), ("zhang6-lspb", 7)])
def test_without_damping_its_first_shift_is_that_of_mfac(name, n):
    """(38): whatever lies behind the first point."""
    scenario = ikgym.scenarios.get(name)
    batch = problems(scenario, n, far=0.05)
    for most in (1, 4):
        numbers = {"rule": "constant", "damping": 0.0, "iterations": most}
        one = solve("mfac", scenario, batch, **numbers)
        other = solve("mfapc", scenario, batch, horizon=n, stop="first_point", **numbers)
        np.testing.assert_array_equal(one.qdot, other.qdot)
        np.testing.assert_array_equal(one.iterations, other.iterations)


def test_one_step_uses_the_measured_pose_and_the_iteration_the_model():
    scenario = ikgym.scenarios.get("zhang3-helix")
    q, wrong = np.array([[0.3, 0.4, 0.5]]), np.array([[1.0, 2.0, 3.0]])
    nominal = np.array([[[5.0, 1.0, 6.0], [5.5, 1.0, 6.0]]])
    numbers = {"horizon": 2, "rule": "constant", "damping": 2.0}
    solution = solve("mfapc", scenario, batch_of(scenario, q, nominal, wrong), one_step=True, **numbers)
    wanted = dense(np.stack([task_jacobian(scenario, q[0])] * 2), nominal[0] - wrong[0], 2.0)[0]
    np.testing.assert_allclose(solution.qdot[0], wanted, atol=1e-12)
    answers = [solve("mfapc", scenario, batch_of(scenario, q, nominal, p), **numbers).qdot for p in (None, wrong)]
    np.testing.assert_array_equal(*answers)


def test_equal_points_ahead_are_met():
    """Remark 5: with Y* = E y*, the rest point is that of MFAC, and (40) is met."""
    scenario = ikgym.scenarios.get("zhang6-lspb")
    batch = problems(scenario, 1)
    batch = batch._replace(nominal=np.repeat(batch.nominal, 3, axis=1))
    numbers = {"rule": "constant", "damping": 1e-4, "iterations": 100, "tolerance": 1e-9}
    solution = solve("mfapc", scenario, batch, **numbers)
    assert (solution.status == Status.CONVERGED).all()
    reached = scenario.task.coordinates(*scenario.model.forward(batch.q + scenario.dt * solution.qdot))
    assert np.linalg.norm(scenario.task.error(batch.nominal[:, 0], reached), axis=1).max() < 1e-9


def test_with_damping_the_points_ahead_pull_it_past_the_first():
    """One prismatic joint, two points v apart: the rest point of the iteration is λ v / (g + 2λ) past the first."""
    axis = np.array([[1.0, 0.0, 0.0]])
    arm = ikgym.Arm("slide", np.zeros((1, 3)), axis, (True,))
    scenario = ikgym.scenarios.get("zhang3-helix").replace(
        arm=arm, model=arm, start=np.zeros(1), initial_pose=None, velocity_limit=np.full(1, 10.0)
    )
    nominal = np.array([[[1.0, 0, 0], [1.3, 0, 0]]])
    numbers = {"horizon": 2, "rule": "constant", "damping": 0.5, "iterations": 200}
    solution = solve("mfapc", scenario, batch_of(scenario, np.zeros((1, 1)), nominal), **numbers)
    assert solution.qdot[0, 0] == pytest.approx(1.0 + 0.5 * 0.3 / (1 + 2 * 0.5), rel=1e-12)
    assert solution.status[0] == Status.ITERATION_LIMIT


def test_rank_lost_anywhere_on_the_path_is_said():
    scenario = ikgym.scenarios.get("zhang3-helix")
    up = np.array([0.0, 0.0, 18.0])
    batch = batch_of(scenario, np.zeros((1, 3)), np.tile(up, (1, 2, 1)))
    for numbers, wanted in (
        ({"damping": 0.0}, Status.RANK_DEFICIENT),
        ({"damping": 0.0, "one_step": True}, Status.RANK_DEFICIENT),
        ({"damping": 0.1}, Status.ITERATION_LIMIT),
        ({"damping": 0.1, "one_step": True}, Status.APPLIED),
    ):
        solution = solve("mfapc", scenario, batch, horizon=2, rule="constant", iterations=3, **numbers)
        assert solution.status[0] == wanted
        assert np.isfinite(solution.qdot).all()


def test_example_1_follows_the_printed_controller():
    """(27), (28) and (44) with constant J; the first measurement is 0, and λ falls from the eighth sample on."""
    scenario = ikgym.scenarios.get("zhang3-helix").replace(steps=120)
    policy = baselines.make("mfapc_helix", scenario)
    assert policy.preview == 5
    nominal = scenario.nominal(preview=5)
    q, pose, damping, falls = np.zeros(3), np.zeros(3), 2.0, []
    episode = rollout(scenario, policy, seed=0)
    for k in range(120):
        residuals = nominal[k + 1 : k + 6] - pose
        q = q + dense(np.stack([task_jacobian(scenario, q)] * 5), residuals, damping)[0]
        pose = scenario.model.forward(q)[1]
        far = np.linalg.norm(residuals) > 10
        damping = damping * 1.1 if far else damping / 1.02
        falls.append(not far)
        # The actions are float32; the loop forgets what they leave.
        np.testing.assert_allclose(episode.q[k], q, atol=1e-4)
    assert falls.index(True) == 7
    assert all(falls[7:])
    assert episode.position_error[-1] < 0.05
    assert set(episode.status) == {Status.APPLIED}


#: (44) of example 1, (59) of example 2.
RULE_44 = {"rule": "threshold", "damping": 2.0, "growth": 1.1, "decay": 1.02, "threshold": 10.0, "carry": True}
PRESETS = {
    "mfac_helix": ("zhang3-helix", "mfac", {**RULE_44, "one_step": True}),
    "mfapc_helix": ("zhang3-helix", "mfapc", {**RULE_44, "one_step": True, "horizon": 5, "jacobians": "constant"}),
    "mfapc_line": ("zhang6-lspb", "mfapc", {"rule": "constant", "damping": 0.0, "horizon": 2, "iterations": 10}),
}


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_is_its_solver_with_the_printed_numbers(name):
    on, solver, numbers = PRESETS[name]
    scenario = ikgym.scenarios.get(on).replace(steps=200)
    preset, plain = baselines.make(name, scenario), baselines.make(solver, scenario, **numbers)
    assert preset.parameters == plain.parameters
    assert preset.preview == plain.preview
    one, other = (rollout(scenario, policy, 0) for policy in (preset, plain))
    np.testing.assert_array_equal(one.q, other.q)
