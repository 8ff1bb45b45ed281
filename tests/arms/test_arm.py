import copy
import pickle

import numpy as np
import pytest

from ikgym import arms
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError

every_arm = pytest.mark.parametrize("arm", [arms.get(name) for name in arms.names()], ids=arms.names())

ARRAYS = ("offsets", "axes", "tool", "tool_rotation", "lower", "upper", "velocity_limit", "acceleration_limit")


def parts(**changes):
    """The arguments of an arm with a revolute and a prismatic joint."""
    return {
        "name": "two",
        "offsets": [[0.0, 0, 1], [1, 0, 0]],
        "axes": [[0.0, 0, 1], [1, 0, 0]],
        "prismatic": (False, True),
        "tool": [0.5, 0, 0],
    } | changes


def test_arrays_are_no_aliases_of_the_input():
    given = {
        "offsets": np.array([[0.0, 0, 1], [1, 0, 0]]),
        "axes": np.array([[0.0, 0, 1], [1, 0, 0]]),
        "prismatic": np.array([False, True]),
        "tool": np.array([0.5, 0, 0]),
        "tool_rotation": np.eye(3),
        "lower": np.array([-1.0, -2]),
        "upper": np.array([1.0, 2]),
        "velocity_limit": np.array([3.0, 4]),
        "acceleration_limit": np.array([5.0, 6]),
    }
    arm = Arm("two", **given)
    for field, array in given.items():
        before = array.copy()
        array[...] = False
        np.testing.assert_array_equal(getattr(arm, field), before)


@every_arm
def test_copies_are_equal_and_read_only(arm):
    other = pickle.loads(pickle.dumps(copy.deepcopy(arm)))
    assert (other.name, other.prismatic, other.joint_names) == (arm.name, arm.prismatic, arm.joint_names)
    for field in ARRAYS:
        np.testing.assert_array_equal(getattr(other, field), getattr(arm, field))
    for one in (arm, other):
        assert not any(array.flags.writeable for array in (*(getattr(one, field) for field in ARRAYS), *one.chain))
    q = np.linspace(-1, 1, arm.joints)
    for one, theirs in zip(arm.forward_and_jacobian(q), other.forward_and_jacobian(q), strict=True):
        np.testing.assert_array_equal(one, theirs)


def test_replace_changes_a_copy_and_checks_it():
    arm = Arm(**parts())
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
