"""The trajectory log of an episode: the data of plots and replays."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.episodes import Episode
from ikgym.obstacles.solids import closest, link_frames, on_links, solids_of
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
        Where the scenario has collisions, ``clearance`` (k,) in [m], and at the same moments the solids in the frames
        that carry them, see :mod:`ikgym.obstacles.solids`: ``solids`` (s, 16), the bodies, then the obstacles;
        ``carriers`` (s,), the frame of each of them; ``carrier_frames`` (f, c, 12), those of the base and the n links,
        that of all obstacles at rest, and those of the others; and the ``closest`` points (f, 2, 3) in [m].
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
    log |= {"frame": frames, **_place_arm(episode, log["q"][frames], after[frames])}
    return log if episode.clearance is None else log | {"clearance": episode.clearance[kept]}


def frame_rows(rows: int, most: int) -> npt.NDArray[np.int64]:
    """At most `most` rows, evenly spread; the last one always."""
    count = min(rows, most)
    frames: npt.NDArray[np.int64] = -(-np.arange(1, count + 1) * rows // count) - 1
    return frames


def _place_arm(episode: Episode, q: FloatArray, after: npt.NDArray[np.int64]) -> TrajectoryLog:
    """The arm that moves, which may differ from its data sheet, and what it could touch, after numbers of steps."""
    scenario, collides = episode.scenario, episode.clearance is not None
    plant = scenario.drawn_plant(episode.seeds.seed, episode.seeds.arm_seed)
    n, obstacles = scenario.joints, scenario.obstacles_of(episode.seeds.seed) if collides else ()
    boxes = solids_of(obstacles, scenario.dt * after.astype(np.float64), scenario.model)
    boxes = np.broadcast_to(boxes, (len(q), *boxes.shape[1:]))
    points, tool, rotation = np.empty((len(q), n, 2, 3)), np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    frames, nearest = np.empty((len(q), n + 1, 12)), np.empty((len(q), 2, 3))
    for arm, rows in ((plant.arm, after < plant.payload_step), (plant.loaded_arm, after >= plant.payload_step)):
        points[rows] = arm.joint_points(q[rows])
        rotation[rows], tool[rows] = arm.forward(q[rows])
        if collides:
            frames[rows] = link_frames(arm, q[rows])
            nearest[rows] = closest(arm, q[rows], boxes[rows], scenario.surroundings.checked).points
    arrays: TrajectoryLog = {"joint_points": points, "tool": tool, "tool_rotation": rotation}
    arrays = {name: array.astype(np.float32) for name, array in arrays.items()}
    if not collides:
        return arrays
    bodies, moving = scenario.arm.bodies, [k for k, one in enumerate(obstacles) if one.motion is not None]
    solids, carriers = boxes[0].copy(), np.full(len(boxes[0]), n + 1)
    solids[moving, :12], carriers[moving] = AT_REST, n + 2 + np.arange(len(moving))
    still = np.tile(AT_REST, (len(q), 1, 1))
    return arrays | {
        "solids": np.vstack([on_links(bodies), solids]),
        "carriers": np.concatenate([np.array(bodies.links, dtype=np.int64), carriers]),
        "carrier_frames": np.concatenate([frames, still, boxes[:, moving, :12]], axis=1).astype(np.float32),
        "closest": nearest.astype(np.float32),
    }
