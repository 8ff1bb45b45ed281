"""The scenarios with bodies can be played: a joint motion follows each path and touches nothing."""

import numpy as np
import pytest

import ikgym
from tests.scenarios.clear_motions import between, clearances, controls, motion, shares

MOTIONS = controls()
#: What every motion keeps from everything, in [m].
MARGIN = 0.02


def test_each_path_has_a_motion():
    paths = {name for name in ikgym.scenarios.names("bodies") if not ikgym.scenarios.get(name).random}
    assert paths == {*MOTIONS}


@pytest.mark.parametrize("name", MOTIONS)
def test_the_motion_follows_the_path_within_the_limits_and_is_clear(name):
    scenario = ikgym.scenarios.get(name)
    q, converged = motion(scenario, MOTIONS[name])
    assert converged
    np.testing.assert_allclose(q[0], scenario.start, atol=1e-5)
    assert max(shares(scenario, q)) < 1.0
    distances, _ = clearances(scenario, q)
    assert distances.min() > MARGIN
    assert between(scenario, q, distances).min() > MARGIN - 0.002


@pytest.mark.parametrize("name", MOTIONS)
def test_a_solver_that_knows_no_bodies_is_stopped(name):
    """Else the bodies would not matter."""
    import baselines

    scenario = ikgym.scenarios.get(name)
    played = baselines.track(scenario.replace(collisions=False), "dls")
    distances, _ = clearances(scenario, np.vstack([scenario.start, played.q]))
    assert distances[0] > 0.015
    assert distances.min() < 0.0
