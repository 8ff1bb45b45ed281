"""An episode as files: the trajectory log behind plots, joint motions as tables, and as messages for ROS 2."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.evaluation.motion.contacts import carried
from baselines.evaluation.motion.message import joint_trajectory, mcap
from baselines.evaluation.motion.played import Motion, by_joint
from baselines.files import csv_text
from baselines.recording import Episode, Seeds
from ikgym.exceptions import MissingDependencyError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray, known_names

#: Most pictures of a replay.
FRAMES = 400
#: Arrays by name, see :func:`trajectory_log`.
TrajectoryLog = dict[str, npt.NDArray[Any]]


def table(columns: Mapping[str, npt.NDArray[Any]]) -> bytes:
    """Columns as CSV, one line a row; numbers keep all digits, NaN is an empty cell."""
    lines = zip(*(values.tolist() for values in columns.values()), strict=True)
    return csv_text(columns, (["" if cell != cell else cell for cell in line] for line in lines)).encode()


def motion_table(scenario: Scenario, seeds: Seeds, episode: Episode, accelerations: bool = False) -> bytes:
    """The joint motion as CSV: times, joint coordinates and velocities, from the start, with units in the head."""
    motion = Motion.of(scenario, seeds, episode)
    columns = {
        "time [s]": motion.times,
        **by_joint(scenario.arm, motion.q),
        **by_joint(scenario.arm, motion.qdot, "/s"),
    }
    return table(columns | (by_joint(scenario.arm, motion.qddot, "/s²") if accelerations else {}))


class Format(NamedTuple):
    """A kind of file: the suffix of its name, and its content, with accelerations or without."""

    suffix: str
    content: Callable[[Scenario, Seeds, Episode, bool], bytes]
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


def trajectory_log(scenario: Scenario, seeds: Seeds, episode: Episode) -> TrajectoryLog:
    """The data of the plots of an episode, at the steps that count.

    Args:
        scenario: The scenario.
        seeds: Seeds of the episode.
        episode: Its record.

    Returns:
        ``time`` in [s], of shape (k,), and over it ``nominal`` and ``pose`` (k, m), ``q`` and ``qdot`` (k, n),
        ``position_error`` and, where there is one, ``orientation_error`` (k,); ``joint_names``; ``prismatic``,
        which joints are prismatic, and the limits ``lower``, ``upper`` and ``velocity_limit`` of the arm, infinite
        where there is none, all of shape (n,). If there are limits of acceleration, ``acceleration_limit`` (n,), and
        ``qddot`` (k, n): the change of q̇ in the step by Δt, from rest.
        For replays, at f <= :data:`FRAMES` of these steps, whose rows are ``frame`` (f,): ``joint_points``
        (f, n, 2, 3), the ends of the joints of the arm that moves, and ``tool`` (f, 3), both in [m], and
        ``tool_rotation`` (f, 3, 3).
        Where the scenario has collisions, ``clearance`` (k,) in [m], and the arrays of
        :func:`baselines.evaluation.motion.contacts.carried` for the replay.
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
    frames = frame_rows(len(kept), FRAMES)
    log |= {"frame": frames, **_arm_in_space(scenario, seeds, log["q"][frames], after[frames])}
    if episode.clearance is None:
        return log
    return log | {"clearance": episode.clearance[kept]} | carried(scenario, seeds, log["q"][frames], after[frames])


#: Arrays of every log.
USUAL = (
    *("time", "nominal", "pose", "q", "qdot", "position_error", "joint_names", "prismatic", "lower", "upper"),
    *("velocity_limit", "frame", "joint_points", "tool", "tool_rotation"),
)


def frame_rows(rows: int, most: int) -> npt.NDArray[np.int64]:
    """At most so many rows, evenly spread; the last one always."""
    count = min(rows, most)
    frames: npt.NDArray[np.int64] = -(-np.arange(1, count + 1) * rows // count) - 1
    return frames


def _arm_in_space(scenario: Scenario, seeds: Seeds, q: FloatArray, after: npt.NDArray[np.int64]) -> TrajectoryLog:
    """Points of the arm that moves, which may differ from its data sheet, after numbers of steps."""
    plant, n = scenario.drawn_plant(seeds.seed, seeds.arm_seed), scenario.joints
    loaded = after >= plant.payload_step
    points, tool, rotation = np.empty((len(q), n, 2, 3)), np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for rows, arm in ((~loaded, plant.arm), (loaded, plant.loaded_arm)):
        points[rows] = arm.joint_points(q[rows])
        rotation[rows], tool[rows] = arm.forward(q[rows])
    arrays = {"joint_points": points, "tool": tool, "tool_rotation": rotation}
    return {name: array.astype(np.float32) for name, array in arrays.items()}
