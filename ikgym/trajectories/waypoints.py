"""Trajectories from waypoints: from arrays, or from a CSV file."""

from __future__ import annotations

import csv
import io
import itertools
import math
import os

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_file
from ikgym.trajectories.orientations import Orientation, OrientationThrough
from ikgym.trajectories.path_trajectory import PathTrajectory
from ikgym.trajectories.paths import Path, Polyline, SplinePath
from ikgym.trajectories.paths.path import MOST_POINTS
from ikgym.trajectories.time_laws import TIME_LAWS
from ikgym.trajectories.timed_waypoints import TimedWaypoints
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, about, frozen_array, known_name, shorten

#: Largest size of a file in bytes.
MOST_BYTES = 2**26
POSITION, QUATERNION, TIME = ("x", "y", "z"), ("qw", "qx", "qy", "qz"), "t"


def through(
    positions: npt.ArrayLike,
    quaternions: npt.ArrayLike | None = None,
    *,
    times: npt.ArrayLike | None = None,
    speed: float | None = None,
    acceleration: float | None = None,
    corner_radius: float | None = None,
    time_law: str = "quintic",
    orientation: Orientation | None = None,
) -> Trajectory:
    """A trajectory through waypoints, or near them, from rest to rest.

    Args:
        positions: In [m]. Shape (k, 3).
        quaternions: Unit quaternions w, x, y, z. Shape (k, 4).
        times: When each waypoint is reached, in [s]; worked out from speed and acceleration if left out. Shape (k,).
        speed: Largest speed of the point in [m/s].
        acceleration: Largest acceleration of the point in [m/s²].
        corner_radius: Radius of the arcs, in [m], that round the corners of straight lines between the waypoints;
            a smooth curve goes through all of them if left out.
        time_law: ``quintic`` or ``trapezoidal``.
        orientation: How the tool is turned, in place of quaternions.

    Returns:
        A :class:`TimedWaypoints` if times are given, else a :class:`PathTrajectory`.

    Raises:
        InvalidInputError: A value is wrong, needed, or does not go with another one.
        UnknownNameError: There is no such time law; the message has the nearest one.
    """
    positions = frozen_array("positions", positions, (None, 3), at_most=LARGEST)
    given = {"speed": speed, "acceleration": acceleration, "corner_radius": corner_radius, "orientation": orientation}
    if times is not None:
        if others := [name for name, value in given.items() if value is not None]:
            raise InvalidInputError(f"{others[0]}: expected none with times, which state the pace, got one.")
        return TimedWaypoints(times, positions, quaternions)  # type: ignore[arg-type]  # checked there, as below
    known_name("time law", time_law, TIME_LAWS)
    for name in ("speed", "acceleration"):
        if given[name] is None:
            raise InvalidInputError(f"{name}: expected a number, or times of the waypoints, got neither.")
    if quaternions is not None:
        if orientation is not None:
            raise InvalidInputError("orientation: expected none with quaternions, got one.")
        orientation = OrientationThrough(frozen_array("quaternions", quaternions, (len(positions), 4)))
    path: Path = SplinePath(positions) if corner_radius is None else Polyline(positions, corner_radius)
    return PathTrajectory(path, TIME_LAWS[time_law](speed, acceleration), orientation)  # type: ignore[arg-type]


def from_csv(
    file: str | os.PathLike[str],
    *,
    speed: float | None = None,
    acceleration: float | None = None,
    corner_radius: float | None = None,
    time_law: str = "quintic",
    orientation: Orientation | None = None,
) -> Trajectory:
    """The trajectory through the waypoints of a CSV file; see :func:`through`.

    Args:
        file: Its first line names the columns, in any order: ``x, y, z`` in [m], ``qw, qx, qy, qz`` where there are
            orientations, and ``t`` in [s] where there are times. Each further line is a waypoint; there are at most
            200 000 of them.
        speed: See :func:`through`.
        acceleration: See :func:`through`.
        corner_radius: See :func:`through`.
        time_law: See :func:`through`.
        orientation: See :func:`through`.

    Raises:
        InvalidInputError: The file cannot be read, a column is missing, or a value is no finite number; the message
            names line and column. Else as :func:`through`.
        UnknownNameError: There is no such column; the message has the nearest one.
    """
    columns = _columns(file)
    quaternions = np.column_stack([columns[name] for name in QUATERNION]) if "qw" in columns else None
    with about(file):
        return through(
            np.column_stack([columns[name] for name in POSITION]),
            quaternions,
            times=columns.get(TIME),
            speed=speed,
            acceleration=acceleration,
            corner_radius=corner_radius,
            time_law=time_law,
            orientation=orientation,
        )


def _columns(file: str | os.PathLike[str]) -> dict[str, FloatArray]:
    """The columns of a file by their names."""
    lines = io.TextIOWrapper(io.BytesIO(read_user_file(file, MOST_BYTES)), "utf-8-sig")
    try:
        rows = list(itertools.islice(csv.reader(lines, skipinitialspace=True), MOST_POINTS + 2))
    except (ValueError, csv.Error) as error:
        raise InvalidInputError(f"{file}: expected a CSV file: {error}.") from None
    if len(rows) > MOST_POINTS + 1:
        raise InvalidInputError(f"{file}: expected at most {MOST_POINTS} waypoints, got more lines than that.")
    # Lines are counted as an editor does; empty ones may only be at the end.
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
    names = [cell.strip() for cell in rows[0]] if rows else []
    _check_names(file, names)
    table = np.array([_values(file, line, names, row) for line, row in enumerate(rows[1:], start=2)], dtype=np.float64)
    return dict(zip(names, table.reshape(-1, len(names)).T, strict=True))


def _check_names(file: object, names: list[str]) -> None:
    known = (*POSITION, *QUATERNION, TIME)
    for name in names:
        known_name(f"column in {file}", name, known)
    needed = (*POSITION, *(QUATERNION if set(names) & set(QUATERNION) else ()))
    if missing := [name for name in needed if name not in names]:
        raise InvalidInputError(
            f"{file}: expected the columns {', '.join(needed)} in the first line, got {', '.join(names) or 'none'}; "
            f"{', '.join(missing)} missing."
        )
    if len(set(names)) < len(names):
        raise InvalidInputError(f"{file}: expected each column once, got {', '.join(names)}.")


def _values(file: object, line: int, names: list[str], row: list[str]) -> list[float]:
    """The numbers of a line."""
    if len(row) != len(names):
        raise InvalidInputError(f"{file}, line {line}: expected {len(names)} values, got {len(row)}.")
    values = []
    for name, cell in zip(names, row, strict=True):
        try:
            values.append(float(cell))
        except ValueError:
            values.append(math.nan)
        if not math.isfinite(values[-1]):
            got = shorten(cell) if cell.strip() else "nothing"
            raise InvalidInputError(f"{file}, line {line}, column {name}: expected a finite number, got {got}.")
    return values
