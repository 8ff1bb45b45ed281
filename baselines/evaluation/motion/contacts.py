"""Bodies and obstacles of an episode: where they are in space."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.recording import Seeds
from ikgym.obstacles.solids import closest, link_frames, on_links, solids_of
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: The frame of fixed objects.
AT_REST = np.append(np.eye(3), np.zeros(3))


def carried(
    scenario: Scenario, seeds: Seeds, q: FloatArray, after: npt.NDArray[np.int64]
) -> dict[str, npt.NDArray[Any]]:
    """Solids in the frames that carry them, and the closest points; see :mod:`ikgym.obstacles.solids`.

    Args:
        scenario: A scenario with collisions.
        seeds: Seeds of the episode.
        q: Joint coordinates at some moments in [rad] or [m]. Shape (f, n).
        after: The steps made then. Shape (f,).

    Returns:
        ``solids`` (s, 16): the bodies, then the obstacles; ``carriers`` (s,): the frame of each of them; and over the
        moments ``carrier_frames`` (f, c, 12): those of the base and the n links, that of all obstacles at rest, and
        those of the others; and ``closest`` (f, 2, 3) in [m].
    """
    plant, bodies = scenario.drawn_plant(seeds.seed, seeds.arm_seed), scenario.arm.bodies
    obstacles = scenario.obstacles_of(seeds.seed)
    boxes = solids_of(obstacles, scenario.dt * after.astype(np.float64), scenario.model)
    boxes = np.broadcast_to(boxes, (len(q), *boxes.shape[1:]))
    frames, points = np.empty((len(q), scenario.joints + 1, 12)), np.empty((len(q), 2, 3))
    for arm, rows in ((plant.arm, after < plant.payload_step), (plant.loaded_arm, after >= plant.payload_step)):
        frames[rows] = link_frames(arm, q[rows])
        points[rows] = closest(arm, q[rows], boxes[rows], scenario.surroundings.checked).points
    moving = [number for number, one in enumerate(obstacles) if one.motion is not None]
    solids, own = boxes[0].copy(), np.full(len(boxes[0]), scenario.joints + 1)
    solids[moving, :12], own[moving] = AT_REST, scenario.joints + 2 + np.arange(len(moving))
    still = np.tile(AT_REST, (len(q), 1, 1))
    return {
        "solids": np.vstack([on_links(bodies), solids]),
        "carriers": np.concatenate([np.array(bodies.links, dtype=np.int64), own]),
        "carrier_frames": np.concatenate([frames, still, boxes[:, moving, :12]], axis=1).astype(np.float32),
        "closest": points.astype(np.float32),
    }
