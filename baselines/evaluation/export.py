"""An episode as files: the trajectory log behind plots, joint motions as tables, and messages for ROS 2."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode, Seeds
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, known_names

#: Most pictures of a replay.
FRAMES = 400
#: Arrays by name, see :func:`trajectory_log`.
TrajectoryLog = dict[str, npt.NDArray[Any]]


class Motion(NamedTuple):
    """The joint motion of an episode, from its start.

    Attributes:
        times: From 0, in [s]. Shape (steps + 1,).
        q: Joint coordinates at these times, in [rad] or [m]. Shape (steps + 1, n).
        qdot: Joint velocities of the step that ends then, 0 at the start, in [rad/s] or [m/s]. Shape (steps + 1, n).
    """

    times: FloatArray
    q: FloatArray
    qdot: FloatArray

    @classmethod
    def of(cls, scenario: Scenario, seeds: Seeds, episode: Episode) -> Motion:
        """The motion of an episode."""
        q = np.vstack([scenario.start_of(seeds.seed, seeds.arm_seed), episode.q])
        return cls(scenario.times(scenario.steps + 1), q, np.vstack([np.zeros(scenario.joints), episode.qdot]))


def table(columns: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Columns as CSV, one line a row; numbers keep all digits, NaN is an empty cell."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for cells in zip(*(values.tolist() for values in columns.values()), strict=True):
        writer.writerow(["" if cell != cell else cell for cell in cells])
    return text.getvalue().encode()


def motion_table(scenario: Scenario, seeds: Seeds, episode: Episode) -> bytes:
    """The joint motion as CSV: times, joint coordinates and velocities, from the start, with units in the head."""
    times, q, qdot = Motion.of(scenario, seeds, episode)
    columns: dict[str, npt.NDArray[Any]] = {"time [s]": times}
    for values, per in ((q, ""), (qdot, "/s")):
        for joint, (name, prismatic) in enumerate(zip(scenario.arm.joint_names, scenario.arm.prismatic, strict=True)):
            columns[f"{name} [{'m' if prismatic else 'rad'}{per}]"] = values[:, joint]
    return table(columns)


def joint_trajectory(scenario: Scenario, seeds: Seeds, episode: Episode) -> bytes:
    """The joint motion as a `trajectory_msgs/msg/JointTrajectory` in JSON, which `ros2 topic pub` reads.

    The header's time of 0 means at once. Accelerations and efforts are left to the controller: a velocity is that of a
    whole step, and so has none.
    """
    times, q, qdot = Motion.of(scenario, seeds, episode)
    points = zip(times.tolist(), q.tolist(), qdot.tolist(), strict=True)
    message = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(scenario.arm.joint_names),
        "points": [
            {
                "positions": positions,
                "velocities": velocities,
                "accelerations": [],
                "effort": [],
                "time_from_start": dict(zip(("sec", "nanosec"), divmod(round(1e9 * time), 10**9), strict=True)),
            }
            for time, positions, velocities in points
        ],
    }
    return (json.dumps(message, ensure_ascii=False, allow_nan=False) + "\n").encode()


class Format(NamedTuple):
    """A kind of file: the suffix of its name, and its content."""

    suffix: str
    content: Callable[[Scenario, Seeds, Episode], bytes]


#: Formats of joint motions by name.
FORMATS: Mapping[str, Format] = {
    "csv": Format(".csv", motion_table),
    "joint-trajectory": Format(".json", joint_trajectory),
}


def formats(names: str | Iterable[str]) -> tuple[str, ...]:
    """The names of formats, each once.

    Raises:
        UnknownNameError: There is no format of a name.
    """
    given = (names,) if isinstance(names, str) else tuple(names)
    known_names("format of export", given, tuple(FORMATS))
    return tuple(dict.fromkeys(given))


def trajectory_log(scenario: Scenario, seeds: Seeds, episode: Episode) -> TrajectoryLog:
    """The data of the plots of an episode, at the steps that count.

    Args:
        scenario: The scenario.
        seeds: Seeds of the episode.
        episode: Its record.

    Returns:
        ``time`` in [s], of shape (k,), and over it ``nominal`` and ``pose`` (k, m), ``q`` and ``qdot`` (k, n),
        ``position_error`` and, where there is one, ``orientation_error`` (k,); ``nominal_q`` (k, n) where there is a
        nominal joint path; ``joint_names``; ``prismatic``, which joints are prismatic, and the limits ``lower``,
        ``upper`` and ``velocity_limit`` of the arm, infinite where there is none, all of shape (n,). If there are
        limits of acceleration, ``acceleration_limit`` (n,), and ``qddot`` (k, n): the change of q̇ in the step by Δt,
        from rest.
        For replays, at f <= :data:`FRAMES` of these steps, whose rows are ``frame`` (f,): ``joint_points``
        (f, n, 2, 3), the ends of the joints of the arm that moves, and ``tool`` (f, 3), both in [m], and
        ``tool_rotation`` (f, 3, 3).
    """
    after = np.flatnonzero(scenario.counted())
    kept = after - 1
    log: TrajectoryLog = {
        "time": after * scenario.dt,
        "nominal": scenario.nominal(seeds.seed)[after],
        "pose": episode.pose[kept],
        "q": episode.q[kept],
        "qdot": episode.qdot[kept],
        "position_error": episode.position_error[kept],
        "joint_names": np.array(scenario.arm.joint_names),
        "prismatic": np.array(scenario.arm.prismatic, dtype=np.bool_),
        "lower": scenario.arm.lower,
        "upper": scenario.arm.upper,
        "velocity_limit": scenario.arm.velocity_limit,
    }
    if scenario.task.has_orientation:
        log["orientation_error"] = episode.orientation_error[kept]
    if np.isfinite(scenario.arm.acceleration_limit).any():
        start = np.zeros((1, scenario.joints))
        log["qddot"] = (np.diff(episode.qdot, axis=0, prepend=start) / scenario.dt)[kept]
        log["acceleration_limit"] = scenario.arm.acceleration_limit
    path = scenario.nominal_joint_path(seeds.seed)
    if path is not None:
        log["nominal_q"] = path[after]
    frames = frame_rows(len(kept), FRAMES)
    return log | {"frame": frames, **_arm_in_space(scenario, seeds, log["q"][frames], after[frames])}


#: The axes of the arrays of a log; those that have names of one letter are of the same length in all arrays.
AXES: Mapping[str, tuple[str | int, ...]] = {
    **dict.fromkeys(("nominal", "pose"), ("k", "m")),
    **dict.fromkeys(("q", "qdot", "nominal_q", "qddot"), ("k", "n")),
    **dict.fromkeys(("time", "position_error", "orientation_error"), ("k",)),
    **dict.fromkeys(("joint_names", "prismatic", "lower", "upper", "velocity_limit", "acceleration_limit"), ("n",)),
    "frame": ("f",),
    "joint_points": ("f", "n", 2, 3),
    "tool": ("f", 3),
    "tool_rotation": ("f", 3, 3),
}
OPTIONAL = ("orientation_error", "qddot", "acceleration_limit", "nominal_q")


def check_log(log: Mapping[str, npt.NDArray[Any]]) -> None:
    """Checks names, shapes and types of the arrays of a log that was read.

    Raises:
        ValueError: One is missing, unknown or of another type, or lengths do not fit together.
    """
    known_names("array of a log", log, tuple(AXES))
    lengths: dict[str | int, int] = {2: 2, 3: 3}
    for name, axes in AXES.items():
        if name not in log and name in OPTIONAL:
            continue
        shape = log[name].shape if name in log else None
        kinds, what = ("U", "texts") if name == "joint_names" else ("fiub", "numbers")
        if shape is None or log[name].dtype.kind not in kinds or len(shape) != len(axes):
            raise ValueError(f"expected {what} of shape {axes} in the array {name}, got shape {shape}")
        if any(lengths.setdefault(axis, length) != length for axis, length in zip(axes, shape, strict=True)):
            raise ValueError(f"the shape {shape} of the array {name} does not fit the others")


def frame_rows(rows: int, most: int) -> npt.NDArray[np.int64]:
    """At most so many rows, evenly spread; the last one always."""
    count = min(rows, most)
    frames: npt.NDArray[np.int64] = -(-np.arange(1, count + 1) * rows // count) - 1
    return frames


def _arm_in_space(scenario: Scenario, seeds: Seeds, q: FloatArray, after: npt.NDArray[np.int64]) -> TrajectoryLog:
    """Points of the arm that moves, which may differ from its data sheet, after numbers of steps."""
    plant = scenario.drawn_plant(seeds.seed, seeds.arm_seed)
    arms = [plant.loaded_arm if steps >= plant.payload_step else plant.arm for steps in after]
    places = [arm.forward(row) for arm, row in zip(arms, q, strict=True)]
    points = np.array([arm.joint_points(row) for arm, row in zip(arms, q, strict=True)])
    return {
        "joint_points": points.astype(np.float32),
        "tool": np.array([position for _, position in places], dtype=np.float32),
        "tool_rotation": np.array([rotation for rotation, _ in places], dtype=np.float32),
    }
