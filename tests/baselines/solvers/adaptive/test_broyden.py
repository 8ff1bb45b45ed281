"""Broyden's formula: secant, smallest change, standing still, and a wrong model."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.status import Status
from tests.baselines.solvers.adaptive.arms import observed


@pytest.mark.parametrize("name", ["varga7-fast", "khan8-q1", "tiago-raster"])
def test_secant_and_smallest_change(name):
    scenario = ikgym.scenarios.get(name)
    policy = baselines.make("broyden", scenario, motion=1e-12)
    rng = np.random.default_rng(0)
    q, moved = rng.uniform(-1, 1, scenario.joints), rng.uniform(-0.01, 0.01, scenario.joints)
    first, second = (observed(scenario, scenario.arm, 0.0, at) for at in (q, q + moved))
    _, state = policy.predict(first)
    _, after = policy.predict(second, state)
    rotation, _, geometric = scenario.model.forward_and_jacobian(q + moved)
    before = scenario.task.jacobian(rotation, geometric)
    learnt = before + after[4][0]
    np.testing.assert_allclose(learnt @ moved, scenario.task.error(second["pose"], first["pose"]), atol=1e-12)
    np.testing.assert_array_equal(state[4][0], 0.0)
    # Nothing is learnt across the motion.
    across = np.linalg.svd(moved[None])[2][1:].T
    np.testing.assert_allclose((learnt - before) @ across, 0.0, atol=1e-9 * np.linalg.norm(before))


def test_short_motions_teach_little_and_none_teaches_nothing():
    scenario = ikgym.scenarios.get("khan8-q1")
    policy = baselines.make("broyden", scenario, motion=1e-3)
    q, learnt = np.full(8, 0.3), {}
    observation = observed(scenario, scenario.arm, 0.0, q)
    _, state = policy.predict(observation)
    for length in (0.0, 1e-6, 1e-3, 1e-1):
        _, after = policy.predict(observed(scenario, scenario.arm, 0.0, q + length * np.eye(8)[2]), state)
        learnt[length] = np.linalg.norm(after[4])
    assert learnt[1e-6] < 1e-4 * learnt[1e-1]
    assert learnt[1e-3] == pytest.approx(0.5 * learnt[1e-1], rel=0.1)
    # Nor does a pose that jumped without a motion of the joints.
    _, after = policy.predict({**observation, "pose": observation["pose"] + 0.1}, state)
    assert learnt[0.0] == np.abs(after[4]).max() == 0.0


def test_beats_the_model_that_it_starts_from():
    """On Khan's arm, which is not the model, with the point held: the final errors of the two."""
    scenario = ikgym.scenarios.get("khan8-q1").replace(steps=1200)
    last = {name: rollout(scenario, baselines.make(name, scenario), 0) for name in ("dls", "broyden")}
    errors = {name: episode.position_error[-600:].max() for name, episode in last.items()}
    assert errors["broyden"] < 0.1 * errors["dls"]
    assert Status.DIVERGED not in last["broyden"].status
