"""The table `kinematics`: forward kinematics and Jacobian of `varga7` at random configurations, one thread."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numba import njit

import ikgym
from docs.keeping import Line
from docs.timing import medians
from ikgym.kernels.kinematics import forward_and_jacobian

BATCH = 1000


@njit
def _loop(chain, q, rotation, position, jacobian):  # type: ignore[no-untyped-def]
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, jacobian)


def measure(**effort: Any) -> list[Line]:
    """The table."""
    arm = ikgym.arms.get("varga7")
    q = np.random.default_rng(0).uniform(-1, 1, (BATCH, arm.joints))
    rotation, position, jacobian = np.empty((3, 3)), np.empty(3), np.empty((6, arm.joints))
    model, frame = pinocchio_model(arm)
    data = model.createData()

    def pinocchio() -> None:
        pin.computeJointJacobians(model, data, q[0])
        pin.updateFramePlacement(model, data, frame)
        pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)

    calls = {
        "ikgym, in a compiled loop": (lambda: _loop(arm.chain, q, rotation, position, jacobian), BATCH),
        f"ikgym, `Arm.forward_and_jacobian`, {BATCH:,} poses": (lambda: arm.forward_and_jacobian(q), BATCH),
        "Pinocchio, one call": (pinocchio, 1),
        "ikgym, `Arm.forward_and_jacobian`, one pose": (lambda: arm.forward_and_jacobian(q[0]), 1),
    }
    times = medians({name: call for name, (call, _) in calls.items()}, **effort)
    return [{"library": name, "pose_us": 1e6 * times[name] / poses} for name, (_, poses) in calls.items()]


def pinocchio_model(arm: ikgym.Arm) -> tuple[pin.Model, int]:
    """The arm for Pinocchio, and the number of its tool frame."""
    model, parent = pin.Model(), 0
    for offset, axis, prismatic in zip(arm.offsets, arm.axes, arm.prismatic, strict=True):
        joint = pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), offset), f"joint{parent + 1}")
    tool = pin.SE3(np.array(arm.tool_rotation), np.array(arm.tool))
    return model, model.addFrame(pin.Frame("tool", parent, 0, tool, pin.FrameType.OP_FRAME))
