"""The files that an arm is written to are that arm: MuJoCo and Pinocchio say where its tool is."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import ikgym
from baselines.solvers.rivals.model_files import TIP, mjcf, roll_pitch_yaw, urdf
from ikgym.kernels.rotations import rodrigues
from tests.arms.drawing import postures
from tests.limited import limited

ARMS = [*map(ikgym.arms.get, ("panda-3", "tiago", "puma560")), limited().arm]
every_arm = pytest.mark.parametrize("arm", ARMS, ids=[arm.name for arm in ARMS])


@every_arm
def test_mjcf_has_the_kinematics_and_the_position_limits(arm):
    model = mujoco.MjModel.from_xml_string(mjcf(arm))
    data = mujoco.MjData(model)
    for q in postures(arm, 5):
        data.qpos = q
        mujoco.mj_kinematics(model, data)
        rotation, position = arm.forward(q)
        np.testing.assert_allclose(data.body(TIP).xpos, position, atol=1e-12)
        np.testing.assert_allclose(data.body(TIP).xmat.reshape(3, 3), rotation, atol=1e-12)
    limited = np.isfinite(arm.lower) | np.isfinite(arm.upper)
    assert model.jnt_limited.astype(bool).tolist() == limited.tolist()
    for finite, column in zip((np.isfinite(arm.lower), np.isfinite(arm.upper)), (0, 1), strict=True):
        given = (arm.lower, arm.upper)[column][finite]
        np.testing.assert_array_equal(model.jnt_range[finite, column], given)
    assert (model.jnt_type == np.where(arm.prismatic, mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)).all()


@every_arm
def test_urdf_has_the_kinematics_and_the_limits(arm):
    model = pin.buildModelFromXML(urdf(arm))
    data = model.createData()
    for q in postures(arm, 5):
        pin.framesForwardKinematics(model, data, q)
        tool = data.oMf[model.getFrameId(TIP)]
        rotation, position = arm.forward(q)
        np.testing.assert_allclose(tool.translation, position, atol=1e-12)
        np.testing.assert_allclose(tool.rotation, rotation, atol=1e-12)
    for mine, theirs in ((arm.lower, model.lowerPositionLimit), (arm.upper, model.upperPositionLimit)):
        np.testing.assert_array_equal(theirs[np.isfinite(mine)], mine[np.isfinite(mine)])
        assert (np.abs(theirs[~np.isfinite(mine)]) > 1e20).all()
    finite = np.isfinite(arm.velocity_limit)
    np.testing.assert_array_equal(model.velocityLimit[finite], arm.velocity_limit[finite])
    assert (model.velocityLimit[~finite] > 1e20).all()


@pytest.mark.parametrize("pitch", [0.3, -1.2, np.pi / 2, -np.pi / 2])
def test_roll_pitch_yaw_are_those_of_the_rotation(pitch):
    x, y, z = np.eye(3)
    rotation = rodrigues(z, 0.7) @ rodrigues(y, pitch) @ rodrigues(x, -0.4)
    roll, tilt, yaw = roll_pitch_yaw(rotation)
    again = rodrigues(z, yaw) @ rodrigues(y, tilt) @ rodrigues(x, roll)
    np.testing.assert_allclose(again, rotation, atol=1e-9)
