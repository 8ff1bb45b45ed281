"""Inverse kinematics of reachable random poses, beside the solvers of others: how many are met, and how fast."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np

import ikgym
from benchmarks.effort import FULL, Effort
from benchmarks.pose_solvers import MET, OURS, REFERENCE, RIVALS, Solve
from benchmarks.table import Column, Table
from ikgym.arms import Arm
from ikgym.kernels.rotations import geodesic_angle
from ikgym.validation import BoolArray, FloatArray

ARMS = ("panda", "iiwa14")
#: All solvers have their turns at so many parts of the poses.
PARTS = 10
#: Some programs keep limits to single precision, in [rad].
SLACK = 1e-6


def tables(effort: Effort = FULL) -> list[Table]:
    """One table an arm."""
    return [_table(ikgym.arms.get(name), effort) for name in ARMS]


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


def _table(arm: Arm, effort: Effort) -> Table:
    calls, skipped = solvers(arm)
    figures = measured(arm, calls, random_poses(arm, effort.poses))
    whole = figures.get(REFERENCE, (None, None))[1]
    return Table(
        f"poses_{arm.name}",
        f"Inverse kinematics of {effort.poses:,} reachable poses, {arm.name}",
        f"Poses of postures drawn evenly between the limits, all from the home posture, in {PARTS} parts in turn. Met "
        f"is a pose within {MET:g} m and {MET:g} rad by ikgym's forward kinematics, and within the limits. Time of the "
        "processor, on all threads, for each pose that is met, failures included.",
        (
            Column("met", "poses met", "%"),
            Column("pose_us", "per pose met", "µs"),
            Column("ratio", "× roboticstoolbox"),
        ),
        {
            label: (100.0 * share, 1e6 * seconds, seconds / whole if whole else None)
            for label, (share, seconds) in figures.items()
        },
        skipped,
    )
