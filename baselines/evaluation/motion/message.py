"""The joint motion as a `trajectory_msgs/msg/JointTrajectory`: in JSON for `ros2 topic pub`, and in MCAP."""

from __future__ import annotations

import pathlib
import tempfile
from typing import Any

import numpy as np

from baselines.evaluation.motion.played import Motion
from baselines.evaluation.motion.spline import smooth
from baselines.evaluation.motion.stop import stopped
from baselines.files import json_text
from baselines.recording import Episode, Seeds
from ikgym.scenarios import Scenario

KIND = "trajectory_msgs/msg/JointTrajectory"
#: Topic of the message in an MCAP file.
TOPIC = "/joint_trajectory_controller/joint_trajectory"
#: Fields of a point with one number a joint.
NUMBERS = ("positions", "velocities", "accelerations", "effort")


def message(scenario: Scenario, seeds: Seeds, episode: Episode, accelerations: bool = False) -> dict[str, Any]:
    """The fields of the message; a time of 0 in the header means at once.

    From rest at the start to rest at the end, see :func:`baselines.evaluation.motion.stop.stopped`, with the velocities
    of a cubic spline, see :func:`baselines.evaluation.motion.spline.smooth`. Controllers interpolate cubically between
    points without accelerations, else by quintics.

    Raises:
        InvalidInputError: The episode ends in motion, and has no room to stop.
    """
    q = stopped(scenario.arm, Motion.of(scenario, seeds, episode).q, scenario.dt)
    points = smooth(q, scenario.dt)
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


def joint_trajectory(scenario: Scenario, seeds: Seeds, episode: Episode, accelerations: bool = False) -> bytes:
    """The message in JSON, which `ros2 topic pub` reads; see :func:`message`."""
    return json_text(message(scenario, seeds, episode, accelerations)).encode()


def mcap(scenario: Scenario, seeds: Seeds, episode: Episode, accelerations: bool = False) -> bytes:
    """An MCAP file with the message, which `ros2 bag` and readers without ROS open; see :func:`message`."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    fields = message(scenario, seeds, episode, accelerations)
    with tempfile.TemporaryDirectory() as folder:
        bag = pathlib.Path(folder) / "motion"
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connection = writer.add_connection(TOPIC, KIND, typestore=store)
            writer.write(connection, 0, store.serialize_cdr(_typed(store.types, fields), KIND))
        (file,) = bag.glob("*.mcap")
        return file.read_bytes()


def _typed(types: Any, fields: dict[str, Any]) -> Any:
    """The message as rosbags has it."""
    duration, point = types["builtin_interfaces/msg/Duration"], types["trajectory_msgs/msg/JointTrajectoryPoint"]
    stamp, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    points = [
        point(**{key: np.array(one[key]) for key in NUMBERS}, time_from_start=duration(**one["time_from_start"]))
        for one in fields["points"]
    ]
    head = header(stamp=stamp(**fields["header"]["stamp"]), frame_id=fields["header"]["frame_id"])
    return types[KIND](header=head, joint_names=fields["joint_names"], points=points)
