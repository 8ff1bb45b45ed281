"""The formulas of resolved rate against NumPy, for Jacobians and task shifts of any kind, and the feedback law."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.solvers.arm_size import error_weights
from baselines.solvers.linear_algebra import pseudoinverse_rows
from baselines.solvers.resolved_rate.base import APPLIED, DEFICIENT
from baselines.solvers.resolved_rate.dls import DampedLeastSquares, damped_rows
from baselines.solvers.resolved_rate.gram_schmidt import GramSchmidt, orthonormal_rows
from baselines.solvers.resolved_rate.jacobian_transpose import JacobianTranspose, transpose_rows
from baselines.solvers.resolved_rate.null_space import move_rows, objective_rows
from baselines.status import Status
from tests.baselines.solvers.quadratic_program.paths import circle
from tests.limited import limited


def invert(policy, jacobian, shift):
    """Joint shifts (B, n) for task shifts (B, e), and statuses (B,)."""
    rows, size, n = jacobian.shape
    numbers, out, deficient = policy.numbers(), np.empty((rows, n)), np.zeros(rows, dtype=np.bool_)
    if isinstance(policy, DampedLeastSquares):
        damped_rows(jacobian, shift, numbers.damping, out)
    elif isinstance(policy, GramSchmidt):
        orthonormal_rows(jacobian, shift, numbers.truncation, numbers.full_rank, out, deficient)
    elif isinstance(policy, JacobianTranspose):
        transpose_rows(jacobian, shift, numbers.weights, numbers.tolerance, out, deficient)
        deficient &= size == numbers.full_rank
    else:
        pseudoinverse_rows(jacobian / numbers.root, shift, numbers.tolerance, numbers.full_rank, out, deficient)
        out /= numbers.root
    return out, np.where(deficient, DEFICIENT, APPLIED)


def move(policy, q, jacobian, shift):
    """The same of `null_space`, at joint coordinates (B, n)."""
    out, status = np.empty_like(q), np.empty(len(q), dtype=np.int64)
    move_rows(policy.numbers(), q, jacobian, shift, out, status)
    return out, status


def objective_gradient(policy, q):
    """Its secondary objective's z / K, of shape (B, n)."""
    out = np.empty_like(q)
    objective_rows(policy.numbers(), q, out)
    return out


#: One for each task and number of joints.
SCENARIOS = ("varga7-fast", "planar2-bent", "zhang3-helix", "zhang6-lspb", "khan8-q7q8", "tiago-raster", "panda-glue")


def jacobians(scenario, rows=20):
    rng = np.random.default_rng(0)
    q = np.vstack([rng.uniform(-2, 2, (rows, scenario.joints)), np.zeros((1, scenario.joints))])
    rotation, _, geometric = scenario.model.forward_and_jacobian(q)
    jacobian = scenario.task.jacobian(rotation, geometric)
    return jacobian, rng.normal(size=jacobian.shape[:2]) * 1e-3


@pytest.mark.parametrize("name", SCENARIOS)
def test_moore_penrose_is_the_pseudoinverse(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, status = invert(baselines.make("moore_penrose", scenario), jacobian, shift)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        rank = np.linalg.matrix_rank(j, tol=1e-12 * np.linalg.norm(j, 2))
        wanted = np.linalg.pinv(j, rcond=1e-12) @ dx
        condition = np.linalg.svd(j, compute_uv=False)[rank - 1] / np.linalg.norm(j, 2)
        np.testing.assert_allclose(dq, wanted, atol=1e-14 * np.linalg.norm(wanted) / condition)
        full = min(scenario.task.error_size, scenario.joints, 6)
        assert s == (Status.APPLIED if rank == full else Status.RANK_DEFICIENT)


@pytest.mark.parametrize("damping", [1e-6, 1e-3, 0.5])
@pytest.mark.parametrize("name", SCENARIOS)
def test_dls_minimises_the_damped_squares(name, damping):
    """As least squares of the augmented system [J; √λ I] Δq = [Δx; 0], which squares no condition number."""
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, _ = invert(baselines.make("dls", scenario, damping=damping), jacobian, shift)
    for j, dx, dq in zip(jacobian, shift, step, strict=True):
        augmented = np.vstack([j, damping**0.5 * np.eye(scenario.joints)])
        wanted = np.linalg.lstsq(augmented, np.concatenate([dx, np.zeros(scenario.joints)]), rcond=None)[0]
        np.testing.assert_allclose(dq, wanted, rtol=1e-6, atol=1e-8 * np.linalg.norm(wanted))


@pytest.mark.parametrize("gain", [0.1, 0.5, 1.0, 1.5])
def test_gain_is_the_share_of_the_error_taken_back(gain):
    """At rest, an error e becomes (1 - gain) e in one step."""
    scenario = ikgym.scenarios.get("faitli3-regular")
    here = np.array([0.1, 0.4, 1.0])
    still = scenario.replace(trajectory=ikgym.trajectories.Sinusoid(np.zeros(3), offset=here))
    env = gym.make("RedundantIK-v0", scenario=still, preview=1)
    policy = baselines.make("moore_penrose", still, gain=gain)
    observation, _ = env.reset(options={"q": here + 1e-5})
    state, errors = None, []
    for _ in range(4):
        errors.append(observation["nominal"][0] - observation["pose"])
        action, state = policy.predict(observation, state)
        observation, *_ = env.step(action)
    # At the first step nothing is known of X^N(k): all that is missing counts as nominal motion.
    np.testing.assert_allclose(errors[1], 0, atol=1e-8)
    observation, _ = env.reset(options={"q": here})
    _, state = policy.predict(observation, None)
    observation, _ = env.reset(options={"q": here + 1e-5})
    before = observation["nominal"][0] - observation["pose"]
    action, _ = policy.predict(observation, state)
    observation, *_ = env.step(action)
    after = observation["nominal"][0] - observation["pose"]
    np.testing.assert_allclose(after, (1 - gain) * before, atol=1e-8)


@pytest.mark.parametrize(("delay", "limit"), [(2, 0.62), (12, 0.13)])
def test_a_delay_lowers_the_largest_stable_gain(delay, limit):
    """As the docstring says: errors die out a tenth below the limit, and grow a tenth above."""
    scenario = ikgym.scenarios.get("panda-circle").replace(steps=1200, plant=ikgym.Plant(command_delay=delay))
    assert 2.0 * np.sin(np.pi / (2 * (2 * delay + 1))) == pytest.approx(limit, rel=0.04)
    late = [
        rollout(scenario, baselines.make("dls", scenario, gain=share * limit), 0, timed=False)
        .position_error[-100:]
        .max()
        for share in (0.9, 1.1)
    ]
    assert late[0] < 0.02
    assert late[1] > 10.0 * late[0]


@pytest.mark.parametrize("threshold", [1e-3, 0.03, 0.3])
@pytest.mark.parametrize("name", SCENARIOS)
def test_leaves_out_the_small_singular_values(name, threshold):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    step, status = invert(baselines.make("truncated_svd", scenario, threshold=threshold), jacobian, shift)
    full = min(scenario.task.error_size, scenario.joints, 6)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        u, sigma, vt = np.linalg.svd(j, full_matrices=False)
        kept = sigma > threshold * sigma[0]
        wanted = vt[kept].T @ ((u[:, kept].T @ dx) / sigma[kept])
        np.testing.assert_allclose(dq, wanted, rtol=1e-8, atol=1e-12 * np.linalg.norm(wanted))
        assert np.linalg.norm(dq) <= np.linalg.norm(dx) / (threshold * sigma[0]) * (1 + 1e-12)
        assert s == (Status.APPLIED if kept.sum() == full else Status.RANK_DEFICIENT)


@pytest.mark.parametrize("name", SCENARIOS)
def test_full_rank_without_truncation_is_moore_penrose(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    rng = np.random.default_rng(1)
    if scenario.task.name == "matrix":
        # Redundant coordinates: of a demand that the arm cannot meet the two make different things.
        shift = np.einsum("ben,bn->be", jacobian, rng.normal(size=(len(jacobian), scenario.joints)) * 1e-3)
    step, status = invert(baselines.make("gram_schmidt", scenario, truncation=0.0), jacobian, shift)
    full, compared = min(scenario.task.error_size, scenario.joints, 6), 0
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        sigma = np.linalg.svd(j, compute_uv=False)
        if sigma[full - 1] < 1e-6 * sigma[0]:
            continue
        wanted = np.linalg.pinv(j, rcond=1e-10) @ dx
        tolerance = 1e-13 * sigma[0] / sigma[full - 1]
        np.testing.assert_allclose(dq, wanted, atol=tolerance * np.linalg.norm(wanted))
        assert s == Status.APPLIED
        compared += 1
    assert compared >= 20 or "literal" in name


def test_makes_the_shift_where_rows_are_nearly_parallel():
    """To rounding of the large step that this takes; taken off once only, rows would miss by ten million times that."""
    policy = baselines.make("gram_schmidt", "varga7-fast", truncation=0.0)
    rng = np.random.default_rng(3)
    for _ in range(5):
        j, dx = rng.normal(size=7) + 1e-7 * rng.normal(size=(6, 7)), rng.normal(size=6)
        step, _ = invert(policy, j[None], dx[None])
        np.testing.assert_allclose(j @ step[0], dx, atol=1e-15 * np.linalg.norm(j, 2) * np.linalg.norm(step))


def rank_two():
    return np.array([[2.0, 0, 0], [0, 3, 0], [2, 3, 1e-5]])


def test_rows_left_out_are_not_tracked_and_the_others_are():
    policy = baselines.make("gram_schmidt", "faitli3-regular", truncation=1e-3)
    dx = np.array([1.0, 2.0, 30.0])
    step, status = invert(policy, rank_two()[None], dx[None])
    assert status[0] == Status.RANK_DEFICIENT
    # The longest row is the third, then the second of what remains; the first is left out.
    made = rank_two() @ step[0]
    np.testing.assert_allclose(made[1:], dx[1:], rtol=1e-12)
    assert abs(made[0] - dx[0]) > 1
    exact, status = invert(
        baselines.make("gram_schmidt", "faitli3-regular", truncation=1e-7), rank_two()[None], dx[None]
    )
    assert status[0] == Status.APPLIED
    np.testing.assert_allclose(rank_two() @ exact[0], dx, rtol=1e-9)


@pytest.mark.parametrize("name", SCENARIOS)
def test_is_the_best_step_along_the_gradient(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    policy = baselines.make("jacobian_transpose", scenario)
    step, status = invert(policy, jacobian, shift)
    assert (status == Status.APPLIED).all()
    w = np.sqrt(error_weights(scenario.task, policy.length))
    for j, dx, dq in zip(w[:, None] * jacobian, w * shift, step, strict=True):
        h = j.T @ dx
        alpha = (dx @ j @ j.T @ dx) / np.linalg.norm(j @ j.T @ dx) ** 2
        np.testing.assert_allclose(dq, alpha * h, rtol=1e-12, atol=1e-18)
        # The exact line search by least squares in one unknown.
        best = np.linalg.lstsq((j @ h)[:, None], dx, rcond=None)[0][0]
        np.testing.assert_allclose(dq, best * h, rtol=1e-10, atol=1e-17)
        assert np.linalg.norm(dx - j @ dq) <= np.linalg.norm(dx)


def test_stands_still_and_says_so_where_nothing_pulls():
    policy = baselines.make("jacobian_transpose", "faitli3-regular")
    jacobian = np.zeros((3, 3, 3))
    jacobian[:, :2] = np.eye(3)[:2]
    shift = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    step, status = invert(policy, jacobian, shift)
    np.testing.assert_array_equal(step, [[0, 0, 0], [0, 0, 0], [1, 0, 0]])
    assert status.tolist() == [Status.RANK_DEFICIENT, Status.APPLIED, Status.APPLIED]


def test_a_best_fit_of_redundant_coordinates_has_lost_no_rank():
    policy = baselines.make("jacobian_transpose", "khan8-q1", length=1.0)
    jacobian = np.random.default_rng(0).normal(size=(1, 12, 8))
    across = np.linalg.svd(jacobian[0])[0][:, -1:].T
    step, status = invert(policy, jacobian, across)
    np.testing.assert_array_equal(step, 0.0)
    assert status[0] == Status.APPLIED


def weighted(scenario, **parameters):
    return baselines.make("weighted_pseudoinverse", scenario, **parameters)


@pytest.mark.parametrize("name", SCENARIOS)
def test_is_the_formula(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    weights = np.linspace(0.5, 4.0, scenario.joints)
    step, status = invert(weighted(scenario, weights=tuple(weights)), jacobian, shift)
    inverse = np.diag(1.0 / weights)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        # The formula squares the condition number; what it is off by is bounded with it.
        small = np.linalg.svd(j / np.sqrt(weights), compute_uv=False)
        kept = small[small > 1e-12 * small[0]]
        wanted = inverse @ j.T @ np.linalg.pinv(j @ inverse @ j.T, rcond=1e-24 + (0.5 * kept[-1] / small[0]) ** 2) @ dx
        tolerance = 1e-13 * (small[0] / kept[-1]) ** 2
        if tolerance < 1e-3:
            np.testing.assert_allclose(dq, wanted, atol=tolerance * np.linalg.norm(wanted) + 1e-15)
        full = min(scenario.task.error_size, scenario.joints, 6)
        assert s == (Status.APPLIED if len(kept) == full else Status.RANK_DEFICIENT)


def test_by_default_joints_weigh_by_their_velocity_limits():
    free = ikgym.scenarios.get("varga7-fast")
    assert weighted(free).weights == 1.0
    panda = circle()
    limit = panda.arm.velocity_limit
    np.testing.assert_allclose(weighted(panda).weights, (limit.max() / limit) ** 2, rtol=1e-15)
    assert weighted(panda, weights=1.0).weights == 1.0
    # A joint without a limit is as fast as an action can make it.
    some = limited()
    np.testing.assert_allclose(weighted(some).weights, (20.0 / np.array([5, 20, 8, 20, 20, 10, 10])) ** 2, rtol=1e-15)
    equal = free.replace(arm=free.arm.replace(velocity_limit=np.full(7, 3.0)))
    assert weighted(equal).weights == (1.0,) * 7
