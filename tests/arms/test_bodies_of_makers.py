"""Bodies of the arms of makers."""

import numpy as np
import pytest

from ikgym import arms

WITH_BODIES = tuple(name for name in arms.names() if len(arms.get(name).bodies))


def postures(arm, count):
    lower, upper = (np.where(np.isfinite(each), each, s * np.pi) for each, s in ((arm.lower, -1), (arm.upper, 1)))
    return np.random.default_rng(0).uniform(lower, upper, (count, arm.joints))


def test_every_arm_of_a_maker_has_bodies():
    assert set(WITH_BODIES) == {name for name in arms.names() if arms.get(name).home is not None}


@pytest.mark.parametrize("name", WITH_BODIES)
def test_home_is_clear_and_most_postures_are(name):
    arm = arms.get(name)
    assert arm.clearance(arm.home)[0] > 0.05
    assert np.mean(arm.clearance(postures(arm, 500))[0] < 0.0) < 0.4


@pytest.mark.parametrize("name", WITH_BODIES)
def test_every_moving_link_but_a_thin_last_one_has_a_body(name):
    arm = arms.get(name)
    assert set(range(arm.joints)) <= set(arm.bodies.links)


def test_the_hand_of_the_panda_meets_its_forearm():
    # The flange is folded back, and the hand lies across the forearm.
    arm = arms.get("panda-hand")
    folded = np.array([0, 0.5, 0, -3.0, 0, 0.0, 0.8])
    distance, pair = arm.clearance(folded)
    assert distance < 0.0, [arm.bodies.names[i] for i in pair]
