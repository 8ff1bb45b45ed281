"""MFAC and MFAPC against (11)-(17) and (34)-(41) in plain NumPy, their statuses and identities."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.papers.zhang.episodes import PREDICTIVE
from baselines.policy import Batch
from baselines.solvers.levenberg_marquardt.block_tridiagonal import damped_horizon_step
from baselines.solvers.levenberg_marquardt.damping import condition_number
from baselines.status import Status

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
HELIX = ikgym.scenarios.get("zhang3-helix")


def dense(jacobians, residuals, damping):
    """(27): [Ψ̄ᵀ Ψ̄ + λ I]⁻¹ Ψ̄ᵀ r, as least squares of the augmented system, which squares no condition number."""
    n, e, joints = jacobians.shape
    psi = np.zeros((n * e, n * joints))
    for i in range(n):
        for j in range(i + 1):
            psi[i * e : (i + 1) * e, j * joints : (j + 1) * joints] = jacobians[j]
    augmented = np.vstack([psi, damping**0.5 * np.eye(n * joints)])
    rhs = np.concatenate([residuals.ravel(), np.zeros(n * joints)])
    return np.linalg.lstsq(augmented, rhs, rcond=None)[0].reshape(n, joints)


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


def solve(name, scenario, batch, **numbers):
    policy = baselines.make(name, scenario, **numbers)
    solution = policy.solve(batch, policy.memory(len(batch.q)))
    assert np.isfinite(solution.qdot).all()
    return solution


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


def condition_of(jacobian):
    sigma = np.linalg.svd(jacobian, compute_uv=False)
    return sigma[0] / sigma[min(*jacobian.shape, 6) - 1]


def printed(scenario, q, nominal, rule, numbers, *, jacobians, stop, tolerance, most):
    """(34)-(41) with the dense (36) and (56); with one point they are (11)-(17)."""
    task, model, n = scenario.task, scenario.model, len(nominal)
    path, before = [q] * n, None
    damping = numbers.get("damping", 0.0)
    for i in range(most + 1):
        poses = [task.coordinates(*model.forward(p)) for p in path]  # (34)
        given = [task_jacobian(scenario, p if jacobians == "predicted" else path[0]) for p in path]  # (35)
        errors = [np.linalg.norm(task.error(nominal[j], poses[j])) for j in range(n)]
        error = np.linalg.norm(errors)
        if (error if stop == "horizon" else errors[0]) <= tolerance or i == most:  # (16), (40)
            return path[0], i
        damping = lambda_now(rule, numbers, error, max(map(condition_of, given)), damping)
        residuals = np.stack([task.error(nominal[j], poses[0]) for j in range(n)])
        path = list(path[0] + np.cumsum(dense(np.stack(given), residuals, damping), axis=0))  # (36), (56), (57)
        damping = lambda_next(rule, numbers, damping, error, error if before is None else before)
        before = error
    raise AssertionError


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("name", "n", "jacobians", "stop", "far"),
    [
        ("varga7-fast", 1, "predicted", "horizon", 0.1),
        ("zhang3-helix", 1, "predicted", "horizon", 0.1),
        ("khan8-q1", 1, "predicted", "horizon", 0.1),
        ("varga7-fast", 2, "predicted", "horizon", 0.02),
        ("zhang3-helix", 3, "constant", "horizon", 0.02),
        ("zhang6-lspb", 5, "predicted", "first_point", 0.2),
        ("khan8-q1", 5, "predicted", "horizon", 0.02),
    ],
)
def test_follows_the_printed_iteration(name, n, jacobians, stop, far, rule):
    """MFAC where there is one point."""
    scenario = ikgym.scenarios.get(name)
    batch = problems(scenario, n, far=far, rows=2)
    ahead = {"jacobians": jacobians, "stop": stop}
    policy, given = ("mfac", {}) if n == 1 else ("mfapc", {"horizon": n, **ahead})
    for most in (1, 2, 6, 12)[: 4 if n == 1 else 3]:
        solution = solve(policy, scenario, batch, rule=rule, iterations=most, tolerance=1e-3, **given, **RULES[rule])
        for row, q in enumerate(batch.q):
            numbers = {**ahead, "most": most, "tolerance": 1e-3}
            wanted, made = printed(scenario, q, batch.nominal[row], rule, RULES[rule], **numbers)
            np.testing.assert_allclose(q + scenario.dt * solution.qdot[row], wanted, atol=1e-9)
            assert solution.iterations[row] == made


def sliding_arm(n):
    """Joints that slide: F is linear and J constant; one of them slides along x."""
    axes = np.eye(3)[:1] if n == 1 else np.random.default_rng(3).normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    arm = ikgym.Arm("slider", offsets=np.zeros((n, 3)), axes=axes, prismatic=(True,) * n)
    start, limit = np.zeros(n), np.full(n, 10.0)
    return HELIX.replace(arm=arm, model=arm, start=start, initial_pose=None, velocity_limit=limit)


@pytest.mark.parametrize("one_step", [False, True])
def test_with_one_point_it_is_mfac(one_step):
    scenario = ikgym.scenarios.get("zhang6-lspb")
    batch, numbers = problems(scenario, 1), {"iterations": 20, "tolerance": 1e-10, "one_step": one_step}
    for rule in ("threshold", "sugihara"):
        given = numbers | {"rule": rule} | RULES[rule]
        one, other = solve("mfac", scenario, batch, **given), solve("mfapc", scenario, batch, horizon=1, **given)
        for mine, theirs in zip((*one[:1], *one.memory), (*other[:1], *other.memory), strict=True):
            np.testing.assert_array_equal(mine, theirs)


def status_of(name, nominal, q=(0.3, 0.4, 0.5), scenario=HELIX, **numbers):
    """Status, iterations, and joint velocities of one arm that is shown one point, twice for a horizon."""
    batch = batch_of(scenario, np.array([q]), np.tile(np.array(nominal, dtype=float), (1, 2, 1)))
    solution = solve(name, scenario, batch, **numbers)
    return solution.status[0], solution.iterations[0], solution.qdot, solution.memory


OUT_OF_REACH = [30.0, 0.0, 5.0]


def test_statuses_out_of_reach():
    """One step takes the formula's word for it."""
    assert status_of("mfac", OUT_OF_REACH, rule="sugihara")[:2] == (Status.ITERATION_LIMIT, 500)
    assert status_of("mfac", OUT_OF_REACH, one_step=True)[:2] == (Status.APPLIED, 1)


@pytest.mark.parametrize("name", ["mfac", "mfapc"])
def test_rank_that_is_lost_is_said_unless_it_is_damped(name):
    """Stretched straight up, no joint moves the tool along z, and λ = 0 leaves that direction out."""
    for damping, iterated, one_step in (
        (0.0, Status.RANK_DEFICIENT, Status.RANK_DEFICIENT),
        (1e-20, Status.RANK_DEFICIENT, Status.RANK_DEFICIENT),
        (0.1, Status.ITERATION_LIMIT, Status.APPLIED),
    ):
        numbers = {"rule": "constant", "iterations": 3, "damping": damping}
        stretched = name, [0.0, 0.0, 18.0], (0.0, 0.0, 0.0)
        assert status_of(*stretched, **numbers)[0] == iterated
        assert status_of(*stretched, one_step=True, **numbers)[0] == one_step


def test_rank_that_is_lost_amid_a_horizon_is_said():
    """Block by block from its end: the last one can be factorised, the second cannot."""
    rng = np.random.default_rng(0)
    jacobians, out = rng.normal(size=(3, 3, 4)), np.empty((3, 4))
    jacobians[1, 2] = jacobians[1, 0]
    for damping, blocks in ((0.0, 1), (1e-18, 1), (1e-4, 3)):
        scratch = np.empty((3, 3)), np.empty((3, 3, 3)), np.empty((3, 3))
        assert damped_horizon_step(jacobians, rng.normal(size=(3, 3)), damping, scratch, out) == blocks
    assert condition_number(np.zeros((3, 4)), 3, (np.empty((4, 3)), np.empty((3, 3)))) == np.inf


def test_running_away_is_not_converging():
    """Undamped near a stretched elbow, one step is turns long; the arm stays, and the memory is cleared."""
    q = np.array([0.0, 0.3, 1e-5])
    inwards = 0.99 * ikgym.arms.get("zhang3").forward(q)[1] + [0, 0, 0.05]
    numbers = {"rule": "threshold", "damping": 0.0, "threshold": 1e3, "carry": True}
    status, _, qdot, memory = status_of("mfac", inwards, q, iterations=1, **numbers)
    assert status == Status.DIVERGED
    np.testing.assert_array_equal(qdot, 0.0)
    assert memory[1][0] == np.inf


def test_iterates_that_are_no_numbers():
    far = [1e200] * 3, np.zeros(4), sliding_arm(4)
    status, _, qdot, _ = status_of("mfac", *far, rule="constant", damping=0.0)
    assert status == Status.DIVERGED
    np.testing.assert_array_equal(qdot, 0.0)


@pytest.mark.parametrize("name", ["mfac", "mfapc"])
def test_one_step_uses_the_measured_pose_and_the_iteration_the_model(name):
    q, wrong = np.array([[0.3, 0.4, 0.5]]), np.array([[1.0, 2.0, 3.0]])
    nominal = np.array([[[5.0, 1.0, 6.0], [5.5, 1.0, 6.0]]])
    ahead = 1 if name == "mfac" else 2
    numbers = {"rule": "constant", "damping": 2.0}
    solution = solve(name, HELIX, batch_of(HELIX, q, nominal, wrong), one_step=True, **numbers)
    wanted = dense(np.stack([task_jacobian(HELIX, q[0])] * ahead), (nominal[0] - wrong[0])[:ahead], 2.0)[0]
    np.testing.assert_allclose(solution.qdot[0], wanted, atol=1e-12)
    answers = [solve(name, HELIX, batch_of(HELIX, q, nominal, p), **numbers).qdot for p in (None, wrong)]
    np.testing.assert_array_equal(*answers)


@pytest.mark.parametrize("carry", [False, True])
def test_carried_lambda_goes_on_and_a_new_episode_forgets_it(carry):
    policy = baselines.make("mfac", "zhang6-lspb", rule="threshold", damping=1.0, carry=carry, one_step=True)
    observation, _ = gym.make("RedundantIK-v0", scenario="zhang6-lspb", preview=1).reset()
    state, dampings = None, []
    for k in range(4):
        _, state = policy.predict(observation, state, episode_start=np.array([k == 3]))
        dampings.append(state[2][0])
    wanted = [1.02**-1, 1.02**-2, 1.02**-3, 1.02**-1] if carry else [1.02**-1] * 4
    assert dampings == pytest.approx(wanted, rel=1e-14)


def test_example_1_follows_the_printed_controller():
    """(27), (28) and (44) with constant J; the first measurement is 0, and λ falls from the eighth sample on."""
    scenario = ikgym.scenarios.get("zhang3-helix").replace(steps=120)
    policy = baselines.make("mfapc", scenario, **PREDICTIVE)
    nominal = scenario.nominal(preview=5)
    q, pose, damping, falls = np.zeros(3), np.zeros(3), 2.0, []
    episode = rollout(scenario, policy, seed=0)
    for k in range(120):
        residuals = nominal[k + 1 : k + 6] - pose
        q = q + dense(np.stack([scenario.model.jacobian(q)[:3]] * 5), residuals, damping)[0]
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
