"""Khan's method on arms that move, against the paper written down once more in plain NumPy."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.status import Status
from ikgym.exceptions import InvalidInputError, UnknownNameError
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


def test_the_model_is_told_and_the_arm_is_measured():
    """Two arms with one model: the answer depends on the pose, not on the arm behind it."""
    scenario = ikgym.scenarios.get(KHAN)
    assert scenario.model is not scenario.arm
    other = scenario.replace(arm=ikgym.arms.get("khan8_approximate"), model=scenario.model)
    here, there = (baselines.make("abstract_rotation", s) for s in (scenario, other))
    observation = observed(KHAN, np.full(8, 0.1))
    assert identical(here.predict(observation), there.predict(observation))
    moved = {**observation, "pose": observation["pose"] + 1e-3}
    assert not identical(here.predict(observation)[0], here.predict(moved)[0])


def episode(policy, name, steps):
    scenario = ikgym.scenarios.get(name).replace(steps=steps)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    observation, _ = env.reset()
    state, rows = None, []
    for _ in range(steps):
        action, state = policy.predict(observation, state)
        observation, _, _, _, info = env.step(action)
        angles = policy.angles(state)
        rows.append(
            (
                info["position_error"],
                info["orientation_error"],
                angles.counter_rotation[0],
                angles.abstract_rotation[0],
                *observation["q"],
            )
        )
        assert policy.report(state).status[0] == Status.ITERATION_LIMIT
    return np.array(rows)


def test_the_initial_position_error_relaxes():
    """What happens in section 4.2: position 1.55 m at first, below 0.25 m after 50 points; the orientation is right
    at first and is turned away by 0.25 rad meanwhile."""
    rows = episode(baselines.make("abstract_rotation", KHAN), KHAN, 1000)
    assert rows[0, 0] > 1.5
    assert rows[-1, 0] < 0.25
    assert rows[0, 1] < 0.01
    assert 0.2 < rows[-1, 1] < 0.3
    assert rows[0, 2] == 0.0
    assert (rows[1:, 2] > 0.0).any()
    assert (rows[:, 3] > 0.0).all()


def test_small_weights_block_joints():
    free = episode(baselines.make("abstract_rotation", KHAN), KHAN, 1000)
    weights = (1.0,) * 6 + (0.01,) * 2
    blocked = episode(baselines.make("abstract_rotation", KHAN, joint_weights=weights), KHAN, 1000)
    assert (abs(free[:, 10:]).max(axis=0) > 0.15).all()
    assert (abs(blocked[:, 10:]).max(axis=0) < 0.01).all()


def test_orientation_weighted_down_is_less_precise():
    free = episode(baselines.make("abstract_rotation", KHAN), KHAN, 1000)
    weights = (0.5,) * 9 + (1.0,) * 3
    weighted = episode(baselines.make("abstract_rotation", KHAN, task_weights=weights), KHAN, 1000)
    assert weighted[-1, 1] > 1.1 * free[-1, 1]
    assert weighted[-1, 0] < 0.9 * free[-1, 0]


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


def test_angles_are_copies_and_cost_nothing():
    policy = baselines.make("abstract_rotation", KHAN)
    _, state = policy.predict(observed(KHAN, np.zeros(8)))
    policy.angles(state).counter_rotation[0] = 9.0
    assert policy.angles(state).counter_rotation[0] == 0.0


def test_weights_are_not_aliased():
    weights = np.ones(8)
    policy = baselines.make("abstract_rotation", KHAN, joint_weights=weights)
    weights[:] = 0.5
    assert policy.parameters["joint_weights"] == (1.0,) * 8
    assert identical(policy.predict(observed(KHAN, np.zeros(8)))[0], plain_action())
    with pytest.raises(dataclasses.FrozenInstanceError):
        policy.joint_weights = 0.5


def plain_action():
    return baselines.make("abstract_rotation", KHAN).predict(observed(KHAN, np.zeros(8)))[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"r_a": 0.0}, "r_a: expected a finite number above 0"),
        ({"lambda_a": -1e-3}, "lambda_a: expected a finite number above 0"),
        ({"epsa": 0.0}, "epsa: expected a finite number above 0"),
        ({"q_pp_max": np.inf}, "q_pp_max: expected a finite number above 0, got inf"),
        ({"tolerance": -1.0}, "tolerance: expected a finite number of at least 0"),
        ({"task_weights": 0.0}, "task_weights: expected numbers above 0 and at most 1, got 0.0"),
        ({"task_weights": (1.0,) * 8}, r"task_weights: expected shape \(12,\), got \(8,\)"),
        ({"joint_weights": (1.0,) * 7 + (1.5,)}, "joint_weights: expected numbers above 0 and at most 1, got"),
        ({"joint_weights": "no"}, "joint_weights: expected an array of real numbers"),
    ],
)
def test_bad_parameters(change, message):
    with pytest.raises(InvalidInputError, match=message):
        baselines.make("abstract_rotation", KHAN, **change)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"counter_rotation": True}, "no counter_rotation True. Available: none, joints, task"),
        ({"counter_rotation": "joint"}, "Did you mean 'joints'"),
        ({"deformation": "rotations"}, "Did you mean 'rotation'"),
        ({"jacobian": "points"}, "Did you mean 'point'"),
    ],
)
def test_unknown_names(change, message):
    with pytest.raises(UnknownNameError, match=message):
        baselines.make("abstract_rotation", KHAN, **change)
