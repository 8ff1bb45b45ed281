"""Writes the archives of this folder from the repositories that published the problems.

    git clone https://github.com/MinsungYoon/RL-ITG && git clone https://github.com/jstmn/cppflow
    python -m ikgym.problems.write RL-ITG cppflow

Commits: RL-ITG 0866661f83c09e9f5a20adbdbdadeb120d80a703, cppflow c92e0a45aeee257a9a489b49cf83370193fe5844.

What is taken: problems without obstacles. Poses are given in the frame of `torso_lift_link`, which stands parallel to
`base_link`, and are written in that of the arm's base here. RL-ITG: `rotation` and `hello` have 100 published starts,
as have `zig`, `kaist` and `sgvr`; the i-th start of a random path belongs to its i-th waypoint, so that only the first
one is taken. CppFlow: `hello_mini`, the beginning of `hello`, is left out. Initial trajectories: those from the first
start. `pirl_rl_test_1` is the network `FREEALL_Task`, the one of which RL-ITG publishes all these trajectories; its
joint interpolations (`torm_jli_test`), which do not follow the paths, are left out.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ikgym.problems import (
    COARSE,
    DRAWN,
    FINE,
    NAMES,
    RANDOM,
    TRAJECTORIES,
    TRAJECTORIES_ORDER,
    WAYPOINTS,
    WAYPOINTS_ORDER,
    packing,
)
from ikgym.validation import FloatArray

TORSO_LIFT_LINK = np.array([-0.086875, 0.0, 0.37743])
CONFIG = Path("torm/launch/config")
#: Methods, and what their files are called.
FILES = {"greedy": "torm_test", "cloning": "pirl_bc_test", "reinforcement": "pirl_rl_test_1"}


class Placed(NamedTuple):
    """A problem of CppFlow: its path, and where that is put, which is written in its YAML file."""

    path: str
    offset: FloatArray
    turn: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)


QUARTER = 0.5**0.5
TURNING = np.array([0.8, 0.0, 0.35]) + TORSO_LIFT_LINK
ON_FETCH = {
    "hello": Placed("hello", np.array([0.8, 0.45, 0.25]) + TORSO_LIFT_LINK),
    "rot_yz": Placed("rot_yz", TURNING),
    "rot_yz2": Placed("rot_yz2", TURNING),
}
CPPFLOW = {f"{arm}-{name}": placed for arm in ("fetch_arm", "fetch") for name, placed in ON_FETCH.items()} | {
    "panda-square": Placed("square", np.array([0.75, 0.0, 0.5]), (QUARTER, 0.0, QUARTER, 0.0)),  # 90° about y
}


def poses_of_rlitg(folder: Path, path: str) -> FloatArray:
    """Positions and quaternions w, x, y, z in `base_link`. Shape (k, 7)."""
    lines = (folder / CONFIG / "path" / path).read_text().split()
    poses = np.array([[float(cell) for cell in line.replace(";", ",").split(",")] for line in lines])
    poses[:, :3] += TORSO_LIFT_LINK
    return poses


def poses_of_cppflow(folder: Path, placed: Placed) -> FloatArray:
    """Positions and quaternions w, x, y, z in the base of the arm. Shape (k, 7)."""
    poses = _table(folder / "cppflow" / "paths" / f"{placed.path}.csv", skiprows=1)[:, 1:]
    poses[:, :3] += placed.offset
    poses[:, 3:] = _product(poses[:, 3:], np.array(placed.turn))
    return poses


def starts_of_rlitg(folder: Path, path: str) -> FloatArray:
    """Joint coordinates at the first waypoint. Shape (s, 7)."""
    starts = _table(folder / CONFIG / "start_conf" / f"{path}_config.csv")
    return starts[:1] if path.startswith("random") else starts


def trajectories(folder: Path, path: str) -> Iterator[tuple[str, FloatArray]]:
    """The methods and joint coordinates of the initial trajectories from the first start."""
    for method, name in FILES.items():
        file = folder / CONFIG / "initial_traj" / f"{path}-{name}-0-0.csv"
        if file.exists():
            yield method, _table(file)


def main(rlitg: Path, cppflow: Path) -> None:
    """Writes both archives."""
    paths = {f"rlitg-{path}": path for path in DRAWN} | {f"rlitg-random-{i:03}": f"random_{i}" for i in range(RANDOM)}
    poses = {name: poses_of_rlitg(rlitg, path) for name, path in paths.items()}
    starts = {name: starts_of_rlitg(rlitg, path) for name, path in paths.items()}
    poses |= {f"cppflow-{name}": poses_of_cppflow(cppflow, placed) for name, placed in CPPFLOW.items()}
    assert tuple(poses) == NAMES
    arrays: dict[str, Any] = {
        "names": np.array(list(poses)),
        "lengths": np.array([len(table) for table in poses.values()]),
        "poses": packing.differences(list(poses.values()), FINE, WAYPOINTS_ORDER),
        "starts": np.rint(FINE * np.concatenate(list(starts.values()))).astype(np.int32),
        "start_counts": np.array([len(starts.get(name, ())) for name in poses]),
    }
    packing.save(WAYPOINTS, arrays)
    found = {(name, method): q for name, path in paths.items() for method, q in trajectories(rlitg, path)}
    arrays = {
        "names": np.array([name for name, _ in found]),
        "methods": np.array([method for _, method in found]),
        "joints": packing.differences(list(found.values()), COARSE, TRAJECTORIES_ORDER),
    }
    packing.save(TRAJECTORIES, arrays)


def _table(file: Path, skiprows: int = 0) -> FloatArray:
    table: FloatArray = np.loadtxt(file, delimiter=",", ndmin=2, skiprows=skiprows)
    return table


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Products of quaternions w, x, y, z. Shapes (k, 4) and (4,)."""
    w, v = a[:, :1] * b[0] - a[:, 1:] @ b[1:, None], a[:, :1] * b[1:] + b[0] * a[:, 1:] + np.cross(a[:, 1:], b[1:])
    return np.hstack([w, v])


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
