"""Logs of a moving arm: joint coordinates and commanded joint velocities, at a regular control period."""

from __future__ import annotations

import io
import os
import pathlib
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.files import read_user_file
from ikgym.validation import FloatArray

#: The shortest log in [s], and the most rows.
SHORTEST, MOST_ROWS = 4.0, 2_000_000
#: The longest control period in [s].
SLOWEST = 0.1
#: Intervals between rows may differ from the control period by this share; this share of them may, as jitter.
JITTER, RARE = 0.3, 0.02
#: Joint coordinates may be outside the limits by this much in [rad] or [m], as encoders and stops are not exact.
OUTSIDE = 0.2
#: A command this close to its limit is saturated, in shares of it; and the share of rows in which it may be.
AT_LIMIT, SATURATED = 0.999, 0.02
#: Commands beyond this multiple of the velocity limit are in degrees, not saturated.
BEYOND = 3.0


class Log(NamedTuple):
    """A log of an arm.

    Attributes:
        period: The control period in [s].
        q: Joint coordinates in [rad] or [m], before the command of their row. Shape (k, n).
        command: Commanded joint velocities in [rad/s] or [m/s]. Shape (k, n).
        measured: Measured joint velocities, where the log has them. Shape (k, n).
    """

    period: float
    q: FloatArray
    command: FloatArray
    measured: FloatArray | None = None


def read(file: str | os.PathLike[str], arm: Arm) -> Log:
    """The log in a file.

    Args:
        file: CSV with the columns ``t`` in [s], ``q.JOINT`` in [rad] or [m] and ``command.JOINT`` in [rad/s] or [m/s]
            for each joint by its name, ``measured.JOINT`` optional; or an MCAP file with ``sensor_msgs/msg/JointState``
            messages of joint states and, in another topic, of commands in their velocities, or commands as
            ``std_msgs/msg/Float64MultiArray`` in the order of the arm's joints.
        arm: The arm.

    Raises:
        InvalidInputError: The file cannot be read or is no such log; the message says what came.
        UnknownNameError: A column names no joint of the arm.
        ModuleNotFoundError: An MCAP file, and rosbags is not installed.
    """
    path = pathlib.Path(file)
    try:
        time, columns = _mcap(path, arm) if path.suffix == ".mcap" else _csv(path, arm)
        return _log(time, columns, arm)
    except UnknownNameError as error:
        raise UnknownNameError(f"{error.kind} in {path}", error.name, error.available) from None
    except InvalidInputError as error:
        raise InvalidInputError(str(error) if str(path) in str(error) else f"{path}: {error}") from None


def _csv(path: pathlib.Path, arm: Arm) -> tuple[FloatArray, dict[str, FloatArray | None]]:
    content = io.BytesIO(read_user_file(path))
    try:
        frame = pd.read_csv(content, skipinitialspace=True, nrows=MOST_ROWS + 1)
    except (ValueError, pd.errors.ParserError) as error:
        raise InvalidInputError(f"invalid CSV, expected a line of names first: {str(error).strip(' .')}.") from None
    frame.columns = [str(name).strip() for name in frame.columns]
    if len(frame) > MOST_ROWS:
        raise InvalidInputError(f"expected at most {MOST_ROWS} rows, got more.")
    if "t" not in frame:
        raise InvalidInputError(f"expected a column t in [s], got {', '.join(frame.columns[:8])}.")
    if frame.empty:
        raise InvalidInputError("expected rows below the names of columns, got none.")
    used = [name for name in frame.columns if name == "t" or name.partition(".")[0] in ("q", "command", "measured")]
    for name in used:
        joint = name.partition(".")[2]
        if name != "t" and joint not in arm.joint_names:
            raise UnknownNameError(f"joint of {arm.name} (column {name})", joint, arm.joint_names)
    for name in used:
        if not pd.api.types.is_numeric_dtype(frame[name]) or not np.isfinite(frame[name]).all():
            row = int(np.argmin(np.isfinite(pd.to_numeric(frame[name], errors="coerce")))) + 2
            raise InvalidInputError(f"line {row}: expected a finite number in column {name}.")
    found: dict[str, FloatArray | None] = {}
    for kind in ("q", "command", "measured"):
        names = [f"{kind}.{joint}" for joint in arm.joint_names]
        missing = [name for name in names if name not in frame]
        found[kind] = None if missing else frame[names].to_numpy(dtype=np.float64)
        if missing and (kind != "measured" or len(missing) < arm.joints):
            raise InvalidInputError(f"expected columns for all joints of {arm.name}, got none named {missing[0]}.")
    return frame["t"].to_numpy(dtype=np.float64), found


def _mcap(path: pathlib.Path, arm: Arm) -> tuple[FloatArray, dict[str, FloatArray | None]]:
    """Joint states and, for each, the newest command; a bag says which is which by the topic's name or type."""
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.typesys import Stores, get_typestore

    states: list[tuple[float, list[float]]] = []
    commands: list[tuple[float, list[float]]] = []
    read_user_file(path)
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            for connection, stamp, raw in reader.messages():
                if connection.msgtype not in ("sensor_msgs/msg/JointState", "std_msgs/msg/Float64MultiArray"):
                    continue
                message: Any = reader.deserialize(raw, connection.msgtype)
                commanded = "command" in connection.topic or connection.msgtype.startswith("std_msgs")
                values = _values(message, arm, "velocity" if commanded else "position")
                (commands if commanded else states).append((1e-9 * stamp, values))
    except AnyReaderError as error:
        raise InvalidInputError(f"invalid MCAP file: {str(error).strip(' .')}.") from None
    if not states or not commands:
        raise InvalidInputError(
            f"expected joint states and, in a topic with 'command' in its name, commands; got {len(states)} and "
            f"{len(commands)} messages."
        )
    start = states[0][0]
    time, times = (np.array([stamp - start for stamp, _ in rows]) for rows in (states, commands))
    newest = np.searchsorted(times, np.append(time[1:], np.inf), side="left") - 1  # sent before the next state
    sent = np.where((newest >= 0)[:, None], np.array([row for _, row in commands])[newest], 0.0)
    return time, {"q": np.array([row for _, row in states]), "command": sent, "measured": None}


def _values(message: Any, arm: Arm, field: str) -> list[float]:
    """Numbers of a message, in the order of the arm's joints."""
    if not hasattr(message, "name"):
        values = np.asarray(message.data).tolist()
        if len(values) != arm.joints:
            raise InvalidInputError(f"expected commands for the {arm.joints} joints of {arm.name}, got {len(values)}.")
        return values  # type: ignore[no-any-return]  # of floats
    numbers = dict(zip(message.name, np.asarray(getattr(message, field)).tolist(), strict=False))
    for joint in arm.joint_names:
        if joint not in numbers:
            raise UnknownNameError(f"{field} of a joint in messages", joint, message.name)
    return [numbers[joint] for joint in arm.joint_names]


def _log(time: FloatArray, columns: dict[str, FloatArray | None], arm: Arm) -> Log:
    q, command, measured = columns["q"], columns["command"], columns["measured"]
    for kind in ("q", "command"):
        if not np.isfinite(columns[kind]).all():  # type: ignore[arg-type]  # both are there
            raise InvalidInputError(f"{kind}: expected finite numbers, got nan or inf.")
    period = _period(time)
    _check_limits(arm, q, command)
    return Log(period, q, command, measured)  # type: ignore[arg-type]  # both are there


def _period(time: FloatArray) -> float:
    """The control period of regular times."""
    steps = np.diff(time)
    if len(time) < 3:
        raise InvalidInputError(f"expected at least {SHORTEST:g} s, got {len(time)} rows.")
    if (steps <= 0.0).any():
        row = int(np.argmax(steps <= 0.0))
        what = "equal" if steps[row] == 0.0 else "falling"
        raise InvalidInputError(
            f"line {row + 3}: expected times that rise, got {what} ones: t = {time[row]:g} s, then {time[row + 1]:g} s."
        )
    if time[-1] - time[0] < SHORTEST:
        raise InvalidInputError(f"expected at least {SHORTEST:g} s, got {time[-1] - time[0]:.3g} s.")
    median = float(np.median(steps))
    if median > SLOWEST:
        hint = "; these look like milliseconds" if median < 1e3 * SLOWEST else ""
        raise InvalidInputError(
            f"t: expected a control period of at most {SLOWEST:g} s, got times {median:g} s apart{hint}."
        )
    off = np.abs(steps - median) > JITTER * median
    if off.mean() > RARE:
        other = float(np.median(steps[off]))
        raise InvalidInputError(
            f"expected one control period, got {100 * (1 - off.mean()):.0f} % of intervals around {1e3 * median:.3g} ms"
            f" and {100 * off.mean():.0f} % around {1e3 * other:.3g} ms; cut the log, or fill in lost rows."
        )
    if (late := steps > (2.0 - JITTER) * median).any():
        row = int(np.argmax(late))
        raise InvalidInputError(
            f"expected no gaps, got one of {1e3 * steps[row]:.3g} ms after t = {time[row]:g} s, where the control "
            f"period is {1e3 * median:.3g} ms; cut the log there."
        )
    return float((time[-1] - time[0]) / len(steps))


def _check_limits(arm: Arm, q: Any, command: Any) -> None:
    """Checks units and limits of a log."""
    for j, joint in enumerate(arm.joint_names):
        low, high = float(q[:, j].min()), float(q[:, j].max())
        if low < arm.lower[j] - OUTSIDE or high > arm.upper[j] + OUTSIDE:
            inside = np.radians(low) > arm.lower[j] - OUTSIDE and np.radians(high) < arm.upper[j] + OUTSIDE
            unit = "m" if arm.prismatic[j] else "rad"
            hint = "; these look like degrees" if inside and not arm.prismatic[j] else ""
            raise InvalidInputError(
                f"q.{joint}: expected from {arm.lower[j]:.4g} to {arm.upper[j]:.4g} {unit}, got {low:.4g} to "
                f"{high:.4g}{hint}."
            )
    if not np.abs(command).max() > 0.0:
        raise InvalidInputError("expected commands that move joints, got a log at rest: all commands are 0.")
    held = (np.abs(command) >= AT_LIMIT * arm.velocity_limit).mean(axis=0)
    if (held > SATURATED).any():
        j = int(np.argmax(held))
        unit = "m/s" if arm.prismatic[j] else "rad/s"
        fastest = float(np.abs(command[:, j]).max())
        hint = "what a saturated drive does is no drive's lag"
        if not arm.prismatic[j] and fastest > BEYOND * arm.velocity_limit[j]:
            hint = f"up to {fastest:.4g}, these look like degrees"
        raise InvalidInputError(
            f"command.{arm.joint_names[j]}: expected commands within the velocity limit of {arm.velocity_limit[j]:.4g} "
            f"{unit}, got {100 * held[j]:.0f} % of them at it or beyond: {hint}."
        )
