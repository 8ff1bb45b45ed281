"""Bodies of the arms of makers."""

import numpy as np
import pytest

from ikgym import arms
from tests.arms.drawing import postures

WITH_BODIES = tuple(name for name in arms.names() if len(arms.get(name).bodies))


def test_every_arm_of_a_maker_has_bodies():
    assert set(WITH_BODIES) == {name for name in arms.names() if arms.get(name).home is not None}


@pytest.mark.parametrize("name", WITH_BODIES)
def test_home_is_clear_and_most_postures_are(name):
    arm = arms.get(name)
    assert arm.clearance(arm.home)[0] > 0.05
    assert np.mean(arm.clearance(postures(arm, 500, seed=0))[0] < 0.0) < 0.4
    assert set(range(arm.joints)) <= set(arm.bodies.links), "only a thin last link may have no body"


def test_the_hand_of_the_panda_meets_its_forearm():
    # The flange is folded back, and the hand lies across the forearm.
    arm = arms.get("panda-hand")
    folded = np.array([0, 0.5, 0, -3.0, 0, 0.0, 0.8])
    distance, pair = arm.clearance(folded)
    assert distance < 0.0, [arm.bodies.names[i] for i in pair]
