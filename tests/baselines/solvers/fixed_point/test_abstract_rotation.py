"""Khan's method on arms that move, against the paper written down once more in plain NumPy."""

import gymnasium as gym
import numpy as np
import pytest

import baselines
import ikgym
from baselines.status import Status
from tests.baselines.solvers.fixed_point.test_rotations import listing, rotation

KHAN = "khan8-q1"


def jacobian(scenario, q):
    """∂f/∂q of the model, by central differences of the coordinates."""
    out = np.empty((scenario.task.size, scenario.joints))
    for j, shift in enumerate(1e-6 * np.eye(scenario.joints)):
        up, down = (scenario.task.coordinates(*scenario.model.forward(x)) for x in (q + shift, q - shift))
        out[:, j] = (up - down) / 2e-6
    return out


def printed(scenario, observation, last, at, parameters):
    """One inner iteration of section 4.1, of eq. 3.16 or of eq. 2.9, with matrices; the Jacobian belongs to `at`."""
    q, f, target = observation["q"], observation["pose"], observation["nominal"][0]
    counter = parameters.get("counter_rotation", "joints")
    forces, weights = (np.ones(size) * parameters.get(f"{name}_weights", 1.0) for name, size in sizes(scenario))
    transposed = jacobian(scenario, at).T @ np.diag(forces)
    h = forces * (target - f) if counter == "task" else transposed @ (target - f)
    n, angle = (np.eye(len(h)), 0.0) if counter == "none" else rotation(h, last)[:2]
    map_ = np.diag(weights) @ (transposed @ n if counter == "task" else n @ transposed)
    if parameters.get("deformation") == "contraction":
        return q + 5e-4 * map_ @ (target - f), h, angle, np.nan
    following, other = listing(map_ @ f, q, map_ @ target, 100.0, 5e-4, 1e-12, 1e3)
    return following, h, angle, other


def sizes(scenario):
    return ("task", scenario.task.size), ("joint", scenario.joints)


CONTRACTION = {"deformation": "contraction"}


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        (KHAN, {}),
        (KHAN, {"counter_rotation": "none"}),
        ("khan8-q7q8", {"task_weights": (0.5,) * 9 + (1.0,) * 3}),
        ("khan8-q7q8", {"joint_weights": (1.0,) * 6 + (0.01,) * 2}),
        ("varga7-fast", {"task_weights": 0.3, "joint_weights": 0.7}),
        ("zhang6-lspb", {}),
        (KHAN, CONTRACTION),
        (KHAN, CONTRACTION | {"counter_rotation": "none"}),
        (KHAN, {"counter_rotation": "task"}),
        (KHAN, CONTRACTION | {"counter_rotation": "task"}),
        (KHAN, {"jacobian": "point"}),
        (KHAN, CONTRACTION | {"counter_rotation": "task", "jacobian": "point"}),
    ],
)
def test_is_what_the_paper_prints(name, parameters):
    """In all readings. The points of khan8-q1 are held for 60 steps, of which the second begins at step 60."""
    scenario = ikgym.scenarios.get(name).replace(steps=62)
    policy = baselines.make("abstract_rotation", scenario, lambda_a=5e-4, **parameters)
    env = gym.make("RedundantIK-v0", scenario=scenario, preview=1)
    observation, _ = env.reset()
    state, at = None, None
    last = np.zeros(scenario.task.size if parameters.get("counter_rotation") == "task" else scenario.joints)
    for k in range(62):
        if policy.jacobian == "step" or k in (0, 60):
            at = observation["q"]
        wanted, last, *angles = printed(scenario, observation, last, at, parameters)
        action, state = policy.predict(observation, state)
        qdot = action * scenario.velocity_limit
        np.testing.assert_allclose(qdot, (wanted - observation["q"]) / scenario.dt, rtol=1e-4, atol=1e-6)
        np.testing.assert_allclose(state[2][0], last, rtol=1e-6, atol=1e-7)
        np.testing.assert_allclose(np.ravel(list(policy.diagnostics(state).values())), angles, rtol=1e-5, atol=2e-6)
        observation, *_ = env.step(action)


def observed(name, q):
    scenario = ikgym.scenarios.get(name)
    return gym.make("RedundantIK-v0", scenario=scenario, preview=1).reset(options={"q": q})[0]


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
    assert np.isnan(policy.diagnostics(state)["angle_abstract_rotation"]).tolist() == [True, False]
