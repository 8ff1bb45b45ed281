"""Bodies of an arm and obstacles in viser's scene, and a line between the closest pair with its distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines.viewer.readings import Colour
from baselines.viewer.replay import Stage, size
from ikgym.kernels.rotations import quaternion
from ikgym.obstacles.solids import Closest, bounded, on_links, surface
from ikgym.validation import FloatArray

#: Colours (red, green, blue) of obstacles and of the line, and opacities.
OBSTACLE, LINE = (168, 140, 110), (34, 34, 34)
OF_BODIES, OF_OBSTACLES = 0.35, 0.6
#: Half the edge of the plate that stands for a half-space, as a share of the arm's reach.
PLATE = 0.54


class DrawnBodies:
    """The bodies of one arm, which move with its frames, and the obstacles around it."""

    def __init__(self, server: Any, links: Sequence[str], stage: Stage, colour: Colour) -> None:
        self._scene, bodies, root = server.scene, stage.scenario.arm.bodies, links[0]
        self._edge = PLATE * size(stage.scenario.arm)
        places = [f"{links[link]}/body_{number}" for number, link in enumerate(bodies.links)]
        self._bodies = [
            self._solid(name, solid, colour, OF_BODIES) for name, solid in zip(places, on_links(bodies), strict=True)
        ]
        self._boxes = bounded(stage.obstacles(0), self._edge)
        self._obstacles = [
            self._solid(f"{root}/obstacle_{number}", solid, OBSTACLE, OF_OBSTACLES)
            for number, solid in enumerate(self._boxes)
        ]
        self._line = self._scene.add_line_segments(f"{root}/closest", np.zeros((1, 2, 3)), colors=LINE, line_width=2.0)
        self._distance = self._scene.add_label(f"{root}/distance", "")
        self.switch(on=stage.scenario.collides)

    def switch(self, *, on: bool) -> None:
        """Shows all of them, or none."""
        self._on = on
        for handle in (*self._bodies, *self._obstacles, self._line, self._distance):
            handle.visible = on

    def show(self, found: Closest, obstacles: FloatArray) -> None:
        """Moves the obstacles (o, 16), and the line between the closest pair; the bodies move with the arm."""
        boxes = bounded(obstacles, self._edge)
        for number in np.flatnonzero((boxes != self._boxes).any(axis=1)).tolist():
            _move(self._obstacles[number], boxes[number])
        self._boxes, distance = boxes, float(found.distances[0])
        self._line.visible = self._distance.visible = self._on and np.isfinite(distance)
        if np.isfinite(distance):
            self._line.points = found.points.astype(np.float32)
            self._distance.text, self._distance.position = f"{1e3 * distance:.1f} mm", found.points[0].mean(axis=0)

    def _solid(self, name: str, solid: FloatArray, colour: Colour, opacity: float) -> Any:
        vertices, faces = surface(solid[12:])
        look: dict[str, Any] = {"color": colour, "opacity": opacity, "flat_shading": bool(solid[15] == 0.0)}
        handle = self._scene.add_mesh_simple(name, vertices, faces, side="double", **look)
        _move(handle, solid)
        return handle


def _move(handle: Any, solid: FloatArray) -> None:
    handle.position, handle.wxyz = solid[9:12], quaternion(solid[:9].reshape(3, 3))
