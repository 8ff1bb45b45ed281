"""The table `inverse`: inverse kinematics of reachable poses, next to other libraries (``make rivals``).

Poses belong to postures drawn evenly between the limits; each solver starts from the home posture. A pose is met within
1e-5 m, 1e-5 rad and the limits, by ikgym's forward kinematics. The time is CPU time on all threads per pose that is
met, failures included. The solvers take turns with parts of the poses; those that are not installed are left out.
"""

from __future__ import annotations

import contextlib
import importlib
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

import ikgym
from baselines.solvers.rivals.model_files import BASE, TIP, urdf
from docs.keeping import Line
from ikgym.arms import Arm
from ikgym.kernels.rotations import geodesic_angle
from ikgym.validation import BoolArray, FloatArray

#: Poses of shape (N, 4, 4) in, postures of shape (N, n) out, NaN where there is none.
Solve = Callable[[FloatArray], FloatArray]
#: Tolerance of a pose in [m] and in [rad], for each solver in its measure, and of a limit in [rad] (single precision).
MET, SLACK = 1e-5, 1e-6
ARMS, POSES, PARTS = ("panda", "iiwa14"), 10_000, 10


def batch(arm: Arm) -> Solve:
    """One call for all poses, to ikgym's tolerance of 1e-9."""
    return lambda poses: arm.inverse(poses[:, :3, :3], poses[:, :3, 3])[0]


def single(arm: Arm) -> Solve:
    """One call a pose, to ikgym's tolerance of 1e-9."""
    return _one_by_one(lambda pose: arm.inverse(pose[:3, :3], pose[:3, 3])[0])


def roboticstoolbox(arm: Arm) -> Solve:
    """The Levenberg–Marquardt solver in C++ with its defaults: at most 100 starts of 30 steps, Chan's damping."""
    et = importlib.import_module("roboticstoolbox")

    def shift(offset: FloatArray, rotation: Any = None) -> Any:
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = np.eye(3) if rotation is None else rotation, offset
        return et.ET.SE3(pose)

    transforms = []
    for offset, axis, lower, upper in zip(arm.offsets, arm.axes, arm.lower, arm.upper, strict=True):
        along = int(np.argmax(np.abs(axis)))
        turn = (et.ET.Rx, et.ET.Ry, et.ET.Rz)[along]
        transforms += [shift(offset), turn(flip=bool(axis[along] < 0.0), qlim=[lower, upper])]
    chain = et.ETS([*transforms, shift(arm.tool, arm.tool_rotation)])
    home = np.array(arm.home)  # a copy, since read-only arrays are refused
    # It stops at e·e / 2, where angles count as lengths.
    return _one_by_one(lambda pose: chain.ik_LM(pose, q0=home, tol=0.5 * MET**2, joint_limits=True).q)


def pytracik(arm: Arm) -> Solve:
    """TRAC-IK, mode Speed, at most 0.1 s a pose; Newton and SQP run on two threads."""
    with _urdf(arm) as file:
        solver = importlib.import_module("trac_ik").TracIK(BASE, TIP, file, timeout=0.1, epsilon=0.5 * MET)
    return _one_by_one(lambda pose: solver.ik(pose[:3, 3], pose[:3, :3], seed_jnt_values=arm.home))


def optik(arm: Arm) -> Solve:
    """OptIK, mode speed, at most 0.1 s a pose, on one thread."""
    module = importlib.import_module("optik")
    with _urdf(arm) as file:
        robot = module.Robot.from_urdf_file(file, BASE, TIP)
    robot.set_parallelism(1)
    config = module.SolverConfig("speed", max_time=0.1, tol_f=0.5 * MET**2)
    return _one_by_one(lambda pose: (robot.ik(config, pose, arm.home) or [None])[0])


def ssik(arm: Arm) -> Solve:
    """The closed-form solver that ssik ships for the arm, one solution."""
    module = importlib.import_module(f"ssik.prebuilt.{'franka.panda' if arm.name == 'panda' else 'kuka.iiwa14'}_ik")

    def solve(pose: FloatArray) -> FloatArray | None:
        found = module.solve(np.ascontiguousarray(pose), max_solutions=1)
        return np.asarray(found[0].q) if found else None

    return _one_by_one(solve)


@contextlib.contextmanager
def _urdf(arm: Arm) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"{arm.name}.urdf"
        file.write_text(urdf(arm), encoding="utf-8")
        yield str(file)


def _one_by_one(solve: Callable[[FloatArray], Any]) -> Solve:
    def solve_all(poses: FloatArray) -> FloatArray:
        found = (solve(pose) for pose in poses)
        return np.array([np.full(7, np.nan) if q is None else np.asarray(q, dtype=float) for q in found])

    return solve_all


SOLVERS: Mapping[str, Callable[[Arm], Solve]] = {
    "ikgym, one call for all": batch,
    "ikgym, one call a pose": single,
    "ssik": ssik,
    "roboticstoolbox, C++ LM": roboticstoolbox,
    "optik-py": optik,
    "pytracik": pytracik,
}


def random_poses(arm: Arm, count: int) -> FloatArray:
    """The poses of random postures. Shape (count, 4, 4)."""
    rotation, position = arm.forward(np.random.default_rng(0).uniform(arm.lower, arm.upper, (count, arm.joints)))
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = rotation, position
    return poses


def meet(arm: Arm, poses: FloatArray, q: FloatArray) -> BoolArray:
    """Which postures are within the limits and meet their poses. Shape (N,)."""
    there: BoolArray = np.all(np.isfinite(q), axis=1)
    q = np.where(there[:, None], q, 0.0)
    rotation, position = arm.forward(q)
    angles = np.array([geodesic_angle(*pair) for pair in zip(rotation, poses[:, :3, :3].copy(), strict=True)])
    near: BoolArray = (np.linalg.norm(position - poses[:, :3, 3], axis=1) <= MET) & (angles <= MET)
    within: BoolArray = np.all((q >= arm.lower - SLACK) & (q <= arm.upper + SLACK), axis=1)
    return there & near & within


def compare(arm: Arm, calls: Mapping[str, Solve], poses: FloatArray) -> list[Line]:
    """The share of the poses that each solver meets, and its time for each pose that it meets."""
    met: dict[str, list[BoolArray]] = {label: [] for label in calls}
    seconds = dict.fromkeys(calls, 0.0)
    for call in calls.values():
        call(poses[:1])
    for part in np.array_split(poses, min(PARTS, len(poses))):
        for label, call in calls.items():
            begin = time.process_time()
            q = call(part)
            seconds[label] += time.process_time() - begin
            met[label].append(meet(arm, part, q))
    counts = {label: int(np.concatenate(parts).sum()) for label, parts in met.items()}
    return [
        {"solver": label, "arm": arm.name, "met_percent": 100.0 * count / len(poses)}
        | {"met_pose_us": 1e6 * seconds[label] / max(count, 1)}
        for label, count in counts.items()
    ]


def measure(poses: int = POSES) -> list[Line]:
    """The table, one line an arm and solver."""
    table: list[Line] = []
    for arm in map(ikgym.arms.get, ARMS):
        calls = {}
        for label, make in SOLVERS.items():
            with contextlib.suppress(ImportError):
                calls[label] = make(arm)
        table += compare(arm, calls, random_poses(arm, poses))
    return table
