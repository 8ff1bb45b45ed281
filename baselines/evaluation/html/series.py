"""Trajectory logs for the page: fewer rows, as text."""

from __future__ import annotations

import base64
import math
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.log import TrajectoryLog, frame_rows
from ikgym.arms.limits import BOUNDS, at_limits
from ikgym.exceptions import printable
from ikgym.obstacles.solids import cut_half_spaces, in_space, surface
from ikgym.validation import FloatArray

#: Bytes that the series of a page may take together, as far as each of them has :data:`FEWEST` rows.
BUDGET, FEWEST = 5_000_000, 50
#: Stretches of a quarter of a circle in surfaces, and half the edge of a half-space as a multiple of the arm's size.
STRETCHES, PLATE = 3, 2.0
#: Limits of a joint, from the least to the most severe; the page has a colour for each number.
FREE, ACCELERATION, VELOCITY, STOP = range(4)


def thin(log: TrajectoryLog, size: int) -> dict[str, Any]:
    """A log at some of its steps, such that no peak is lost: between two of them, the worst is shown.

    Args:
        log: See :func:`baselines.evaluation.log.trajectory_log`.
        size: Bytes that it may take as text.

    Returns:
        ``arrays`` as :func:`encode` gives them: ``time``, ``nominal`` positions, ``points`` of the links from the base
        to the tool, ``rotation`` of the tool, and ``q`` at the frames that are kept; of all steps since the one before,
        the largest errors, the ``qdot`` and ``qddot`` that are largest in magnitude, and the worst ``limit``. Besides
        how many steps there were (``rows``), the limits, ``joint_names``, which joints are prismatic, and which points
        are ends of joints (``joint_ends``). Where the scenario has collisions, the smallest ``clearance``, the
        ``closest`` points, the ``frames`` that carry bodies and obstacles, and the surfaces of these, see
        :func:`_surfaces`.
    """
    carriers = log["carrier_frames"].shape[1] if "carrier_frames" in log else 0
    picked = frame_rows(len(log["frame"]), max(FEWEST, size // _row_size(log["q"].shape[1], carriers)))
    rows = log["frame"][picked]
    starts = np.concatenate([[0], rows[:-1] + 1])
    arrays: dict[str, npt.NDArray[Any]] = {name: log[name][rows] for name in ("time", "q")}
    arrays["nominal"] = log["nominal"][rows][:, -3:]
    for name in ("position_error", "orientation_error"):
        if name in log:
            arrays[name] = np.fmax.reduceat(log[name], starts)
    arrays |= {name: _largest(log[name], starts) for name in ("qdot", "qddot") if name in log}
    arrays["limit"] = np.maximum.reduceat(limits(log), starts)
    out: dict[str, Any] = {"prismatic": log["prismatic"].tolist(), "rows": len(log["time"])}
    out["joint_names"] = list(map(printable, log["joint_names"].tolist()))
    arrays["points"], out["joint_ends"] = _links(log, picked)
    arrays["rotation"] = log["tool_rotation"][picked].reshape(-1, 9)
    if carriers:
        arrays["clearance"] = np.fmin.reduceat(log["clearance"], starts)
        arrays["closest"] = log["closest"][picked].reshape(-1, 6)
        arrays["frames"] = log["carrier_frames"][picked].reshape(-1, 12 * carriers)
        surfaces, out["of_bodies"] = _surfaces(log)
        arrays |= surfaces
    out |= {name: _without_infinity(log[name]) for name in BOUNDS if name in log}
    return out | {"arrays": {name: encode(values) for name, values in arrays.items()}}


def limits(log: TrajectoryLog) -> npt.NDArray[np.uint8]:
    """Which limit each joint is at: ``FREE``, ``ACCELERATION``, ``VELOCITY`` or ``STOP``; (k, n)."""
    out = np.full(log["q"].shape, FREE, dtype=np.uint8)
    at = at_limits(log)
    for joints, limit in ((at.acceleration, ACCELERATION), (at.velocity, VELOCITY), (at.stop, STOP)):
        out[joints] = limit
    return out


def encode(values: npt.NDArray[Any]) -> dict[str, Any]:
    """An array as JSON: its bytes in base64, since JSON has no numbers that are not finite, and in single precision."""
    kept = values.astype(np.uint8 if values.dtype == np.uint8 else "<f4")
    kind = "u1" if kept.dtype == np.uint8 else "f4"
    return {"type": kind, "shape": list(kept.shape), "data": base64.b64encode(kept.tobytes()).decode("ascii")}


def _surfaces(log: TrajectoryLog) -> tuple[dict[str, npt.NDArray[Any]], int]:
    """The surfaces of bodies and obstacles, and how many of their triangles are those of bodies.

    The ``surface`` has vertices in the frames that carry them in [m], each with the number of its frame (v, 4); the
    ``triangles`` have three of them each (t, 3).
    """
    solids, of_bodies = cut_half_spaces(log["solids"], PLATE * float(np.abs(log["joint_points"]).max())), 0
    vertices, triangles, known = [], [], 0
    for solid, carrier in zip(solids, log["carriers"].tolist(), strict=True):
        points, faces = surface(solid[12:], STRETCHES)
        vertices.append(np.column_stack([in_space(solid, points), np.full(len(points), carrier)]))
        triangles.append(faces + known)
        known += len(points)
        of_bodies += len(faces) * (carrier <= log["q"].shape[1])
    return {"surface": np.vstack(vertices), "triangles": np.vstack(triangles)}, of_bodies


def _row_size(joints: int, carriers: int) -> int:
    """Bytes of a row as text, at most: base64 takes four for three."""
    numbers = 2 * joints + 3 * (2 * joints + 2) + joints + 9 + 6 + (7 + 12 * carriers if carriers else 0)
    return (4 * numbers + joints) * 4 // 3


def _largest(values: FloatArray, starts: npt.NDArray[np.int64]) -> FloatArray:
    """Of each stretch of rows, and of each joint, the value that is largest in magnitude, with its sign."""
    high, low = np.fmax.reduceat(values, starts), np.fmin.reduceat(values, starts)
    return np.where(-low > high, low, high)


def _links(log: TrajectoryLog, picked: npt.NDArray[np.int64]) -> tuple[npt.NDArray[Any], list[int]]:
    """The points that the links go through, of shape (f, p, 3), and which of them are the ends of joints."""
    joints = log["joint_points"][picked]
    columns = [np.zeros((len(picked), 3))]
    ends = []
    for joint, prismatic in enumerate(log["prismatic"].tolist()):
        # A revolute joint begins where it ends.
        columns += [joints[:, joint, 0]] * prismatic + [joints[:, joint, 1]]
        ends.append(len(columns) - 1)
    return np.stack([*columns, log["tool"][picked]], axis=1), ends


def _without_infinity(values: FloatArray) -> list[float | None]:
    """Limits as JSON; None if there is none."""
    return [value if math.isfinite(value) else None for value in values.tolist()]
