import numpy as np
import pytest

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError


def test_replace_changes_a_copy_and_checks_it():
    arm = Arm("two", [[0, 0, 1], [1, 0, 0]], [[0, 0, 1], [1, 0, 0]], (False, True), tool=[0.5, 0, 0])
    other = arm.replace(name="longer", tool=[2, 0, 0])
    assert other.name == "longer"
    np.testing.assert_array_equal(other.forward([0, 0])[1] - arm.forward([0, 0])[1], [1.5, 0, 0])
    assert arm.name == "two"
    with pytest.raises(InvalidInputError, match="Arm 'two': tool"):
        arm.replace(tool=[2, 0])


def test_a_copy_is_the_arm_bit_for_bit():
    """Unit vectors whose length rounds to another number than 1 are not divided by it again."""
    axes = np.random.default_rng(0).normal(size=(200, 3))
    arm = Arm("many", np.zeros((200, 3)), axes / np.linalg.norm(axes, axis=1)[:, None])
    np.testing.assert_array_equal(arm.replace(name="copy").axes, arm.axes)
    rough = Arm("rough", np.zeros((200, 3)), arm.axes * (1 + 1e-9))
    np.testing.assert_array_equal(rough.replace(name="copy").axes, rough.axes)
    assert (np.linalg.norm(rough.axes, axis=1) - 1).max() < 1e-15
