"""Path-following problems that others published: waypoints, starts, and initial trajectories for an optimiser.

- ``rlitg-…``: MinsungYoon/RL-ITG (MIT; Yoon, Kang, Park and Yoon, *Learning-based initialization of trajectory
  optimization for path-following problems of redundant manipulators*, ICRA 2023). Arm ``fetch_arm``.
- ``cppflow-…``: jstmn/cppflow (MIT; Morgan, Millard and Sukhatme, *CppFlow: generative inverse kinematics for efficient
  and robust Cartesian path planning*, ICRA 2024). Arms ``fetch_arm``, ``fetch`` and ``panda``.

Taken from RL-ITG at commit 0866661f83c09e9f5a20adbdbdadeb120d80a703 and cppflow at
c92e0a45aeee257a9a489b49cf83370193fe5844, whose licences are beside this file: the problems without obstacles, except
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
import math
import pathlib
from collections.abc import Sequence
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
#: Methods behind the initial trajectories, and their names in prose.
METHODS = {"greedy": "greedy IK", "cloning": "behaviour cloning", "reinforcement": "reinforcement learning"}


class Waypoints(NamedTuple):
    """Waypoints of a path; all arrays are read-only.

    Attributes:
        positions: In the base frame of the arm, in [m]. Shape (k, 3).
        quaternions: w, x, y, z, of length 1. Shape (k, 4).
        starts: Joint coordinates at the first waypoint, in [rad]; none where none are published. Shape (s, n).
    """

    positions: FloatArray
    quaternions: FloatArray
    starts: FloatArray


def names(family: str = "") -> tuple[str, ...]:
    """The names of all problems, or of those that begin with a text."""
    return tuple(name for name in NAMES if name.startswith(family))


def waypoints(name: str) -> Waypoints:
    """The waypoints of a problem.

    Raises:
        UnknownNameError: There is no such problem; the message has the nearest name.
    """
    known_name("problem", name, names())
    return _stored()[name]


def published(name: str) -> tuple[str, ...]:
    """The methods, of :data:`METHODS`, whose initial trajectory for a problem is published here."""
    return tuple(method for method in METHODS if (name, method) in _trajectories())


def trajectory(name: str, method: str) -> FloatArray:
    """A published initial trajectory, which begins at the first start.

    Args:
        name: The problem.
        method: One of :data:`METHODS`.

    Returns:
        Joint coordinates in [rad], one row a waypoint. Joints without limits are published modulo 2π, and may jump by
        it. Shape (k, n).

    Raises:
        UnknownNameError: There is no such problem, or no such trajectory of it; the message has the nearest name.
    """
    known_name("problem", name, names())
    known_name(f"initial trajectory of {name}", method, published(name))
    return _trajectories()[name, method]


def boxes(name: str) -> FloatArray:
    """The obstacles of a problem: centres and edges of upright boxes in [m], and angles about z in [rad]. Shape (b, 7).

    Raises:
        UnknownNameError: There is no such problem; the message has the nearest name.
    """
    known_name("problem", name, names())
    return _boxes()[name]


@functools.cache
def _archive() -> dict[str, Any]:
    with np.load(FILE, allow_pickle=False) as archive:
        return dict(archive)


@functools.cache
def _stored() -> dict[str, Waypoints]:
    stored, out = _archive(), {}
    shapes = stored["start_shapes"].tolist()
    starts = np.split(stored["starts"] / FINE, np.cumsum([math.prod(shape) for shape in shapes])[:-1])
    poses = _restored(stored["poses"], stored["lengths"].tolist(), FINE, WAYPOINTS_ORDER)
    for name, pose, start, shape in zip(stored["names"].tolist(), poses, starts, shapes, strict=True):
        # Rounding is taken off the length of quaternions.
        quaternions = pose[:, 3:] / np.linalg.norm(pose[:, 3:], axis=1, keepdims=True)
        out[name] = Waypoints(*map(read_only, (pose[:, :3].copy(), quaternions, start.reshape(shape))))
    return out


@functools.cache
def _boxes() -> dict[str, FloatArray]:
    stored = _archive()
    parts = np.split(stored["boxes"], np.cumsum(stored["box_counts"])[:-1])
    return dict(zip(stored["names"].tolist(), map(read_only, parts), strict=True))


@functools.cache
def _trajectories() -> dict[tuple[str, str], FloatArray]:
    stored = _archive()
    keys = list(zip(stored["trajectory_names"].tolist(), stored["methods"].tolist(), strict=True))
    lengths = [len(_stored()[name].positions) for name, _ in keys]
    paths = _restored(stored["joints"], lengths, COARSE, TRAJECTORIES_ORDER)
    return dict(zip(keys, map(read_only, paths), strict=True))


def _restored(packed: npt.NDArray[np.int32], lengths: Sequence[int], scale: int, order: int) -> list[FloatArray]:
    """Tables of k_i rows from the differences of some order of whole multiples of 1 / scale. Shape (c, Σ k_i)."""
    out = []
    for part in np.split(packed.T.astype(np.int64), np.cumsum(lengths)[:-1]):
        for _ in range(order):
            part = np.cumsum(part, axis=0)
        out.append(part / scale)
    return out
