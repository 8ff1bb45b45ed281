"""Path-following problems that others published: waypoints, starts, and initial trajectories for an optimiser.

- ``rlitg-…``: MinsungYoon/RL-ITG (MIT; Yoon, Kang, Park and Yoon, *Learning-based initialization of trajectory
  optimization for path-following problems of redundant manipulators*, ICRA 2023). Arm ``fetch_arm``.
- ``cppflow-…``: jstmn/cppflow (MIT; Morgan, Millard and Sukhatme, *CppFlow: generative inverse kinematics for efficient
  and robust Cartesian path planning*, ICRA 2024). Arms ``fetch_arm``, ``fetch`` and ``panda``.

Taken from RL-ITG at commit 0866661f83c09e9f5a20adbdbdadeb120d80a703 and cppflow at
c92e0a45aeee257a9a489b49cf83370193fe5844, whose licences are next to this file: the problems without obstacles, except
`hello_mini`, the beginning of `hello`. Poses are published in the frame of `torso_lift_link`, which is parallel to
`base_link`; here they are in the base frame of the arm. The i-th start of a random path belongs to its i-th waypoint,
so only the first one is kept. Initial trajectories are those from the first start; `reinforcement` is the published
network `FREEALL_Task` (`pirl_rl_test_1`). RL-ITG's joint interpolations, which do not follow the paths, are left out.

Problems with obstacles, :data:`OBSTRUCTED`, also have upright boxes: of RL-ITG `s`, `square` and
``rlitg-obstacle-…``, the first path of each of its hundred scenes `random_obs`; and of CppFlow those of the Panda and
three of the Fetch, whose starts are not published: they are drawn clear of the boxes, the clearest of thirty-two. Of
RL-ITG's starts for these problems the first one is kept that is clear by the bodies of our arm. The archive is data;
the programs that read the repositories are in the history of this one.
"""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.validation import FloatArray, known_name, read_only

#: All numbers of all problems.
FILE = pathlib.Path(__file__).with_name("problems.npz")
#: One over the resolution of waypoints and starts in [m], [rad] or 1, and of trajectories in [rad]; and the orders of
#: the differences in which they are stored, which change little from row to row and so compress well.
FINE, COARSE = 10**6, 10**5
WAYPOINTS_ORDER, TRAJECTORIES_ORDER = 3, 2
#: RL-ITG's drawn paths, the number of its random ones, and CppFlow's paths for the Fetch.
DRAWN, RANDOM, ON_FETCH = ("hello", "rotation", "zig", "kaist", "sgvr"), 100, ("hello", "rot_yz", "rot_yz2")
#: The problems with obstacles.
OBSTRUCTED = (
    *(f"rlitg-{path}" for path in ("s", "square")),
    *(f"rlitg-obstacle-{i:03}" for i in range(RANDOM)),
    *(f"cppflow-panda-{path}" for path in ("1cube", "2cubes", "flappy_bird")),
    *(f"cppflow-fetch-{path}" for path in ("circle", "s", "square")),
)
NAMES = (
    *(f"rlitg-{path}" for path in DRAWN),
    *(f"rlitg-random-{i:03}" for i in range(RANDOM)),
    *(f"cppflow-{arm}-{path}" for arm in ("fetch_arm", "fetch") for path in ON_FETCH),
    "cppflow-panda-square",
    *OBSTRUCTED,
)


class Problem(NamedTuple):
    """A path, and what was published with it; all arrays are read-only.

    Attributes:
        positions: Of the waypoints in the base frame of the arm, in [m]. Shape (k, 3).
        quaternions: Of the waypoints: w, x, y, z, of length 1. Shape (k, 4).
        starts: Joint coordinates at the first waypoint, in [rad]; none where none are published. Shape (s, n).
        boxes: The obstacles: centres and edges of upright boxes in [m], and angles about z in [rad]. Shape (b, 7).
        trajectories: Initial trajectories by method: `greedy` inverse kinematics, behaviour `cloning`, `reinforcement`
            learning. They begin at the first start: joint coordinates in [rad], one row a waypoint. Joints without
            limits are published modulo 2π, and may jump by it. Shapes (k, n).
    """

    positions: FloatArray
    quaternions: FloatArray
    starts: FloatArray
    boxes: FloatArray
    trajectories: Mapping[str, FloatArray]


def names(family: str = "") -> tuple[str, ...]:
    """The names of all problems, or of those that begin with a text."""
    return tuple(name for name in NAMES if name.startswith(family))


def get(name: str) -> Problem:
    """The problem of a name.

    Raises:
        UnknownNameError: There is no such problem; the message has the nearest name.
    """
    known_name("problem", name, NAMES)
    return _read(name)


@functools.cache
def _archive() -> dict[str, Any]:
    with np.load(FILE, allow_pickle=False) as archive:
        return dict(archive)


@functools.cache
def _read(name: str) -> Problem:
    stored = _archive()
    order, owners, methods = (stored[key].tolist() for key in ("names", "trajectory_names", "methods"))
    number, lengths, shapes = order.index(name), stored["lengths"], stored["start_shapes"]
    poses = _restore(_part(stored["poses"], lengths, number), FINE, WAYPOINTS_ORDER)
    # Rounding is taken off the length of quaternions.
    quaternions = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    starts = _part(stored["starts"], shapes.prod(axis=1), number).reshape(shapes[number]) / FINE
    boxes = _part(stored["boxes"].T, stored["box_counts"], number).T
    rows = lengths[[order.index(owner) for owner in owners]]
    trajectories = {
        method: read_only(_restore(_part(stored["joints"], rows, k), COARSE, TRAJECTORIES_ORDER))
        for k, (owner, method) in enumerate(zip(owners, methods, strict=True))
        if owner == name
    }
    positions, quaternions, starts, boxes = (read_only(a.copy()) for a in (poses[:, :3], quaternions, starts, boxes))
    return Problem(positions, quaternions, starts, boxes, trajectories)


def _part(values: npt.NDArray[Any], lengths: npt.NDArray[np.int64], number: int) -> npt.NDArray[Any]:
    """One of several parts of the last axis, given the length of each."""
    end = lengths[: number + 1].sum()
    return values[..., end - lengths[number] : end]


def _restore(packed: npt.NDArray[np.int32], scale: int, order: int) -> FloatArray:
    """A table of k rows from the differences of some order of whole multiples of 1 / scale. Shapes (c, k), (k, c)."""
    table = packed.T.astype(np.int64)
    for _ in range(order):
        table = np.cumsum(table, axis=0)
    return table / scale
