import numpy as np

from ikgym.arms import Arm


def test_a_copy_is_the_arm_bit_for_bit():
    """Unit vectors whose length rounds to another number than 1 are not divided by it again."""
    axes = np.random.default_rng(0).normal(size=(200, 3))
    arm = Arm("many", np.zeros((200, 3)), axes / np.linalg.norm(axes, axis=1)[:, None])
    np.testing.assert_array_equal(arm.replace(name="copy").axes, arm.axes)
    rough = Arm("rough", np.zeros((200, 3)), arm.axes * (1 + 1e-9))
    np.testing.assert_array_equal(rough.replace(name="copy").axes, rough.axes)
    assert (np.linalg.norm(rough.axes, axis=1) - 1).max() < 1e-15
