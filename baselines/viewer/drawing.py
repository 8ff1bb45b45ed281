"""Arms side by side in viser's scene: links, bodies, obstacles, paths, the reference and a target that can be dragged.

Lengths are shares of the arm's reach.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import trimesh

from baselines.evaluation.plots.style import COLOURS
from baselines.viewer.meshes import Shape
from baselines.viewer.readings import FREE, Colour, Reading
from baselines.viewer.replay import size
from baselines.viewer.session import Mode, PolicyView, Session
from ikgym.arms import Arm
from ikgym.kernels.rotations import quaternion
from ikgym.obstacles.solids import cut_half_spaces, on_links, surface
from ikgym.rendering.scene import GREEN, PALE_GREEN, Scene, stride, thin
from ikgym.validation import FloatArray

# Radii and half a length of cylinders, and half the edge of the plate that a half-space is drawn as.
LINK, JOINT, JOINT_HALF, TOOL, RAIL, PLATE = 0.016, 0.026, 0.034, 0.026, 0.009, 0.54
# Distances and sizes of the rest.
APART, TARGET, AXES, AXES_RADIUS, BALL, BELOW = 1.1, 0.16, 0.09, 0.004, 0.012, 0.08
# Distance of the camera from one arm, further distance for each other one, and height of the point it looks at.
FAR, FARTHER, LOOKED_AT = 1.4, 1.0, 0.3
# Vertical field of view of the camera in [rad], and the share of half of it by which the panel shifts the centre.
VIEW, ASIDE = 0.7, 0.4
#: Colours (red, green, blue) of obstacles and of the line between the closest pair, and opacities.
OBSTACLE, LINE = (168, 140, 110), (34, 34, 34)
OF_BODIES, OF_OBSTACLES = 0.35, 0.6


class DrawnArm:
    """An arm in the scene: joints in the colour of their limits, a ball at the tool in that of the manipulability."""

    def __init__(self, server: Any, root: str, arm: Arm, colour: Colour, shapes: list[Shape] | None = None) -> None:
        self._scene, self._arm = server.scene, arm
        #: Names of the frames, that of the base first.
        self.names = [root]
        for joint in range(arm.joints):
            self.names.append(f"{self.names[-1]}/joint_{joint}")
        self._frames = [self._scene.add_frame(name, show_axes=False) for name in self.names[1:]]
        self._joints = self._cylinders(colour) if shapes is None else []
        for number, shape in enumerate(shapes or ()):
            name = f"{self.names[shape.frame]}/mesh_{number}"
            self._scene.add_mesh_simple(name, shape.mesh.vertices, shape.mesh.faces, color=colour)
        ball = f"{self.names[-1]}/tool"
        self._tool = self._scene.add_icosphere(ball, radius=TOOL * size(arm), color=FREE, position=arm.tool)

    def show(self, q: FloatArray, reading: Reading) -> None:
        """Moves it to joint coordinates in [rad] or [m], of shape (n,), in the colours of a reading."""
        for frame, position, wxyz in zip(self._frames, *joint_frames(self._arm, q), strict=True):
            frame.position, frame.wxyz = position, wxyz
        for handle, colour in zip(self._joints, reading.joints, strict=False):  # meshes have the colour of their policy
            handle.color = colour
        self._tool.color = reading.tool

    def _cylinders(self, colour: Colour) -> list[Any]:
        """Adds links, joints and rails; returns the joints."""
        arm, whole, joints = self._arm, size(self._arm), []
        for frame, end in enumerate([*arm.offsets, arm.tool]):
            if np.linalg.norm(end) > 1e-6 * whole:
                self._cylinder(frame, "link", (np.zeros(3), end), LINK * whole, colour)
        for joint, (offset, axis) in enumerate(zip(arm.offsets, arm.axes, strict=True)):
            half = JOINT_HALF * whole * axis
            joints.append(self._cylinder(joint + 1, "joint", (-half, half), JOINT * whole, FREE))
            if arm.prismatic[joint]:
                first, last = np.clip((arm.lower[joint], arm.upper[joint]), -0.5 * whole, 0.5 * whole)
                self._cylinder(joint, "rail", (offset + first * axis, offset + last * axis), RAIL * whole, FREE)
        return joints

    def _cylinder(
        self, frame: int, name: str, ends: tuple[FloatArray, FloatArray], radius: float, colour: Colour
    ) -> Any:
        mesh = trimesh.creation.cylinder(radius, segment=ends, sections=24)
        return self._scene.add_mesh_simple(f"{self.names[frame]}/{name}", mesh.vertices, mesh.faces, color=colour)


def joint_frames(arm: Arm, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The frame of each joint, seen from that of the joint before: ``H_i`` of :class:`ikgym.arms.Arm`.

    Args:
        arm: The arm.
        q: Joint coordinates in [rad] or [m]. Shape (n,).

    Returns:
        Positions in [m], of shape (n, 3), and unit quaternions (w, x, y, z), of shape (n, 4).
    """
    prismatic = np.array(arm.prismatic)
    travel, half = np.where(prismatic, q, 0.0), np.where(prismatic, 0.0, 0.5 * q)
    positions = arm.offsets + travel[:, None] * arm.axes
    return positions, np.hstack([np.cos(half)[:, None], np.sin(half)[:, None] * arm.axes])


class DrawnBodies:
    """The bodies of one arm, which move with the frames of its links, the obstacles around it, and the closest pair."""

    def __init__(self, server: Any, links: Sequence[str], start: Scene, colour: Colour) -> None:
        self._scene, arm, root = server.scene, start.scenario.arm, links[0]
        self._edge, self._boxes = PLATE * size(arm), np.full_like(start.obstacles, np.nan)
        self._bodies = [
            self._solid(f"{links[link]}/body_{number}", solid, colour, OF_BODIES)
            for number, (link, solid) in enumerate(zip(arm.bodies.links, on_links(arm.bodies), strict=True))
        ]
        self._obstacles = [
            self._solid(f"{root}/obstacle_{number}", solid, OBSTACLE, OF_OBSTACLES)
            for number, solid in enumerate(cut_half_spaces(start.obstacles, self._edge))
        ]
        self._line = self._scene.add_line_segments(f"{root}/closest", np.zeros((1, 2, 3)), colors=LINE, line_width=2.0)
        self._distance = self._scene.add_label(f"{root}/distance", "")
        self.switch(on=start.scenario.collides)

    def switch(self, *, on: bool) -> None:
        """Shows all of them, or none."""
        self._on = on
        for handle in (*self._bodies, *self._obstacles, self._line, self._distance):
            handle.visible = on

    def show(self, scene: Scene) -> None:
        """Moves the obstacles and the line between the closest pair; the bodies move with the arm."""
        boxes, distance = cut_half_spaces(scene.obstacles, self._edge), float(scene.closest.distances[0])
        for number in np.flatnonzero((boxes != self._boxes).any(axis=1)).tolist():
            _move(self._obstacles[number], boxes[number])
        self._boxes = boxes
        self._line.visible = self._distance.visible = self._on and np.isfinite(distance)
        if np.isfinite(distance):
            points = scene.closest.points
            self._line.points = points.astype(np.float32)
            self._distance.text, self._distance.position = f"{1e3 * distance:.1f} mm", points[0].mean(axis=0)

    def _solid(self, name: str, solid: FloatArray, colour: Colour, opacity: float) -> Any:
        vertices, faces = surface(solid[12:])
        look: dict[str, Any] = {"color": colour, "opacity": opacity, "flat_shading": bool(solid[15] == 0.0)}
        handle = self._scene.add_mesh_simple(name, vertices, faces, side="double", **look)
        _move(handle, solid)
        return handle


class Drawing:
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
                start = stage.scene(stage.start, 0)
                self._bodies.append(DrawnBodies(server, self._arms[-1].names, start, colour))
            self._references.append(self._scene.add_frame(f"{root}/reference", **axes))
            self._scene.add_icosphere(f"{root}/reference/ball", radius=BALL * whole, color=_rgb(GREEN))
            _, tool = arm.forward(thin(replay.q, step))
            nominal = thin(stage.frames[:, 9:], step)
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
        self.show(session.views())

    def look(self, camera: Any) -> None:
        """Turns the camera of a browser to the arms."""
        others = len(self._arms) - 1
        far = (FAR + FARTHER * others) * self._size
        # The panel covers the right: the camera looks at a point next to the middle of the arms.
        middle = -0.5 * APART * others * self._size + ASIDE * far * np.tan(0.5 * VIEW)
        camera.fov = VIEW
        camera.position = (0.9 * far, middle + 0.3 * far, (0.3 + LOOKED_AT) * far)
        camera.look_at = (0.0, middle, LOOKED_AT * self._size)

    def show_bodies(self, on: bool) -> None:
        """Shows bodies, obstacles and closest pairs, or none of them."""
        for bodies in self._bodies:
            bodies.switch(on=on)

    def show(self, views: Sequence[PolicyView]) -> None:
        """Moves the arms and the reference."""
        mode, reference = self._session.mode, self._session.reference
        for arm, frame, view in zip(self._arms, self._references, views, strict=True):
            arm.show(view.scene.q, view.reading)
            _move(frame, view.scene.target)
        for bodies, view in zip(self._bodies, views, strict=False):  # there may be none
            bodies.show(view.scene)
        for path in self._paths:
            path.visible = mode is Mode.PLAY
        if mode is Mode.FOLLOW:
            self._target_at = None  # it is where it has been dragged
        elif self._target_at is None or not np.array_equal(self._target_at, reference):
            # Only where the reference has moved: otherwise a user may be dragging it.
            self._target_at = reference
            _move(self.target, reference)


def _move(handle: Any, frame: FloatArray) -> None:
    """Moves a handle to a rotation and a position, the first numbers of a frame or of a solid."""
    handle.position, handle.wxyz = frame[9:12], quaternion(frame[:9].reshape(3, 3))


def _rgb(text: str) -> Colour:
    red, green, blue = bytes.fromhex(text.removeprefix("#"))
    return red, green, blue
