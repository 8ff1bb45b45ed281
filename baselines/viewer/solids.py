"""The arms in viser's scene: solids of simple shape, or the meshes of a URDF file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
import trimesh

from baselines.viewer.bodies import BASE, Body, bodies, joint_frames
from baselines.viewer.readings import FREE, Colour, Reading, share_colour
from ikgym.arms import Arm
from ikgym.validation import FloatArray


class Shape(Protocol):
    """What an arm looks like."""

    def show(self, q: FloatArray, reading: Reading) -> None:
        """Moves it to joint coordinates in [rad] or [m], of shape (n,), in the colours of a reading."""


class Solids:
    """An arm of cylinders, with joints in the colour of their limits and a tool in that of the manipulability.

    Args:
        server: Of viser.
        root: The name of the frame that it stands in.
        arm: The arm.
        colour: Of the links.
    """

    def __init__(self, server: Any, root: str, arm: Arm, colour: Colour) -> None:
        names = _frame_names(root, arm.joints)
        self._arm = arm
        self._frames = [server.scene.add_frame(name, show_axes=False) for name in names[1:]]
        self._joints: dict[int, Any] = {}
        for number, body in enumerate(bodies(arm)):
            name = f"{names[body.frame - BASE]}/{body.kind}_{number}"
            handle = add_mesh(server, name, _mesh(body), colour if body.kind == "link" else FREE)
            if body.joint is not None:
                self._joints[body.joint] = handle
            if body.kind == "tool":
                self._tool = handle

    def show(self, q: FloatArray, reading: Reading) -> None:
        """See :class:`Shape`."""
        for frame, position, wxyz in zip(self._frames, *joint_frames(self._arm, q), strict=True):
            frame.position, frame.wxyz = position, wxyz
        for joint, handle in self._joints.items():
            recolour(handle, reading.colours[joint])
        recolour(self._tool, share_colour(reading.share))


def add_mesh(server: Any, name: str, mesh: Any, colour: Colour, *, visible: bool = True) -> Any:
    """Adds a mesh of trimesh's in one colour, which can be changed.

    Returns:
        The handle of viser's.
    """
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32)
    return server.scene.add_mesh_simple(name, vertices=vertices, faces=faces, color=colour, visible=visible)


def segments(points: FloatArray) -> FloatArray:
    """A curve as viser takes it: points of shape (k, 3) as k - 1 segments of shape (k - 1, 2, 3)."""
    return np.stack([points[:-1], points[1:]], axis=1)


def _frame_names(root: str, joints: int) -> Sequence[str]:
    """Names of the base frame and of those of the joints, each within the one before."""
    out = [root]
    for joint in range(joints):
        out.append(f"{out[-1]}/joint_{joint}")
    return out


def _mesh(body: Body) -> Any:
    if body.kind == "tool":
        return trimesh.creation.icosphere(2, body.radius).apply_translation(body.start)
    return trimesh.creation.cylinder(body.radius, segment=[body.start, body.end], sections=24)


def recolour(handle: Any, colour: Colour) -> None:
    """Changes the colour of a handle of viser's, if it is another one: each change is a message to the browser."""
    if tuple(handle.color) != colour:
        handle.color = colour
