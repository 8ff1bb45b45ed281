"""Arms side by side in viser's scene, with the reference, the paths and a target that can be dragged."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from baselines.evaluation.plots.style import COLOURS
from baselines.viewer.approach import Pose
from baselines.viewer.arms import Cylinders, DrawnArm
from baselines.viewer.readings import Colour
from baselines.viewer.replay import size
from baselines.viewer.session import Mode, Session, Shown
from ikgym.kernels.rotations import quaternion
from ikgym.rendering.style import GREEN, PALE_GREEN, stride, thinned
from ikgym.validation import FloatArray

#: Adds an arm to the scene, by the name of the frame of its base and its colour.
DrawArm = Callable[[str, Colour], DrawnArm]

# Distances and sizes, as shares of the arm's reach.
APART, TARGET, AXES, AXES_RADIUS, BALL, BELOW = 1.1, 0.16, 0.09, 0.004, 0.012, 0.08
# Distance of the camera from one arm, further distance for each other one, and height of the point it looks at.
FAR, FARTHER, LOOKED_AT = 1.4, 1.0, 0.3
# Vertical field of view of the camera in [rad], and the share of half of it by which the panel shifts the centre.
VIEW, BESIDE = 0.7, 0.4


class Scene:
    """The arms of a session.

    Args:
        server: The server of viser.
        session: The session.
        draw: Adds an arm; cylinders if left out.
    """

    def __init__(self, server: Any, session: Session, draw: DrawArm | None = None) -> None:
        self._server, self._session = server, session
        arm, whole = session.stage.scenario.arm, size(session.stage.scenario.arm)
        self._size = whole
        make = draw or (lambda root, colour: Cylinders(server, root, arm, colour))
        server.scene.set_up_direction("+z")
        count = len(session.replays)
        server.scene.add_grid(
            "/floor", width=(count + 1) * 2 * whole, height=(count + 1) * 2 * whole, cell_size=whole / 4
        )
        self._roots = [
            server.scene.add_frame(_root(i), show_axes=False, position=(0.0, -APART * whole * i, 0.0))
            for i in range(count)
        ]
        self._arms = [make(f"{_root(i)}/arm", colour(i)) for i in range(count)]
        self._references = [self._reference(i) for i in range(count)]
        self._paths = [self._path(i) for i in range(count)]
        self._seen: list[FloatArray | None] = [None] * count
        self.target = server.scene.add_transform_controls(
            f"{_root(0)}/target",
            scale=TARGET * whole,
            disable_rotations=not session.stage.scenario.task.has_orientation,
        )
        self._target_at: Pose | None = None
        self.show(session.shown())

    def look(self, camera: Any) -> None:
        """Turns the camera of a browser to the arms."""
        others = len(self._roots) - 1
        far = (FAR + FARTHER * others) * self._size
        # The panel covers the right: the camera looks at a point beside the middle of the arms.
        middle = -0.5 * APART * others * self._size + BESIDE * far * np.tan(0.5 * VIEW)
        camera.fov = VIEW
        camera.position = (0.9 * far, middle + 0.3 * far, (0.3 + LOOKED_AT) * far)
        camera.look_at = (0.0, middle, LOOKED_AT * self._size)

    def show(self, shown: Sequence[Shown]) -> None:
        """Moves the arms and the reference."""
        playing = self._session.mode is Mode.PLAY
        reference = self._session.reference
        for i, one in enumerate(shown):
            before = self._seen[i]
            if before is None or not np.array_equal(before, one.q):
                self._arms[i].show(one.q, one.reading)
                self._seen[i] = one.q.copy()
            _move(self._references[i], reference)
            for path in self._paths[i]:
                path.visible = playing
        self._show_target(reference)

    def _show_target(self, reference: Pose) -> None:
        """Moves the target with the reference if this has moved: otherwise a user may be dragging it."""
        if self._session.mode is Mode.FOLLOW:
            self._target_at = None  # it is where it has been dragged
        elif self._target_at is None or not all(map(np.array_equal, self._target_at, reference)):
            self._target_at = reference
            _move(self.target, reference)

    def _reference(self, i: int) -> Any:
        """The axes of the reference, around a ball."""
        oriented = self._session.stage.scenario.task.has_orientation
        name, whole = f"{_root(i)}/reference", self._size
        frame = self._server.scene.add_frame(
            name, show_axes=oriented, axes_length=AXES * whole, axes_radius=AXES_RADIUS * whole
        )
        self._server.scene.add_icosphere(f"{name}/ball", radius=BALL * whole, color=_rgb(GREEN))
        return frame

    def _path(self, i: int) -> list[Any]:
        """The path of the reference, that of the tool in the episode, and the policy's name."""
        stage, replay = self._session.stage, self._session.replays[i]
        step = stride(len(stage.path))
        _, tool = stage.scenario.arm.forward(thinned(replay.q, step))
        add, root = self._server.scene.add_line_segments, _root(i)
        self._server.scene.add_label(f"{root}/name", replay.policy, position=(0.0, 0.0, -BELOW * self._size))
        return [
            add(f"{root}/nominal", _segments(thinned(stage.path, step)), colors=_rgb(PALE_GREEN), line_width=5.0),
            add(f"{root}/actual", _segments(tool), colors=colour(i), line_width=2.0),
        ]


def colour(number: int) -> Colour:
    """The colour of a policy, as plots have it."""
    return _rgb(COLOURS[number % len(COLOURS)])


def _segments(points: FloatArray) -> FloatArray:
    """A curve as viser takes it: points of shape (k, 3) as segments of shape (k - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def _move(handle: Any, pose: Pose) -> None:
    handle.position, handle.wxyz = pose.position, quaternion(np.ascontiguousarray(pose.rotation))


def _root(i: int) -> str:
    return f"/policy_{i}"


def _rgb(text: str) -> Colour:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue
