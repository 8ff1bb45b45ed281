"""The fixed-point transformation: its identities, its limit of convergence, its variants and statuses."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.solvers.arm_size import error_weights, jacobian_bound
from baselines.status import Status

REGULAR, BENT = "faitli3-regular", "planar2-bent"
Q = np.array([0.1, 0.4, 1.0])


def observed(name, q):
    return gym.make("RedundantIK-v0", scenario=name, preview=1).reset(options={"q": q})[0]


def away(q=Q, by=1e-3, name=REGULAR):
    """Seen at q, with a target that is q's neighbour."""
    scenario = ikgym.scenarios.get(name)
    target = scenario.task.coordinates(*scenario.model.forward(q + by))
    return {**observed(name, q), "nominal": target[None]}


def stepped(policy, observation, state=None):
    """q after a step, with the float32 of the action taken back, the state and the status."""
    action, state = policy.predict(observation, state)
    problem = policy.problem
    return observation["q"] + action * problem.velocity_limit * problem.dt, state, policy.report(state).status[0]


def printed(scenario, q, target, a, transformation, components, last):
    """Five times eq. 1 in plain NumPy, with F(ξ) = 0.4 ξ + 0.2; and what is remembered for the next step."""
    for _ in range(5):
        rotation, position, geometric = scenario.model.forward_and_jacobian(q)
        error = -scenario.task.error(target, scenario.task.coordinates(rotation, position))
        if transformation == "transpose":
            h = scenario.task.jacobian(rotation, geometric).T @ error
        else:
            h = error = error[list(components)]
        if transformation == "sign_by_growth":
            last = (1.0, np.inf) if last is None else last
            length = np.linalg.norm(error)
            last = (-last[0] if length > last[1] else last[0], length)
            h = last[0] * error
        elif transformation == "sign":
            h, last = (-error if last is not None and error @ last < 0 else error), error
        norm, fixed_point = np.linalg.norm(h), 0.2 / (1.0 - 0.4)
        q = q + (0.4 * (a * norm + fixed_point) + 0.2 - fixed_point) * h / norm
    return q, last


@pytest.mark.parametrize(
    ("name", "transformation", "components"),
    [
        (REGULAR, "transpose", None),
        ("khan8-q1", "transpose", None),
        (REGULAR, "none", (0, 1, 2)),
        (BENT, "none", (1, 0)),
        (REGULAR, "sign", (0, 1, 2)),
        (BENT, "sign", (0, 1)),
        (REGULAR, "sign_by_growth", (0, 1, 2)),
        (BENT, "sign_by_growth", (0, 1)),
    ],
)
def test_is_equation_1(name, transformation, components):
    """In two steps, the second of which is shorter and the other way: signs are remembered."""
    scenario, last, state = ikgym.scenarios.get(name), None, None
    given = {"transformation": transformation, "iterations": 5, "d": 0.2, "slope": 0.4, "a": -0.004}
    given |= {"length": 1.0} if components is None else {"components": components}  # nothing is weighed in the paper
    policy = baselines.make("fixed_point", name, **given)
    for by in (2e-3, -1e-3):
        seen = away(np.linspace(0.2, 0.7, scenario.joints), by, name)
        q, state, _ = stepped(policy, seen, state)
        wanted, last = printed(scenario, seen["q"], seen["nominal"][0], -0.004, transformation, components, last)
        np.testing.assert_allclose(q - seen["q"], wanted - seen["q"], rtol=1e-5, atol=1e-12)


def test_converges_up_to_the_limit_and_not_beyond():
    """|A| < 4 / σ_max², at the solution, which is not quite q."""
    observation = away(Q)
    largest = np.linalg.norm(ikgym.arms.get("faitli3").jacobian(Q + 1e-3)[:3], 2)
    for share, converges in ((0.97, True), (1.03, False)):
        policy = baselines.make("fixed_point", REGULAR, a=-4.0 * share / largest**2, iterations=3000, tolerance=1e-9)
        _, _, status = stepped(policy, observation)
        assert (status == Status.CONVERGED) == converges


def test_the_wrong_sign_diverges_and_says_so():
    policy = baselines.make("fixed_point", REGULAR, a=1.0, iterations=200)
    q, state, status = stepped(policy, away())
    assert status == Status.DIVERGED
    np.testing.assert_array_equal(q, Q)
    assert np.isfinite(state[0]).all()


@pytest.mark.parametrize("transformation", ["transpose", "none", "sign"])
def test_at_the_solution_nothing_moves(transformation):
    """‖h‖ = 0 exactly; and where h is no larger than rounding the step is not, either."""
    observation = observed(REGULAR, Q)
    observation["nominal"] = observation["pose"][None]
    policy = baselines.make("fixed_point", REGULAR, transformation=transformation)
    q, _, status = stepped(policy, observation)
    assert status == Status.CONVERGED
    np.testing.assert_array_equal(q, Q)
    observation["nominal"] = np.nextafter(observation["nominal"], 9.0)
    q, _, status = stepped(policy, observation)
    assert status == Status.CONVERGED
    np.testing.assert_allclose(q, Q, atol=1e-14)


def test_stagnation_at_a_singularity_is_not_convergence():
    """Stretched out, a target further out along the arm: Jᵀ (f - x) = 0, and f ≠ x."""
    observation = observed(REGULAR, np.zeros(3))
    observation["nominal"] = observation["pose"][None] + [[0.1, 0.0, 0.0]]
    q, _, status = stepped(baselines.make("fixed_point", REGULAR, iterations=100), observation)
    assert status == Status.ITERATION_LIMIT
    np.testing.assert_array_equal(q, 0.0)


@pytest.mark.parametrize("name", ["varga7-fast", "khan8-q1", "zhang6-lspb", "tiago-raster", "panda-glue"])
def test_the_bound_of_the_jacobian_holds_and_a_is_left_to_it(name):
    scenario = ikgym.scenarios.get(name)
    policy = baselines.make("fixed_point", scenario)
    bound = policy._jacobian_bound()
    rng = np.random.default_rng(0)
    for _ in range(50):
        q = np.where(scenario.model.prismatic, 0.0, rng.uniform(-3, 3, scenario.joints))
        rotation, _, geometric = scenario.model.forward_and_jacobian(q)
        jacobian = scenario.task.jacobian(rotation, geometric)
        jacobian *= np.sqrt(error_weights(scenario.task, policy.length))[:, None]
        assert np.linalg.norm(jacobian) ** 2 <= bound
    assert policy.a == pytest.approx(-min(1.0, 4.0 / bound))


def test_a_is_the_papers_on_the_papers_arm_and_turns_with_the_slope():
    assert baselines.make("fixed_point", REGULAR).a == -1.0
    assert baselines.make("fixed_point", REGULAR, slope=-0.5).a == 1.0
    assert jacobian_bound(ikgym.arms.get("faitli3"), None) == pytest.approx(1.3**2 + 1.3**2 + 0.5**2)


def largest_error(transformation, a, steps=3000):
    scenario = ikgym.scenarios.get(BENT).replace(steps=steps)
    given = {"transformation": transformation, "a": a, "iterations": 1, "components": (0, 1)}
    track = baselines.track(scenario, baselines.make("fixed_point", scenario, **given))
    return track.position_error[scenario.counted()[1:]].max()


def test_the_sign_works_for_two_joints():
    """Where both eigenvalues keep one sign: without a Jacobian, and by growth whatever the sign of A."""
    assert largest_error("sign", 1.0) < 1e-3
    assert largest_error("sign", -1.0, 1000) > 0.1
    for a in (1.0, -1.0):
        assert largest_error("sign_by_growth", a) < 5e-3
