"""The formulas of resolved rate against NumPy, for Jacobians and task shifts of any kind, and the feedback law."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.solvers.arm_size import error_weights
from baselines.solvers.resolved_rate.base import APPLIED, DEFICIENT
from baselines.solvers.resolved_rate.dls import DampedLeastSquares, damped_rows
from baselines.solvers.resolved_rate.gram_schmidt import GramSchmidt, orthonormal_rows
from baselines.solvers.resolved_rate.jacobian_transpose import JacobianTranspose, transpose_rows
from baselines.solvers.resolved_rate.null_space import aimed_rows, objective_rows
from baselines.status import Status
from ikgym.kernels.linear_algebra import pseudoinverse_rows
from tests.baselines.solvers.adaptive.arms import observed
from tests.baselines.solvers.quadratic_program.paths import circle
from tests.limited import limited


def invert(policy, jacobian, shift):
    """Joint shifts (B, n) for task shifts (B, e), and statuses (B,)."""
    rows, size, n = jacobian.shape
    full = min(size, n, 6)
    numbers, out, deficient = policy.numbers(), np.empty((rows, n)), np.zeros(rows, dtype=np.bool_)
    if isinstance(policy, DampedLeastSquares):
        damped_rows(jacobian, shift, numbers.damping, out)
    elif isinstance(policy, GramSchmidt):
        orthonormal_rows(jacobian, shift, numbers.truncation, full, out, deficient)
    elif isinstance(policy, JacobianTranspose):
        transpose_rows(jacobian, shift, numbers.weights, numbers.rank_tolerance, out, deficient)
        deficient &= size == full
    else:
        pseudoinverse_rows(jacobian / numbers.root, shift, numbers.tolerance, full, out, deficient)
        out /= numbers.root
    return out, np.where(deficient, DEFICIENT, APPLIED)


def move(policy, q, jacobian, shift):
    """Joint velocities of `null_space`, at joint coordinates (B, n)."""
    out, status = np.empty_like(q), np.empty(len(q), dtype=np.int64)
    aim = np.empty_like(q)
    objective_rows(policy.numbers(), policy.problem.dt, q, aim)
    aimed_rows(policy.numbers(), aim, jacobian, shift, out, status)
    return out, status


def objective_gradient(policy, q):
    """Its secondary objective's z / K, of shape (B, n)."""
    out = np.empty_like(q)
    objective_rows(policy.numbers(), policy.problem.dt, q, out)
    return out / (policy.problem.dt * policy.secondary_gain)


#: One for each task and number of joints.
SCENARIOS = ("varga7-fast", "planar2-bent", "zhang3-helix", "zhang6-lspb", "khan8-q7q8", "tiago-raster", "panda-glue")


def jacobians(scenario, rows=20):
    rng = np.random.default_rng(0)
    q = np.vstack([rng.uniform(-2, 2, (rows, scenario.joints)), np.zeros((1, scenario.joints))])
    rotation, _, geometric = scenario.model.forward_and_jacobian(q)
    jacobian = scenario.task.jacobian(rotation, geometric)
    return jacobian, rng.normal(size=jacobian.shape[:2]) * 1e-3


def pseudoinverse(j, dx, policy, share, root):
    """W^-½ (J W^-½)⁺ Δx without singular values below a share of the largest; what is kept; how well it is known."""
    u, sigma, vt = np.linalg.svd(j / root, full_matrices=False)
    kept = sigma > share * sigma[0]
    wanted = vt[kept].T @ ((u[:, kept].T @ dx) / sigma[kept]) / root
    return wanted, kept.sum() == min(*j.shape, 6), 1e-14 * sigma[0] / sigma[kept][-1]


def damped(j, dx, policy):
    """As least squares of the augmented system [J; √λ I] Δq = [Δx; 0], which squares no condition number."""
    n = j.shape[1]
    augmented = np.vstack([j, policy.damping**0.5 * np.eye(n)])
    return np.linalg.lstsq(augmented, np.concatenate([dx, np.zeros(n)]), rcond=None)[0], True, 1e-8


def best_step(j, dx, policy):
    """The exact line search along the weighted gradient, by least squares in one unknown."""
    w = np.sqrt(error_weights(policy.problem.task, policy.length))
    j, dx = w[:, None] * j, w * dx
    best = np.linalg.lstsq((j @ j.T @ dx)[:, None], dx, rcond=None)[0][0]
    return best * j.T @ dx, True, 1e-12


#: Joint shifts by NumPy, whether the Jacobian has its full rank, and a tolerance.
FORMULAS = {
    "moore_penrose": lambda j, dx, policy: pseudoinverse(j, dx, policy, 1e-12, 1.0),
    "truncated_svd": lambda j, dx, policy: pseudoinverse(j, dx, policy, policy.threshold, 1.0),
    "weighted_pseudoinverse": lambda j, dx, policy: pseudoinverse(j, dx, policy, 1e-12, np.sqrt(policy.weights)),
    "dls": damped,
    "jacobian_transpose": best_step,
}
CASES = [
    *[("moore_penrose", {}), ("truncated_svd", {"threshold": 1e-3}), ("truncated_svd", {"threshold": 0.3})],
    *[("dls", {"damping": 1e-6}), ("dls", {"damping": 0.5}), ("weighted_pseudoinverse", None)],
    ("jacobian_transpose", {}),
]


@pytest.mark.parametrize("name", SCENARIOS)
@pytest.mark.parametrize(("policy", "parameters"), CASES)
def test_is_the_formula(policy, parameters, name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    given = {"weights": tuple(np.linspace(0.5, 4.0, scenario.joints))} if parameters is None else parameters
    made = baselines.make(policy, scenario, **given)
    step, status = invert(made, jacobian, shift)
    for j, dx, dq, s in zip(jacobian, shift, step, status, strict=True):
        wanted, full, tolerance = FORMULAS[policy](j, dx, made)
        np.testing.assert_allclose(dq, wanted, atol=tolerance * np.linalg.norm(wanted) + 1e-17)
        assert s == (Status.APPLIED if full else Status.RANK_DEFICIENT)


@pytest.mark.parametrize("name", SCENARIOS)
def test_full_rank_without_truncation_is_moore_penrose(name):
    scenario = ikgym.scenarios.get(name)
    jacobian, shift = jacobians(scenario)
    if scenario.task.name == "matrix":
        # Redundant coordinates: of a demand that the arm cannot meet the two make different things.
        motion = np.random.default_rng(1).normal(size=(len(jacobian), scenario.joints)) * 1e-3
        shift = np.einsum("ben,bn->be", jacobian, motion)
    policy, compared = baselines.make("gram_schmidt", scenario, truncation=0.0), 0
    for j, dx, dq, s in zip(jacobian, shift, *invert(policy, jacobian, shift), strict=True):
        sigma = np.linalg.svd(j, compute_uv=False)
        if sigma[min(*j.shape, 6) - 1] >= 1e-6 * sigma[0]:
            wanted, _, tolerance = pseudoinverse(j, dx, policy, 1e-10, 1.0)
            np.testing.assert_allclose(dq, wanted, atol=10.0 * tolerance * np.linalg.norm(wanted))
            assert s == Status.APPLIED
            compared += 1
    assert compared >= 20


@pytest.mark.parametrize("gain", [0.1, 1.5])
def test_gain_is_the_share_of_the_error_taken_back(gain):
    """At rest, an error e becomes (1 - gain) e in one step."""
    scenario, here = ikgym.scenarios.get("faitli3-regular"), np.array([0.1, 0.4, 1.0])
    target = scenario.task.coordinates(*scenario.model.forward(here))
    policy, away = baselines.make("moore_penrose", scenario, gain=gain), here + 1e-5

    def error(q, state=None):
        """What is left after a step from q; what is not known of the reference counts as its motion."""
        observation = observed(scenario, scenario.model, 0.0, q, target)
        action, state = policy.predict(observation, state)
        reached = scenario.model.forward(q + scenario.dt * action * scenario.velocity_limit)
        return target - scenario.task.coordinates(*reached), state

    first, _ = error(away)
    np.testing.assert_allclose(first, 0.0, atol=1e-8)
    after, _ = error(away, error(here)[1])
    before = target - scenario.task.coordinates(*scenario.model.forward(away))
    np.testing.assert_allclose(after, (1 - gain) * before, atol=1e-8)


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
