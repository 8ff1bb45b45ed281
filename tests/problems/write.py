"""Writes the archives of problems with obstacles from the repositories that published them.

    git clone https://github.com/MinsungYoon/RL-ITG && git clone https://github.com/jstmn/cppflow
    python -m tests.problems.write RL-ITG cppflow

The commits are those in :mod:`ikgym.problems`. Of the twenty paths of each of RL-ITG's random scenes the first one is
taken. Of the published starts the first is taken that is clear by the bodies of our arm, if there is one. CppFlow
publishes no starts: they are drawn here, the clearest of thirty-two. All boxes are upright.
"""

from __future__ import annotations

import sys
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.problems import COARSE, FINE, OBSTRUCTED, OBSTRUCTED_FILE, TRAJECTORIES_ORDER, WAYPOINTS_ORDER
from ikgym.scenarios.obstructed import arm_of, boxes_of
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray

TORSO_LIFT_LINK = np.array([-0.086875, 0.0, 0.37743])
CONFIG = Path("torm/launch/config")
#: Clearance of a start, in [m].
CLEAR = 0.005
#: Methods, and what their files are called.
METHODS = {"greedy": "torm_test", "reinforcement": "pirl_rl_test_1"}


def rlitg(folder: Path, name: str) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
    """Poses (k, 7), boxes (b, 7), a start (1, 7) and trajectories (k, 7) of one of RL-ITG's problems."""
    config, kind = folder / CONFIG, name.removeprefix("rlitg-")
    number = kind.removeprefix("obstacle-")
    path, scene = (kind, kind) if number == kind else (f"random_obs_{int(number)}_0", f"scene_{int(number)}")
    lines = (config / "path" / path).read_text().split()
    poses = np.array([[float(cell) for cell in line.replace(";", ",").split(",")] for line in lines])
    poses[:, :3] += TORSO_LIFT_LINK
    boxes = np.loadtxt(config / "scene" / f"{scene}.txt", ndmin=2)
    assert not boxes[:, 3:5].any()
    starts = np.loadtxt(config / "start_conf" / f"{path}_config.csv", delimiter=",", ndmin=2)
    files = {method: config / "initial_traj" / f"{path}-{text}-0-0.csv" for method, text in METHODS.items()}
    found = {method: np.loadtxt(file, delimiter=",", ndmin=2) for method, file in files.items() if file.exists()}
    boxes = boxes[:, [0, 1, 2, 6, 7, 8, 5]]
    clear = arm_of("fetch_arm").clearance(starts, boxes_of(boxes))[0] > CLEAR
    return poses, boxes, starts[[int(clear.argmax())]], found


def cppflow(folder: Path, name: str) -> tuple[FloatArray, FloatArray, FloatArray, dict[str, FloatArray]]:
    """The same of one of CppFlow's problems, which have neither starts nor trajectories."""
    import yaml

    _, arm, path = name.split("-")
    told = yaml.safe_load((folder / "cppflow" / "problems" / f"{arm}__{path}.yaml").read_text())
    assert told["path_R_offset"] == np.eye(3).tolist()
    poses = np.loadtxt(folder / "cppflow" / "paths" / f"{told['path_name']}.csv", delimiter=",", skiprows=1)[:, 1:]
    poses[:, :3] += told["path_xyz_offset"]
    if told["path_offset_frame"] == "torso_lift_link":
        poses[:, :3] += TORSO_LIFT_LINK
    boxes = []
    for one in told["obstacles"]:
        box = {key: value for part in one for key, value in part.items()}
        assert not any(box[key] for key in ("roll", "pitch"))
        boxes.append([box[key] for key in ("x", "y", "z", "size_x", "size_y", "size_z", "yaw")])
    placed = np.array(boxes) + np.array([*told["obstacle_xyz_offset"], 0.0, 0.0, 0.0, 0.0])
    return poses, placed, drawn_start(arm, poses[0], placed), {}


def drawn_start(arm: str, pose: FloatArray, boxes: FloatArray) -> FloatArray:
    """The clearest of some joint coordinates at a pose. Shape (1, n)."""
    model, rng = arm_of(arm), np.random.default_rng(0)
    low, high = np.maximum(model.lower, -3.0), np.minimum(model.upper, 3.0)
    starts = np.vstack([model.home, rng.uniform(low, high, (31, model.joints))])
    rotation = matrices(pose[None, 3:])[0]
    q, converged = model.inverse(np.tile(rotation, (32, 1, 1)), np.tile(pose[:3], (32, 1)), start=starts)
    clearance = np.where(converged, model.clearance(q, boxes_of(boxes))[0], -np.inf)
    print(f"{arm}: {1e3 * clearance.max():.0f} mm at the start")
    return q[[int(clearance.argmax())]]


def main(itg: Path, flow: Path) -> None:
    """Writes the archive."""
    found = {name: rlitg(itg, name) if name.startswith("rlitg") else cppflow(flow, name) for name in OBSTRUCTED}
    poses, boxes, starts = ([one[i] for one in found.values()] for i in range(3))
    joints = {(name, method): q for name, one in found.items() for method, q in one[3].items()}
    wide = [np.pad(start[0], (0, 8 - start.shape[1])) for start in starts]
    save(
        OBSTRUCTED_FILE,
        {
            "names": np.array(list(found)),
            "lengths": np.array([len(one) for one in poses]),
            "poses": differences(poses, FINE, WAYPOINTS_ORDER),
            "starts": np.rint(FINE * np.array(wide)).astype(np.int32),
            "joints_of": np.array([start.shape[1] for start in starts]),
            "boxes": np.concatenate(boxes),
            "box_counts": np.array([len(one) for one in boxes]),
            "trajectory_names": np.array([name for name, _ in joints]),
            "methods": np.array([method for _, method in joints]),
            "joints": differences(list(joints.values()), COARSE, TRAJECTORIES_ORDER),
        },
    )


def differences(tables: Sequence[FloatArray], scale: int, order: int) -> npt.NDArray[np.int32]:
    """Tables below each other, in differences of whole multiples of 1 / scale. Shape (c, Σ k_i)."""
    whole = (np.rint(scale * np.asarray(table)).astype(np.int64) for table in tables)
    rows = [np.diff(table, n=order, axis=0, prepend=np.zeros((order, table.shape[1]), np.int64)) for table in whole]
    return np.concatenate(rows).T.astype(np.int32)


def save(file: Path, arrays: Mapping[str, npt.NDArray[Any]]) -> None:
    """Writes arrays as an archive for :func:`numpy.load`, the same bytes for the same arrays."""
    with zipfile.ZipFile(file, "w", zipfile.ZIP_BZIP2) as archive:
        for name, array in arrays.items():
            member = zipfile.ZipInfo(f"{name}.npy", date_time=(1980, 1, 1, 0, 0, 0))
            member.compress_type = zipfile.ZIP_BZIP2
            with archive.open(member, "w") as stream:
                np.lib.format.write_array(stream, np.ascontiguousarray(array), allow_pickle=False)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
