"""Forward and inverse kinematics beside other libraries: how fast, and how many of random poses are met."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

import numpy as np
import pinocchio as pin
from numba import njit

import ikgym
from benchmarks.measuring import FULL, Effort, per_item
from benchmarks.pose_solvers import MET, OURS, REFERENCE, RIVALS, Solve
from benchmarks.table import Table
from ikgym.arms import Arm
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.rotations import geodesic_angle
from ikgym.validation import BoolArray, FloatArray

ARMS = ("panda", "iiwa14")
#: Number of parts of the poses, at which the solvers take turns.
PARTS = 10
#: Postures of a batch of forward kinematics.
LOOP = 1000
#: Some programs keep limits to single precision, in [rad].
SLACK = 1e-6


def tables(effort: Effort = FULL) -> list[Table]:
    """Forward kinematics of 7 joints, and a table of inverse kinematics for each arm."""
    return [_forward_table(effort), *(_inverse_table(ikgym.arms.get(name), effort) for name in ARMS)]


def _forward_table(effort: Effort) -> Table:
    return Table(
        "Forward kinematics and Jacobian, 7 joints",
        "The arm varga7 at random configurations, one thread, medians.",
        ("per pose [µs]", "× compiled loop"),
        per_item(kinematics(), effort),
    )


@njit
def _loop(chain, q, rotation, position, jacobian):
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, jacobian)


def kinematics(name: str = "varga7") -> dict[str, tuple[Callable[[], object], int]]:
    """Calls by name, with the number of poses of each."""
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


def random_poses(arm: Arm, count: int) -> FloatArray:
    """The poses of postures drawn evenly between the limits. Shape (count, 4, 4)."""
    rotation, position = arm.forward(np.random.default_rng(0).uniform(arm.lower, arm.upper, (count, arm.joints)))
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation, position
    return poses


def met(arm: Arm, poses: FloatArray, q: FloatArray) -> BoolArray:
    """Which postures are within the limits and meet their poses, by ikgym's forward kinematics. Shape (N,)."""
    there: BoolArray = np.all(np.isfinite(q), axis=1)
    q = np.where(there[:, None], q, 0.0)
    rotation, position = arm.forward(q)
    angles = np.array([geodesic_angle(*pair) for pair in zip(rotation, poses[:, :3, :3].copy(), strict=True)])
    near: BoolArray = (np.linalg.norm(position - poses[:, :3, 3], axis=1) <= MET) & (angles <= MET)
    within: BoolArray = np.all((q >= arm.lower - SLACK) & (q <= arm.upper + SLACK), axis=1)
    return there & near & within


def solvers(arm: Arm) -> tuple[dict[str, Solve], tuple[str, ...]]:
    """All solvers of the poses of an arm by label, and what is left out."""
    out: dict[str, Solve] = {}
    skipped = []
    for label, make in {**OURS, **RIVALS}.items():
        try:
            out[label] = make(arm)
        except ImportError as e:
            skipped.append(f'{label}: {e}; pip install "ikgym[rivals]"')
    return out, tuple(skipped)


def measured(arm: Arm, calls: Mapping[str, Solve], poses: FloatArray) -> dict[str, tuple[float, float]]:
    """The share of the poses that each solver meets, and its time for each that it meets in [s]."""
    found: dict[str, list[BoolArray]] = {label: [] for label in calls}
    seconds = dict.fromkeys(calls, 0.0)
    for call in calls.values():
        call(poses[:1])
    for part in np.array_split(poses, min(PARTS, len(poses))):
        for label, call in calls.items():
            begin = time.process_time()
            q = call(part)
            seconds[label] += time.process_time() - begin
            found[label].append(met(arm, part, q))
    shares = {label: float(np.concatenate(parts).mean()) for label, parts in found.items()}
    return {label: (share, seconds[label] / max(share * len(poses), 1.0)) for label, share in shares.items()}


def _inverse_table(arm: Arm, effort: Effort) -> Table:
    calls, skipped = solvers(arm)
    figures = measured(arm, calls, random_poses(arm, effort.poses))
    whole = figures.get(REFERENCE, (None, None))[1]
    return Table(
        f"Inverse kinematics of {effort.poses:,} reachable poses, {arm.name}",
        f"Poses of random postures within the limits, all from the home posture, in {PARTS} parts in turn. A pose is "
        f"met within {MET:g} m and {MET:g} rad by ikgym's forward kinematics, and within the limits. The time is CPU "
        "time on all threads per pose that is met, failures included.",
        ("poses met [%]", "per pose met [µs]", "× roboticstoolbox"),
        {
            label: (100.0 * share, 1e6 * seconds, seconds / whole if whole else None)
            for label, (share, seconds) in figures.items()
        },
        skipped,
    )
