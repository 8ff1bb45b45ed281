"""MFAC against (11)-(17) written down once more in plain NumPy, its statuses, and the error it leaves on a ramp."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.policy import Batch
from baselines.status import Status

NAMES = ["varga7-fast", "zhang3-helix", "zhang6-lspb", "faitli3-regular", "khan8-q1"]
RULES = {
    "constant": {"damping": 0.05},
    "error_ratio": {"damping": 0.5, "growth": 3.0, "decay": 1.5},
    "threshold": {"damping": 0.5, "growth": 1.2, "decay": 2.0, "threshold": 0.1},
    "table": {
        "error_bounds": (0.01, 0.1),
        "condition_bounds": (9.0,),
        "dampings": ((1e-4, 0.1), (0.2, 0.3), (0.4, 0.5)),
    },
    "condition": {"condition_bounds": (9.0, 30.0), "dampings": (1e-3, 0.02, 0.3)},
    "sugihara": {"weight": 2.0, "damping": 0.01},
    "chan": {"weight": 2.0},
}


def batch_of(scenario, q, nominal, pose=None):
    """Observations of rows; nominal has shape (B, p, m)."""
    pose = scenario.task.coordinates(*scenario.model.forward(q)) if pose is None else pose
    return Batch(q, np.zeros_like(q), pose, np.ascontiguousarray(nominal), np.ones((len(q), 1)))


def problems(scenario, points, rows=4, far=0.1, seed=0):
    """Rows with nominal points somewhat off."""
    rng = np.random.default_rng(seed)
    q = rng.uniform(-1.0, 1.0, (rows, scenario.joints))
    away = q[:, None] + far * rng.uniform(-1, 1, (rows, 1, scenario.joints)) * np.arange(1, points + 1)[:, None]
    return batch_of(scenario, q, scenario.task.coordinates(*scenario.model.forward(away)))


def lambda_now(rule, numbers, error, condition, stepped):
    if rule == "constant":
        return numbers["damping"]
    if rule == "table":
        row = sum(error >= b for b in numbers["error_bounds"])
        return numbers["dampings"][row][sum(condition >= b for b in numbers["condition_bounds"])]
    if rule == "condition":
        return numbers["dampings"][sum(condition >= b for b in numbers["condition_bounds"])]
    if rule in ("sugihara", "chan"):
        return numbers["weight"] * error**2 / 2 + numbers.get("damping", 0.0)
    return stepped


def lambda_next(rule, numbers, damping, error, before):
    if rule not in ("error_ratio", "threshold"):
        return damping
    rises = error / before > 1 if rule == "error_ratio" else error > numbers["threshold"]
    return damping * numbers["growth"] if rises else damping / numbers["decay"]


def task_jacobian(scenario, q):
    rotation, _, geometric = scenario.model.forward_and_jacobian(q)
    return scenario.task.jacobian(rotation, geometric)


def condition_of(scenario, jacobian):
    sigma = np.linalg.svd(jacobian, compute_uv=False)
    return sigma[0] / sigma[min(*jacobian.shape, 6) - 1]


def printed(scenario, q, target, rule, numbers, tolerance, most):
    """(11)-(17), with the n x n matrix that is printed."""
    damping, before = numbers.get("damping", 0.0), None
    for i in range(most + 1):
        pose = scenario.task.coordinates(*scenario.model.forward(q))
        jacobian = task_jacobian(scenario, q)
        e = scenario.task.error(target, pose)
        error = np.linalg.norm(e)
        if error <= tolerance or i == most:
            return q, i
        damping = lambda_now(rule, numbers, error, condition_of(scenario, jacobian), damping)
        q = q + np.linalg.solve(jacobian.T @ jacobian + damping * np.eye(len(q)), jacobian.T @ e)
        damping = lambda_next(rule, numbers, damping, error, error if before is None else before)
        before = error
    raise AssertionError


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("name", NAMES)
def test_follows_the_printed_iteration(name, rule):
    scenario = ikgym.scenarios.get(name)
    batch = problems(scenario, 1)
    for most in (1, 2, 5, 12):
        policy = baselines.make("mfac", scenario, rule=rule, tolerance=1e-3, iterations=most, **RULES[rule])
        solution = policy.solve(batch, policy.memory(len(batch.q)))
        for row, q in enumerate(batch.q):
            wanted, made = printed(scenario, q, batch.nominal[row, 0], rule, RULES[rule], 1e-3, most)
            np.testing.assert_allclose(q + scenario.dt * solution.qdot[row], wanted, atol=1e-9)
            assert solution.iterations[row] == made


@pytest.mark.parametrize("name", NAMES)
def test_solves_the_inverse_kinematics(name):
    """With its defaults, from somewhat off: the model is at the point afterwards, and the status tells the truth."""
    scenario = ikgym.scenarios.get(name)
    batch = problems(scenario, 1, rows=20)
    policy = baselines.make("mfac", scenario)
    solution = policy.solve(batch, policy.memory(20))
    assert (solution.status == Status.CONVERGED).all()
    reached = scenario.task.coordinates(*scenario.model.forward(batch.q + scenario.dt * solution.qdot))
    assert np.linalg.norm(scenario.task.error(batch.nominal[:, 0], reached), axis=1).max() < 2e-10


def sliding_arm():
    """Four joints that slide: F is linear and J constant."""
    rng = np.random.default_rng(3)
    axes = rng.normal(size=(4, 3))
    arm = ikgym.Arm(
        "slider",
        offsets=rng.normal(size=(4, 3)),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
        prismatic=(True,) * 4,
    )
    return ikgym.scenarios.get("zhang3-helix").replace(
        arm=arm, model=arm, start=np.zeros(4), initial_pose=None, velocity_limit=np.full(4, 10.0)
    )


@pytest.mark.parametrize("damping", [0.0, 0.05, 0.5])
def test_error_on_a_ramp(damping):
    """(10): one step a period leaves U diag(λ/σ²) Uᵀ v, for a ramp of velocity v."""
    scenario = sliding_arm()
    policy = baselines.make("mfac", scenario, rule="constant", damping=damping, one_step=True)
    velocity, q = np.array([0.02, -0.05, 0.03]), np.zeros(4)
    first = scenario.model.forward(q)[1]
    for k in range(400):
        target = first + (k + 1) * velocity
        solution = policy.solve(batch_of(scenario, q[None], target[None, None]), policy.memory(1))
        q = q + scenario.dt * solution.qdot[0]
    u, sigma, _ = np.linalg.svd(scenario.model.jacobian(q)[:3])
    wanted = u @ np.diag(damping / sigma**2) @ u.T @ velocity
    np.testing.assert_allclose(target - scenario.model.forward(q)[1], wanted, atol=1e-13)


class TestStatuses:
    def solve(self, nominal, q=(0.3, 0.4, 0.5), **numbers):
        scenario = ikgym.scenarios.get("zhang3-helix")
        policy = baselines.make("mfac", scenario, **numbers)
        batch = batch_of(scenario, np.array([q]), np.array([[nominal]]))
        solution = policy.solve(batch, policy.memory(1))
        assert np.isfinite(solution.qdot).all()
        return solution

    def test_out_of_reach(self):
        solution = self.solve([30.0, 0.0, 5.0], rule="sugihara")
        assert (solution.status[0], solution.iterations[0]) == (Status.ITERATION_LIMIT, 500)

    def test_rank_lost_without_damping(self):
        """Stretched straight up, no joint moves the tool along z, and λ = 0 leaves that direction out."""
        up = np.array([0.0, 0.0, 19.0])
        for damping in (0.0, 1e-20):
            solution = self.solve(up - [0, 0, 1.0], (0.0, 0.0, 0.0), rule="constant", damping=damping, iterations=3)
            assert solution.status[0] == Status.RANK_DEFICIENT
        one = self.solve(up - [0, 0, 1.0], (0.0, 0.0, 0.0), rule="constant", damping=0.0, one_step=True)
        assert one.status[0] == Status.RANK_DEFICIENT
        damped = self.solve(up - [0, 0, 1.0], (0.0, 0.0, 0.0), rule="constant", damping=0.1, iterations=3)
        assert damped.status[0] == Status.ITERATION_LIMIT

    def test_one_step_takes_the_formulas_word(self):
        solution = self.solve([30.0, 0.0, 5.0], one_step=True)
        assert (solution.status[0], solution.iterations[0]) == (Status.APPLIED, 1)

    def test_running_away_is_not_converging(self):
        """Undamped beside a stretched elbow, one step is turns long; the arm stays, and the memory is cleared."""
        q = np.array([0.0, 0.3, 1e-5])
        inwards = 0.99 * ikgym.arms.get("zhang3").forward(q)[1] + [0, 0, 0.05]
        numbers = {"rule": "threshold", "damping": 0.0, "threshold": 1e3, "carry": True}
        solution = self.solve(inwards, q, iterations=1, **numbers)
        assert solution.status[0] == Status.DIVERGED
        np.testing.assert_array_equal(solution.qdot, 0.0)
        assert solution.memory[1][0] == np.inf

    def test_iterates_that_are_no_numbers(self):
        scenario = sliding_arm()
        policy = baselines.make("mfac", scenario, rule="constant", damping=0.0)
        far = batch_of(scenario, np.zeros((1, 4)), np.full((1, 1, 3), 1e200))
        solution = policy.solve(far, policy.memory(1))
        assert solution.status[0] == Status.DIVERGED
        np.testing.assert_array_equal(solution.qdot, 0.0)


def test_one_step_uses_the_measured_pose_and_the_iteration_the_model():
    scenario = ikgym.scenarios.get("zhang3-helix")
    q, wrong = np.array([[0.3, 0.4, 0.5]]), np.array([[1.0, 2.0, 3.0]])
    target = np.array([[[5.0, 1.0, 6.0]]])
    jacobian = task_jacobian(scenario, q[0])
    wanted = np.linalg.solve(jacobian.T @ jacobian + 2 * np.eye(3), jacobian.T @ (target[0, 0] - wrong[0]))
    one = baselines.make("mfac", scenario, rule="constant", damping=2.0, one_step=True)
    solution = one.solve(batch_of(scenario, q, target, wrong), one.memory(1))
    np.testing.assert_allclose(solution.qdot[0], wanted, atol=1e-12)
    many = baselines.make("mfac", scenario)
    answers = [many.solve(batch_of(scenario, q, target, pose), many.memory(1)).qdot for pose in (None, wrong)]
    np.testing.assert_array_equal(*answers)


@pytest.mark.parametrize("carry", [False, True])
def test_carried_lambda_goes_on_and_a_new_episode_forgets_it(carry):
    policy = baselines.make("mfac", "zhang6-lspb", rule="threshold", damping=1.0, carry=carry, one_step=True)
    env = gym.make("RedundantIK-v0", scenario="zhang6-lspb", preview=1)
    observation, _ = env.reset()
    state, dampings = None, []
    for k in range(4):
        _, state = policy.predict(observation, state, episode_start=np.array([k == 3]))
        dampings.append(state[2][0])
    wanted = [1.02**-1, 1.02**-2, 1.02**-3, 1.02**-1] if carry else [1.02**-1] * 4
    assert dampings == pytest.approx(wanted, rel=1e-14)
