"""Forward kinematics and Jacobians beside Pinocchio, inside and outside of compiled loops."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
from numba import njit

import ikgym
from benchmarks.effort import FULL, Effort
from benchmarks.table import Column, Table
from benchmarks.timing import medians
from ikgym.kernels.kinematics import forward_and_jacobian

LOOP = 1000


def tables(effort: Effort = FULL) -> list[Table]:
    """Forward kinematics and Jacobian of 7 joints."""
    calls = kinematics()
    times = medians({name: call for name, (call, _) in calls.items()}, effort.rounds, effort.seconds)
    per_pose = {name: t / calls[name][1] for name, t in times.items()}
    fastest = next(iter(per_pose.values()))
    return [
        Table(
            "kinematics",
            "Forward kinematics and Jacobian, 7 joints",
            "The arm varga7 at random configurations, one thread, medians.",
            (Column("pose_us", "per pose", "µs"), Column("ratio", "× compiled loop")),
            {name: (1e6 * t, t / fastest) for name, t in per_pose.items()},
        )
    ]


@njit
def _loop(chain, q, rotation, position, jacobian):
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, jacobian)


def kinematics(name: str = "varga7") -> dict[str, tuple[Callable[[], object], int]]:
    """Calls by name, with how many poses each works out."""
    arm = ikgym.arms.get(name)
    q = np.random.default_rng(0).uniform(-1, 1, (LOOP, arm.joints))
    rotation, position, jacobian = np.empty((3, 3)), np.empty(3), np.empty((6, arm.joints))
    model, frame = pinocchio_model(arm)
    data = model.createData()

    def pinocchio() -> None:
        pin.computeJointJacobians(model, data, q[0])
        pin.updateFramePlacement(model, data, frame)
        pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)

    return {
        "ikgym kernel, in a compiled loop": (lambda: _loop(arm.chain, q, rotation, position, jacobian), LOOP),
        "ikgym Arm, a batch of 1000": (lambda: arm.forward_and_jacobian(q), LOOP),
        "ikgym Arm, one call": (lambda: arm.forward_and_jacobian(q[0]), 1),
        "Pinocchio, one call": (pinocchio, 1),
    }


def pinocchio_model(arm: ikgym.Arm) -> tuple[pin.Model, int]:
    """The same arm for Pinocchio, and the number of its tool frame."""
    model, parent = pin.Model(), 0
    for offset, axis, prismatic in zip(arm.offsets, arm.axes, arm.prismatic, strict=True):
        joint = pin.JointModelPrismaticUnaligned(axis) if prismatic else pin.JointModelRevoluteUnaligned(axis)
        parent = model.addJoint(parent, joint, pin.SE3(np.eye(3), offset), f"joint{parent + 1}")
    tool = pin.SE3(np.array(arm.tool_rotation), np.array(arm.tool))
    return model, model.addFrame(pin.Frame("tool", parent, 0, tool, pin.FrameType.OP_FRAME))
