"""Any arm as a model of Pinocchio: an independent opinion on where its tool is."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from ikgym.arms import Arm


class ToolState(NamedTuple):
    """What Pinocchio says: rotation (3, 3), position (3,) in [m], Jacobian (6, n), linear rows first."""

    rotation: np.ndarray
    position: np.ndarray
    jacobian: np.ndarray


def model_of(arm: Arm) -> tuple[pin.Model, int]:
    """The model of an arm, and the number of its tool's frame."""
    model, parent = pin.Model(), 0
    for i, (offset, axis, prismatic) in enumerate(zip(arm.offsets, arm.axes, arm.prismatic, strict=True)):
        kind = pin.JointModelPrismaticUnaligned if prismatic else pin.JointModelRevoluteUnaligned
        parent = model.addJoint(parent, kind(axis), pin.SE3(np.eye(3), offset), f"joint{i}")
    tool = pin.SE3(arm.tool_rotation, arm.tool)
    return model, model.addFrame(pin.Frame("tool", parent, 0, tool, pin.FrameType.OP_FRAME))


def tool_state(model: pin.Model, frame: int, q: np.ndarray) -> ToolState:
    """Forward kinematics and Jacobian at the origin of a frame, in the axes of the base."""
    data = model.createData()
    jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
    placement = pin.updateFramePlacement(model, data, frame)
    return ToolState(placement.rotation.copy(), placement.translation.copy(), jacobian.reshape(6, -1).copy())
