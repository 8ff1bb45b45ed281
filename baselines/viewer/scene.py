"""Arms side by side in viser's scene, with the reference, the paths and a target that can be dragged."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines.evaluation.plots.style import COLOURS
from baselines.viewer.arms import DrawnArm, Shape
from baselines.viewer.bodies import DrawnBodies
from baselines.viewer.readings import Colour
from baselines.viewer.replay import size
from baselines.viewer.session import Mode, Session, Shown
from ikgym.kernels.rotations import quaternion
from ikgym.rendering.style import GREEN, PALE_GREEN, stride, thinned
from ikgym.validation import FloatArray

# Distances and sizes, as shares of the arm's reach.
APART, TARGET, AXES, AXES_RADIUS, BALL, BELOW = 1.1, 0.16, 0.09, 0.004, 0.012, 0.08
# Distance of the camera from one arm, further distance for each other one, and height of the point it looks at.
FAR, FARTHER, LOOKED_AT = 1.4, 1.0, 0.3
# Vertical field of view of the camera in [rad], and the share of half of it by which the panel shifts the centre.
VIEW, BESIDE = 0.7, 0.4


class Scene:
    """The arms of a session on a server of viser, with the meshes of the arm, or cylinders if there are none."""

    def __init__(self, server: Any, session: Session, shapes: list[Shape] | None = None) -> None:
        self._scene, self._session = server.scene, session
        stage, count = session.stage, len(session.replays)
        arm, oriented = stage.scenario.arm, stage.scenario.task.has_orientation
        self._size = whole = size(arm)
        self._scene.set_up_direction("+z")
        floor, step = (count + 1) * 2 * whole, stride(len(stage.frames))
        self._scene.add_grid("/floor", width=floor, height=floor, cell_size=whole / 4)
        axes = {"show_axes": oriented, "axes_length": AXES * whole, "axes_radius": AXES_RADIUS * whole}
        self._arms, self._references, self._paths = [], [], []
        self._bodies: list[DrawnBodies] = []
        for i, replay in enumerate(session.replays):
            root, colour = f"/policy_{i}", _rgb(COLOURS[i % len(COLOURS)])
            self._scene.add_frame(root, show_axes=False, position=(0.0, -APART * whole * i, 0.0))
            self._scene.add_label(f"{root}/name", replay.policy, position=(0.0, 0.0, -BELOW * whole))
            self._arms.append(DrawnArm(server, f"{root}/arm", arm, colour, shapes))
            if session.has_bodies:
                self._bodies.append(DrawnBodies(server, self._arms[-1].names, stage, colour))
            self._references.append(self._scene.add_frame(f"{root}/reference", **axes))
            self._scene.add_icosphere(f"{root}/reference/ball", radius=BALL * whole, color=_rgb(GREEN))
            _, tool = arm.forward(thinned(replay.q, step))
            nominal = thinned(stage.frames[:, 9:], step)
            for name, points, hue, width in (
                ("nominal", nominal, _rgb(PALE_GREEN), 5.0),
                ("actual", tool, colour, 2.0),
            ):
                segments = np.stack([points[:-1], points[1:]], axis=1)
                path = self._scene.add_line_segments(f"{root}/{name}", segments, colors=hue, line_width=width)
                self._paths.append(path)
        self.target = self._scene.add_transform_controls(
            "/policy_0/target", scale=TARGET * whole, disable_rotations=not oriented
        )
        self._target_at: FloatArray | None = None
        self.show(session.shown())

    def look(self, camera: Any) -> None:
        """Turns the camera of a browser to the arms."""
        others = len(self._arms) - 1
        far = (FAR + FARTHER * others) * self._size
        # The panel covers the right: the camera looks at a point beside the middle of the arms.
        middle = -0.5 * APART * others * self._size + BESIDE * far * np.tan(0.5 * VIEW)
        camera.fov = VIEW
        camera.position = (0.9 * far, middle + 0.3 * far, (0.3 + LOOKED_AT) * far)
        camera.look_at = (0.0, middle, LOOKED_AT * self._size)

    def show_bodies(self, on: bool) -> None:
        """Shows bodies, obstacles and closest pairs, or none of them."""
        for bodies in self._bodies:
            bodies.switch(on=on)

    def show(self, shown: Sequence[Shown]) -> None:
        """Moves the arms and the reference."""
        mode, reference = self._session.mode, self._session.reference
        for arm, frame, one in zip(self._arms, self._references, shown, strict=True):
            arm.show(one.q, one.reading)
            _move(frame, reference)
        for bodies, one in zip(self._bodies, shown, strict=False):  # there may be none
            bodies.show(one.closest, self._session.obstacles)
        for path in self._paths:
            path.visible = mode is Mode.PLAY
        if mode is Mode.FOLLOW:
            self._target_at = None  # it is where it has been dragged
        elif self._target_at is None or not np.array_equal(self._target_at, reference):
            # Only where the reference has moved: otherwise a user may be dragging it.
            self._target_at = reference
            _move(self.target, reference)


def _move(handle: Any, frame: FloatArray) -> None:
    handle.position, handle.wxyz = frame[9:], quaternion(frame[:9].reshape(3, 3))


def _rgb(text: str) -> Colour:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue
