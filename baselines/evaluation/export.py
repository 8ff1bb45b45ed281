"""The joint motion of an episode as files: a table, and a ROS 2 message in JSON or MCAP."""

from __future__ import annotations

import importlib.util
import pathlib
import tempfile
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode
from baselines.evaluation.motion.spline import smooth, stop
from baselines.files import csv_text, json_text
from ikgym.arms import Arm
from ikgym.exceptions import MissingDependencyError
from ikgym.validation import FloatArray, known_names

KIND = "trajectory_msgs/msg/JointTrajectory"
#: Topic of the message in an MCAP file.
TOPIC = "/joint_trajectory_controller/joint_trajectory"
#: Fields of a point with one number a joint.
NUMBERS = ("positions", "velocities", "accelerations", "effort")


class Motion(NamedTuple):
    """The joint motion of an episode, from its start."""

    times: FloatArray  # from 0, in [s]. Shape (steps + 1,)
    q: FloatArray  # joint coordinates at these times, in [rad] or [m]. Shape (steps + 1, n)
    # joint velocities of the step that ends then, 0 at the start, in [rad/s] or [m/s]. Shape (steps + 1, n)
    qdot: FloatArray

    @classmethod
    def of(cls, episode: Episode) -> Motion:
        """The motion of an episode."""
        scenario, seeds = episode.scenario, episode.seeds
        q = np.vstack([scenario.start_of(seeds.seed, seeds.arm_seed), episode.q])
        return cls(scenario.times(scenario.steps + 1), q, np.vstack([np.zeros(scenario.joints), episode.qdot]))

    @property
    def qddot(self) -> FloatArray:
        """Change of the velocity in the step that ends then by Δt, in [rad/s²] or [m/s²]. Shape (steps + 1, n)."""
        out: FloatArray = np.diff(self.qdot, axis=0, prepend=self.qdot[:1]) / (self.times[1] - self.times[0])
        return out


def by_joint(arm: Arm, values: FloatArray, per: str = "") -> dict[str, FloatArray]:
    """Columns of a table by joint and unit, of values (k, n); `per` follows the unit of the joint, such as ``/s``."""
    units = ["m" if prismatic else "rad" for prismatic in arm.prismatic]
    heads = [f"{name} [{unit}{per}]" for name, unit in zip(arm.joint_names, units, strict=True)]
    return dict(zip(heads, values.T, strict=True))


def table(columns: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Columns as CSV, one line a row; numbers keep all digits, NaN is an empty cell."""
    lines = zip(*(values.tolist() for values in columns.values()), strict=True)
    return csv_text(columns, (["" if cell != cell else cell for cell in line] for line in lines)).encode()


def motion_table(episode: Episode, accelerations: bool = False) -> bytes:
    """The joint motion as CSV: times, joint coordinates and velocities, from the start, with units in the head."""
    motion, arm = Motion.of(episode), episode.scenario.arm
    columns = {"time [s]": motion.times, **by_joint(arm, motion.q), **by_joint(arm, motion.qdot, "/s")}
    return table(columns | (by_joint(arm, motion.qddot, "/s²") if accelerations else {}))


def message(episode: Episode, accelerations: bool = False) -> dict[str, Any]:
    """The fields of the message; a time of 0 in the header means at once.

    From rest at the start to rest at the end, see :func:`baselines.evaluation.motion.spline.stop`, with the velocities
    of a cubic spline, see :func:`baselines.evaluation.motion.spline.smooth`. Controllers interpolate cubically between
    points without accelerations, else by quintics. Where the scenario limits jerk, accelerations are continuous, and
    both are the same curve.

    Raises:
        InvalidInputError: The episode ends in motion, and has no room to stop.
    """
    scenario = episode.scenario
    jerk = scenario.jerk_limit if np.isfinite(scenario.jerk_limit).any() else None
    q = stop(scenario.arm, Motion.of(episode).q, scenario.dt, jerk)
    points = smooth(q, scenario.dt, jerk=jerk is not None)
    times = scenario.dt * np.arange(len(points.q))
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(scenario.arm.joint_names),
        "points": [
            {
                "positions": q,
                "velocities": qdot,
                "accelerations": qddot if accelerations else [],
                "effort": [],
                "time_from_start": dict(zip(("sec", "nanosec"), divmod(round(1e9 * time), 10**9), strict=True)),
            }
            for time, q, qdot, qddot in zip(times.tolist(), *(array.tolist() for array in points), strict=True)
        ],
    }


def joint_trajectory(episode: Episode, accelerations: bool = False) -> bytes:
    """The message in JSON, which `ros2 topic pub` reads; see :func:`message`."""
    return json_text(message(episode, accelerations)).encode()


def mcap(episode: Episode, accelerations: bool = False) -> bytes:
    """An MCAP file with the message, which `ros2 bag` and readers without ROS open; see :func:`message`."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    fields = message(episode, accelerations)
    with tempfile.TemporaryDirectory() as folder:
        bag = pathlib.Path(folder) / "motion"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(TOPIC, KIND, typestore=store)
            writer.write(connection, 0, store.serialize_cdr(_to_rosbags(store.types, fields), KIND))
        (file,) = bag.glob("*.mcap")
        return file.read_bytes()


def _to_rosbags(types: Any, fields: dict[str, Any]) -> Any:
    """The message as rosbags has it."""
    duration, point = types["builtin_interfaces/msg/Duration"], types["trajectory_msgs/msg/JointTrajectoryPoint"]
    stamp, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    points = [
        point(**{key: np.array(one[key]) for key in NUMBERS}, time_from_start=duration(**one["time_from_start"]))
        for one in fields["points"]
    ]
    head = header(stamp=stamp(**fields["header"]["stamp"]), frame_id=fields["header"]["frame_id"])
    return types[KIND](header=head, joint_names=fields["joint_names"], points=points)


class Format(NamedTuple):
    """A kind of file: the suffix of its name, and its content, with accelerations or without."""

    suffix: str
    content: Callable[[Episode, bool], bytes]
    package: str = ""


#: Formats of joint motions by name.
FORMATS: Mapping[str, Format] = {
    "csv": Format(".csv", motion_table),
    "joint-trajectory": Format(".json", joint_trajectory),
    "mcap": Format(".mcap", mcap, "rosbags"),
}


def check_formats(names: Iterable[str]) -> None:
    """Refuses formats that do not exist, and those whose package is not installed.

    Raises:
        UnknownNameError: There is no format of a name.
        MissingDependencyError: The package of a format is not installed.
    """
    known_names("format of export", names, tuple(FORMATS))
    for name in names:
        if (package := FORMATS[name].package) and importlib.util.find_spec(package) is None:
            raise MissingDependencyError(f'Format {name!r} needs {package}: pip install "ikgym[paths]"')
