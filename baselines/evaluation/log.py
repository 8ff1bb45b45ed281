"""The trajectory log of an episode: the data of plots and replays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode
from ikgym.obstacles.solids import closest, link_frames, on_links, solids_of
from ikgym.plant.draw import DrawnPlant
from ikgym.validation import FloatArray

#: Most pictures of a replay.
FRAMES = 400
#: Arrays by name, see :func:`trajectory_log`.
TrajectoryLog = dict[str, npt.NDArray[Any]]
#: The frame of fixed objects.
AT_REST = np.append(np.eye(3), np.zeros(3))


def trajectory_log(episode: Episode) -> TrajectoryLog:
    """The data of the plots of an episode, at the steps that count.

    Returns:
        ``time`` in [s], of shape (k,), and over it ``nominal`` and ``pose`` (k, m), ``q`` and ``qdot`` (k, n),
        ``position_error`` and, where there is one, ``orientation_error`` (k,); ``joint_names``; ``prismatic``,
        which joints are prismatic, and the limits ``lower``, ``upper`` and ``velocity_limit`` of the arm, infinite
        where there is none, all of shape (n,). If there are limits of acceleration, ``acceleration_limit`` (n,), and
        ``qddot`` (k, n): the change of q̇ in the step by Δt, from rest.
        For replays, at f <= :data:`FRAMES` of these steps, whose rows are ``frame`` (f,): ``joint_points``
        (f, n, 2, 3), the ends of the joints of the arm that moves, and ``tool`` (f, 3), both in [m], and
        ``tool_rotation`` (f, 3, 3).
        Where the scenario has collisions, ``clearance`` (k,) in [m], and the arrays of :func:`_place_solids`.
    """
    scenario = episode.scenario
    after = np.flatnonzero(scenario.counted())
    kept = after - 1
    log: TrajectoryLog = {
        "time": after * scenario.dt,
        "nominal": scenario.nominal(episode.seeds.seed)[after],
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
    log |= {"frame": frames, **_arm_in_space(episode, log["q"][frames], after[frames])}
    if episode.clearance is None:
        return log
    return log | {"clearance": episode.clearance[kept]} | _place_solids(episode, log["q"][frames], after[frames])


def frame_rows(rows: int, most: int) -> npt.NDArray[np.int64]:
    """At most `most` rows, evenly spread; the last one always."""
    count = min(rows, most)
    frames: npt.NDArray[np.int64] = -(-np.arange(1, count + 1) * rows // count) - 1
    return frames


def _arm_in_space(episode: Episode, q: FloatArray, after: npt.NDArray[np.int64]) -> TrajectoryLog:
    """Points of the arm that moves, which may differ from its data sheet, after numbers of steps."""
    plant, n = _plant(episode), episode.scenario.joints
    loaded = after >= plant.payload_step
    points, tool, rotation = np.empty((len(q), n, 2, 3)), np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for rows, arm in ((~loaded, plant.arm), (loaded, plant.loaded_arm)):
        points[rows] = arm.joint_points(q[rows])
        rotation[rows], tool[rows] = arm.forward(q[rows])
    arrays = {"joint_points": points, "tool": tool, "tool_rotation": rotation}
    return {name: array.astype(np.float32) for name, array in arrays.items()}


def _plant(episode: Episode) -> DrawnPlant:
    return episode.scenario.drawn_plant(episode.seeds.seed, episode.seeds.arm_seed)


def _place_solids(episode: Episode, q: FloatArray, after: npt.NDArray[np.int64]) -> TrajectoryLog:
    """Solids in the frames that carry them, and the closest points; see :mod:`ikgym.obstacles.solids`.

    Args:
        episode: An episode of a scenario with collisions.
        q: Joint coordinates at some moments in [rad] or [m]. Shape (f, n).
        after: The steps made then. Shape (f,).

    Returns:
        ``solids`` (s, 16): the bodies, then the obstacles; ``carriers`` (s,): the frame of each of them; and over the
        moments ``carrier_frames`` (f, c, 12): those of the base and the n links, that of all obstacles at rest, and
        those of the others; and ``closest`` (f, 2, 3) in [m].
    """
    scenario, plant = episode.scenario, _plant(episode)
    bodies, obstacles = scenario.arm.bodies, scenario.obstacles_of(episode.seeds.seed)
    boxes = solids_of(obstacles, scenario.dt * after.astype(np.float64), scenario.model)
    boxes = np.broadcast_to(boxes, (len(q), *boxes.shape[1:]))
    frames, points = np.empty((len(q), scenario.joints + 1, 12)), np.empty((len(q), 2, 3))
    for arm, rows in ((plant.arm, after < plant.payload_step), (plant.loaded_arm, after >= plant.payload_step)):
        frames[rows] = link_frames(arm, q[rows])
        points[rows] = closest(arm, q[rows], boxes[rows], scenario.surroundings.checked).points
    moving = [number for number, one in enumerate(obstacles) if one.motion is not None]
    solids, carriers = boxes[0].copy(), np.full(len(boxes[0]), scenario.joints + 1)
    solids[moving, :12], carriers[moving] = AT_REST, scenario.joints + 2 + np.arange(len(moving))
    still = np.tile(AT_REST, (len(q), 1, 1))
    return {
        "solids": np.vstack([on_links(bodies), solids]),
        "carriers": np.concatenate([np.array(bodies.links, dtype=np.int64), carriers]),
        "carrier_frames": np.concatenate([frames, still, boxes[:, moving, :12]], axis=1).astype(np.float32),
        "closest": points.astype(np.float32),
    }
