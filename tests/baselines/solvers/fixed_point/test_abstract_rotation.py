"""Khan's method on arms that move, against the paper written down once more in plain NumPy."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.status import Status
from tests.baselines.solvers.fixed_point.test_rotations import listing, rotation
from tests.comparison import identical

KHAN = "khan8-q1"


def jacobian(scenario, q):
    """∂f/∂q of the model, by central differences of the coordinates."""
    out = np.empty((scenario.task.size, scenario.joints))
    for j, shift in enumerate(1e-6 * np.eye(scenario.joints)):
        up, down = (scenario.task.coordinates(*scenario.model.forward(x)) for x in (q + shift, q - shift))
        out[:, j] = (up - down) / 2e-6
    return out


def printed(scenario, observation, last, task_weights, joint_weights, counter=True):
    """One inner iteration of section 4.1, with matrices."""
    q, f, target = observation["q"], observation["pose"], observation["nominal"][0]
    transposed = jacobian(scenario, q).T @ np.diag(task_weights)
    h = transposed @ (target - f)
    n, angle = rotation(h, last)[:2] if counter else (np.eye(len(q)), 0.0)
    w = np.diag(joint_weights)
    following, szog = listing(w @ n @ transposed @ f, q, w @ n @ transposed @ target, 100.0, 5e-4, 1e-12, 1e3)
    return following, h, angle, szog


@pytest.mark.parametrize(
    ("name", "task_weights", "joint_weights", "counter"),
    [
        (KHAN, 1.0, 1.0, True),
        (KHAN, 1.0, 1.0, False),
        ("khan8-q7q8", (0.5,) * 9 + (1.0,) * 3, 1.0, True),
        ("khan8-q7q8", 1.0, (1.0,) * 6 + (0.01,) * 2, True),
        ("varga7-fast", 0.3, 0.7, True),
        ("zhang6-lspb", 1.0, 1.0, True),
    ],
)
def test_is_what_the_paper_prints(name, task_weights, joint_weights, counter):
    scenario = ikgym.scenarios.get(name).replace(steps=80)
    policy = baselines.make(
        "abstract_rotation",
        scenario,
        lambda_a=5e-4,
        task_weights=task_weights,
        joint_weights=joint_weights,
        counter_rotation="joints" if counter else "none",
    )
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    observation, _ = env.reset()
    weights = np.broadcast_to(task_weights, scenario.task.size), np.broadcast_to(joint_weights, scenario.joints)
    state, h = None, np.zeros(scenario.joints)
    for _ in range(80):
        wanted, h, *wanted_angles = printed(scenario, observation, h, *weights, counter)
        action, state = policy.predict(observation, state)
        qdot = action * scenario.velocity_limit
        np.testing.assert_allclose(qdot, (wanted - observation["q"]) / scenario.dt, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(state[2][0], h, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(np.ravel(policy.angles(state)), wanted_angles, rtol=1e-5, atol=2e-6)
        observation, *_ = env.step(action)


def observed(name, q, **changes):
    scenario = ikgym.scenarios.get(name)
    observation, _ = gym.make("RedundantIK-v0", scenario=scenario, preview=1).reset(options={"q": q})
    return {**observation, **changes}


def test_weights_scale_the_step_as_written():
    """With R_a far away, 𝒲 halves a joint's step, and ℱ = ½ halves all of them."""
    observation = observed(KHAN, np.linspace(0.01, 0.08, 8))
    plain = {"r_a": 1e6, "q_pp_max": 1e6, "lambda_a": 1e-4}

    def step(**changes):
        return baselines.make("abstract_rotation", KHAN, **plain, **changes).predict(observation)[0]

    one = step()
    np.testing.assert_allclose(step(joint_weights=(1.0,) * 7 + (0.5,)), one * ([1.0] * 7 + [0.5]), rtol=1e-4)
    np.testing.assert_allclose(step(task_weights=0.5), 0.5 * one, rtol=1e-4)
    np.testing.assert_allclose(step(joint_weights=0.25), 0.25 * one, rtol=1e-4)


def test_the_counter_rotation_turns_into_the_last_direction_before_rotation():
    """With R_a far away the step is along h(n-1), as long as h(n) asks for."""
    policy = baselines.make("abstract_rotation", KHAN, r_a=1e6, q_pp_max=1e6, lambda_a=1e-5)
    first = observed(KHAN, np.full(8, 0.1))
    second = observed(KHAN, np.linspace(0.2, -0.3, 8))
    third = observed(KHAN, np.linspace(-0.1, 0.4, 8))
    scenario = ikgym.scenarios.get(KHAN)
    pulls = [jacobian(scenario, o["q"]).T @ (o["nominal"][0] - o["pose"]) for o in (first, second, third)]
    _, state = policy.predict(first)
    for observation, last, pull in ((second, pulls[0], pulls[1]), (third, pulls[1], pulls[2])):
        action, state = policy.predict(observation, state)
        step = action * scenario.velocity_limit * scenario.dt
        np.testing.assert_allclose(
            step, 1e-5 * np.linalg.norm(pull) * last / np.linalg.norm(last), rtol=1e-3, atol=1e-9
        )
    fresh, _ = policy.predict(second)
    again, _ = policy.predict(second, state, episode_start=np.array([True]))
    assert identical(fresh, again)
    assert not identical(fresh, policy.predict(second, state)[0])


def test_statuses():
    policy = baselines.make("abstract_rotation", KHAN)
    away = observed(KHAN, np.full(8, 0.1))
    solved = {**away, "nominal": away["pose"][None]}
    for observation, wanted in ((away, Status.ITERATION_LIMIT), (solved, Status.CONVERGED)):
        _, state = policy.predict(observation)
        assert policy.report(state).status[0] == wanted
    action, _ = policy.predict(solved)
    # What the tanh takes off: q³ / (3 q_pp_max²).
    np.testing.assert_allclose(action * 50.0 * 1e-3, -(0.1**3) / 3e6, rtol=1e-3)


def test_too_long_a_vector_stops_the_arm_and_says_so():
    policy = baselines.make("abstract_rotation", KHAN, r_a=20.0)
    observation = observed(KHAN, np.zeros(8))
    batch = {key: np.stack([value] * 2) for key, value in observation.items()}
    batch["pose"][1] = batch["nominal"][1, 0] = 0.0
    action, state = policy.predict(batch)
    assert policy.report(state).status.tolist() == [Status.NOT_A_ROTATION, Status.CONVERGED]
    np.testing.assert_array_equal(action, 0.0)
    assert np.isnan(policy.angles(state).abstract_rotation).tolist() == [True, False]


def variant(scenario, observation, last, at, counter, deformation):
    """One inner iteration of eq. 3.16 or eq. 2.9, with 𝒩 before or behind the Jacobian, which belongs to `at`."""
    q, f, target = observation["q"], observation["pose"], observation["nominal"][0]
    transposed = jacobian(scenario, at).T
    h = target - f if counter == "task" else transposed @ (target - f)
    n = np.eye(len(h)) if counter == "none" else rotation(h, last)[0]
    map_ = transposed @ n if counter == "task" else n @ transposed
    if deformation == "contraction":
        return q + 5e-4 * map_ @ (target - f), h
    return listing(map_ @ f, q, map_ @ target, 100.0, 5e-4, 1e-12, 1e3)[0], h


@pytest.mark.parametrize(
    ("counter", "deformation", "held"),
    [
        ("joints", "contraction", "step"),
        ("none", "contraction", "step"),
        ("task", "rotation", "step"),
        ("task", "contraction", "step"),
        ("joints", "rotation", "point"),
        ("task", "contraction", "point"),
    ],
)
def test_the_other_readings_are_what_they_say(counter, deformation, held):
    """The points of khan8-q1 are held for 60 steps, of which the second begins at step 60."""
    scenario = ikgym.scenarios.get(KHAN).replace(steps=80)
    policy = baselines.make(
        "abstract_rotation", scenario, counter_rotation=counter, deformation=deformation, jacobian=held
    )
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    observation, _ = env.reset()
    printed_policy, printed_state, apart = baselines.make("abstract_rotation", scenario), None, 0.0
    state, last, at = None, np.zeros(12 if counter == "task" else 8), None
    for k in range(80):
        if held == "step" or k in (0, 60):
            at = observation["q"]
        wanted, last = variant(scenario, observation, last, at, counter, deformation)
        action, state = policy.predict(observation, state)
        qdot = action * scenario.velocity_limit
        np.testing.assert_allclose(qdot, (wanted - observation["q"]) / scenario.dt, rtol=1e-4, atol=1e-6)
        assert np.isnan(policy.angles(state).abstract_rotation[0]) == (deformation == "contraction")
        other, printed_state = printed_policy.predict(observation, printed_state)
        apart = max(apart, abs((action - other) * scenario.velocity_limit).max())
        observation, *_ = env.step(action)
    assert apart > 1e-2, "not told apart from the printed method"


def test_a_held_jacobian_is_let_go_with_the_episode():
    policy = baselines.make("abstract_rotation", KHAN, jacobian="point")
    first, second = observed(KHAN, np.full(8, 0.1)), observed(KHAN, np.linspace(0.2, -0.3, 8))
    fresh, _ = policy.predict(second)
    _, state = policy.predict(first)
    assert not identical(policy.predict(second, state)[0], fresh)
    assert identical(policy.predict(second, state, episode_start=np.array([True]))[0], fresh)
