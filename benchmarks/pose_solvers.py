"""Solvers of the inverse kinematics of a pose behind one interface: ikgym's, and those of others."""

from __future__ import annotations

import importlib
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from baselines.solvers.rivals.model_files import BASE, TIP, urdf
from ikgym.arms import Arm
from ikgym.validation import FloatArray

#: Poses of shape (N, 4, 4) in, postures of shape (N, n) out, NaN where there is none.
Solve = Callable[[FloatArray], FloatArray]
#: Tolerance of a pose that is met, in [m] and in [rad]. Each solver gets it in its own measure, none a looser one.
MET = 1e-5


def together(arm: Arm) -> Solve:
    """One call for all poses, to ikgym's own tolerance of 1e-9."""
    return lambda poses: arm.inverse(poses[:, :3, :3], poses[:, :3, 3])[0]


def single(arm: Arm) -> Solve:
    """One call a pose, to ikgym's own tolerance of 1e-9."""
    return _one_by_one(lambda pose: arm.inverse(pose[:3, :3], pose[:3, 3])[0])


def roboticstoolbox(arm: Arm) -> Solve:
    """The Levenberg–Marquardt solver in C++, as it comes: at most 100 starts of 30 steps, Chan's damping."""
    et = importlib.import_module("roboticstoolbox")
    transforms = []
    for offset, axis, lower, upper in zip(arm.offsets, arm.axes, arm.lower, arm.upper, strict=True):
        along = int(np.argmax(np.abs(axis)))
        turn = (et.ET.Rx, et.ET.Ry, et.ET.Rz)[along]
        transforms += [_shift(et, offset), turn(flip=bool(axis[along] < 0.0), qlim=[lower, upper])]
    tool = np.eye(4)
    tool[:3, :3] = arm.tool_rotation
    chain = et.ETS([*transforms, _shift(et, arm.tool), et.ET.SE3(tool)])
    # It stops at e·e / 2, where the angles count as lengths.
    home = np.array(arm.home)  # a copy, since read-only arrays are refused
    return _one_by_one(lambda pose: chain.ik_LM(pose, q0=home, tol=0.5 * MET**2, joint_limits=True).q)


def _shift(et: Any, offset: FloatArray) -> Any:
    pose = np.eye(4)
    pose[:3, 3] = offset
    return et.ET.SE3(pose)


def pytracik(arm: Arm) -> Solve:
    """TRAC-IK, mode Speed, at most 0.1 s a pose; Newton and SQP run beside each other on two threads."""
    trac_ik = importlib.import_module("trac_ik")
    with tempfile.TemporaryDirectory() as folder:
        solver = trac_ik.TracIK(BASE, TIP, str(_file(arm, folder)), timeout=0.1, epsilon=0.5 * MET)

    def solve(pose: FloatArray) -> FloatArray | None:
        q: FloatArray | None = solver.ik(pose[:3, 3], pose[:3, :3], seed_jnt_values=arm.home)
        return q

    return _one_by_one(solve)


def optik(arm: Arm) -> Solve:
    """OptIK, mode speed, at most 0.1 s a pose, on one thread."""
    module = importlib.import_module("optik")
    with tempfile.TemporaryDirectory() as folder:
        robot = module.Robot.from_urdf_file(str(_file(arm, folder)), BASE, TIP)
    robot.set_parallelism(1)
    config = module.SolverConfig("speed", max_time=0.1, tol_f=0.5 * MET**2)

    def solve(pose: FloatArray) -> FloatArray | None:
        found = robot.ik(config, pose, arm.home)
        return None if found is None else np.array(found[0])

    return _one_by_one(solve)


def ssik(arm: Arm) -> Solve:
    """The closed-form solver that ssik ships for the arm, one solution."""
    module = importlib.import_module(
        {"panda": "ssik.prebuilt.franka.panda_ik"}.get(arm.name, "ssik.prebuilt.kuka.iiwa14_ik")
    )

    def solve(pose: FloatArray) -> FloatArray | None:
        found = module.solve(np.ascontiguousarray(pose), max_solutions=1)
        return np.asarray(found[0].q) if found else None

    return _one_by_one(solve)


def _file(arm: Arm, folder: str) -> Path:
    file = Path(folder) / f"{arm.name}.urdf"
    file.write_text(urdf(arm), encoding="utf-8")
    return file


def _one_by_one(solve: Callable[[FloatArray], FloatArray | None]) -> Solve:
    def solve_all(poses: FloatArray) -> FloatArray:
        found = (solve(pose) for pose in poses)
        return np.array([np.full(7, np.nan) if q is None else np.asarray(q, dtype=float) for q in found])

    return solve_all


OURS: Mapping[str, Callable[[Arm], Solve]] = {"ikgym, one call for all": together, "ikgym, one call a pose": single}
RIVALS: Mapping[str, Callable[[Arm], Solve]] = {
    "roboticstoolbox, C++ LM": roboticstoolbox,
    "pytracik": pytracik,
    "optik-py": optik,
    "ssik": ssik,
}
#: The one to whose time the others are compared.
REFERENCE = "roboticstoolbox, C++ LM"
