"""Broyden's formula: secant, smallest change, standing still, and a wrong model."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status


def observe(scenario, q, target):
    """What the true arm shows."""
    return {
        "q": q,
        "qdot": np.zeros(scenario.joints),
        "pose": scenario.task.coordinates(*scenario.arm.forward(q)),
        "nominal": target[None],
        "remaining": np.ones(1),
    }


def model_jacobian(scenario, q):
    rotation, _, geometric = scenario.model.forward_and_jacobian(q)
    return scenario.task.jacobian(rotation, geometric)


@pytest.mark.parametrize("name", ["varga7-fast", "khan8-q1", "zhang6-lspb", "tiago-raster"])
def test_secant_and_smallest_change(name):
    scenario = ikgym.scenarios.get(name)
    policy = baselines.make("broyden", scenario, motion=1e-12)
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, scenario.joints)
    first = observe(scenario, q, scenario.nominal(1)[0])
    _, state = policy.predict(first)
    moved = rng.uniform(-0.01, 0.01, scenario.joints)
    second = observe(scenario, q + moved, scenario.nominal(1)[1])
    _, after = policy.predict(second, state)
    before = model_jacobian(scenario, q + moved)
    learnt = before + after[4][0]
    dy = scenario.task.error(second["pose"], first["pose"])
    np.testing.assert_allclose(learnt @ moved, dy, atol=1e-12)
    np.testing.assert_array_equal(state[4][0], 0.0)
    # Nothing is learnt across the motion.
    across = np.linalg.svd(moved[None])[2][1:].T
    np.testing.assert_allclose((learnt - before) @ across, 0.0, atol=1e-9 * np.linalg.norm(before))


def test_nothing_is_learnt_where_the_arm_stands_still():
    scenario = ikgym.scenarios.get("khan8-q1")
    policy = baselines.make("broyden", scenario)
    observation = observe(scenario, np.full(8, 0.3), scenario.nominal()[0])
    _, state = policy.predict(observation)
    _, after = policy.predict(observation, state)
    np.testing.assert_array_equal(after[4], state[4])
    # A pose that jumped without a motion of the joints, say by another measurement, teaches nothing either.
    _, after = policy.predict({**observation, "pose": observation["pose"] + 0.1}, state)
    np.testing.assert_array_equal(after[4], state[4])
    assert np.isfinite(after[4]).all()


def test_short_motions_teach_little():
    scenario = ikgym.scenarios.get("khan8-q1")
    policy = baselines.make("broyden", scenario, motion=1e-3)
    q, step = np.full(8, 0.3), np.eye(8)[2]
    _, state = policy.predict(observe(scenario, q, scenario.nominal()[0]))
    learnt = {}
    for length in (1e-6, 1e-3, 1e-1):
        _, after = policy.predict(observe(scenario, q + length * step, scenario.nominal()[0]), state)
        learnt[length] = np.linalg.norm(after[4])
    assert learnt[1e-6] < 1e-4 * learnt[1e-1]
    assert learnt[1e-3] == pytest.approx(0.5 * learnt[1e-1], rel=0.1)


def test_beats_the_model_that_it_starts_from():
    """On Khan's arm, which is not the model, with the point held: the final errors of the two."""
    scenario = ikgym.scenarios.get("khan8-q1").replace(steps=2000)
    last = {name: rollout(scenario, baselines.make(name, scenario), 0) for name in ("dls", "broyden")}
    errors = {name: episode.position_error[-1000:].max() for name, episode in last.items()}
    assert errors["broyden"] < 0.1 * errors["dls"]
    assert Status.DIVERGED not in last["broyden"].status


def test_is_dls_where_the_model_is_right():
    scenario = ikgym.scenarios.get("faitli3-regular").replace(steps=500)
    one, other = (rollout(scenario, baselines.make(name, scenario), 0) for name in ("dls", "broyden"))
    np.testing.assert_allclose(one.q, other.q, atol=1e-4)
    assert not np.array_equal(one.q, other.q)
