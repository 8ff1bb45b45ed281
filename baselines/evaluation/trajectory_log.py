"""The trajectory log of an episode: what plots show of it."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode, Seeds
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Most pictures of a replay.
FRAMES = 400
#: Arrays by name, see :func:`trajectory_log`.
TrajectoryLog = dict[str, npt.NDArray[Any]]


def trajectory_log(scenario: Scenario, seeds: Seeds, episode: Episode) -> TrajectoryLog:
    """What plots show of an episode, at the steps that count.

    Args:
        scenario: The scenario.
        seeds: Seeds of the episode.
        episode: Its record.

    Returns:
        ``time`` in [s], of shape (k,), and over it ``nominal`` and ``pose`` (k, m), ``q`` and ``qdot`` (k, n),
        ``position_error`` and, where there is one, ``orientation_error`` (k,); ``nominal_q`` (k, n) where there is a
        nominal joint path; ``prismatic`` says which joints are prismatic, ``lower``, ``upper`` and ``velocity_limit``
        what the arm is limited to, infinite where it is not, all of shape (n,). Where it has limits of acceleration,
        ``acceleration_limit`` (n,), and ``qddot`` (k, n): the change of q̇ in the step by Δt, from rest at the start.
        For replays, at f <= :data:`FRAMES` of these steps, whose rows are ``frame`` (f,): ``joint_points``
        (f, n, 2, 3), where the joints of the arm that moves begin and end, ``tool`` (f, 3), both in [m], and
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


def frame_rows(rows: int, most: int) -> npt.NDArray[np.int64]:
    """At most so many of some rows, evenly spread; the last one always."""
    count = min(rows, most)
    frames: npt.NDArray[np.int64] = -(-np.arange(1, count + 1) * rows // count) - 1
    return frames


def _arm_in_space(scenario: Scenario, seeds: Seeds, q: FloatArray, made: npt.NDArray[np.int64]) -> TrajectoryLog:
    """Where the arm is after so many steps: the one that moves, and not the one in the data sheet."""
    plant = scenario.drawn_plant(seeds.seed, seeds.arm_seed)
    arms = [plant.loaded_arm if steps >= plant.payload_step else plant.arm for steps in made]
    places = [arm.forward(row) for arm, row in zip(arms, q, strict=True)]
    points = np.array([arm.joint_points(row) for arm, row in zip(arms, q, strict=True)])
    return {
        "joint_points": points.astype(np.float32),
        "tool": np.array([position for _, position in places], dtype=np.float32),
        "tool_rotation": np.array([rotation for rotation, _ in places], dtype=np.float32),
    }
