"""Arms in viser's scene: cylinders and spheres, or the meshes of a URDF file."""

from __future__ import annotations

import functools
import pathlib
from typing import Any, Protocol

import numpy as np
import trimesh
import yourdfpy

from baselines.viewer.readings import FREE, Colour, Reading, share_colour
from baselines.viewer.replay import size
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.rotations import quaternion
from ikgym.validation import FloatArray

# Radii and half a length, as shares of the arm's reach.
LINK, JOINT, JOINT_HALF, TOOL, RAIL = 0.016, 0.026, 0.034, 0.026, 0.009
# Largest difference in [m], or in entries of a rotation, between the tools of an arm and of its URDF file. Files that
# have 1.57 for half of π are off by more than a millimetre.
TOLERANCE = 5e-3


class DrawnArm(Protocol):
    """An arm in the scene."""

    def show(self, q: FloatArray, reading: Reading) -> None:
        """Moves it to joint coordinates in [rad] or [m], of shape (n,), in the colours of a reading."""


class Cylinders:
    """An arm of cylinders, with joints in the colour of their limits and a tool in that of the manipulability.

    Args:
        server: The server of viser.
        root: The name of the frame of its base.
        arm: The arm.
        colour: The colour of the links.
    """

    def __init__(self, server: Any, root: str, arm: Arm, colour: Colour) -> None:
        self._server, self._arm, whole = server, arm, size(arm)
        names = [root]
        for joint in range(arm.joints):
            names.append(f"{names[-1]}/joint_{joint}")
        self._frames = [server.scene.add_frame(name, show_axes=False) for name in names[1:]]
        self._joints = []
        for name, end in zip(names, [*arm.offsets, arm.tool], strict=True):
            if np.linalg.norm(end) > 1e-6 * whole:
                self._cylinder(f"{name}/link", np.zeros(3), end, LINK * whole, colour)
        for joint, axis in enumerate(arm.axes):
            half = JOINT_HALF * whole * axis
            self._joints.append(self._cylinder(f"{names[joint + 1]}/joint", -half, half, JOINT * whole, FREE))
            if arm.prismatic[joint]:
                first, last = np.clip((arm.lower[joint], arm.upper[joint]), -0.5 * whole, 0.5 * whole)
                begin, end = arm.offsets[joint] + first * axis, arm.offsets[joint] + last * axis
                self._cylinder(f"{names[joint]}/rail_{joint}", begin, end, RAIL * whole, FREE)
        self._tool = server.scene.add_icosphere(f"{names[-1]}/tool", radius=TOOL * whole, color=FREE, position=arm.tool)

    def show(self, q: FloatArray, reading: Reading) -> None:
        """See :class:`DrawnArm`."""
        for frame, position, wxyz in zip(self._frames, *joint_frames(self._arm, q), strict=True):
            frame.position, frame.wxyz = position, wxyz
        for handle, colour in zip(self._joints, reading.colours, strict=True):
            _recolour(handle, colour)
        _recolour(self._tool, share_colour(reading.share))

    def _cylinder(self, name: str, begin: FloatArray, end: FloatArray, radius: float, colour: Colour) -> Any:
        mesh = trimesh.creation.cylinder(radius, segment=[begin, end], sections=24)
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float32), np.asarray(mesh.faces, dtype=np.uint32)
        return self._server.scene.add_mesh_simple(name, vertices=vertices, faces=faces, color=colour)


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


class Meshes:
    """An arm with the meshes of a URDF file, and a ball at the tool in the colour of the manipulability.

    Args:
        server: The server of viser.
        root: The name of the frame of its base.
        model: A model of :func:`read_urdf`, which is moved.
        arm: The arm.
    """

    def __init__(self, server: Any, root: str, model: Any, arm: Arm) -> None:
        self._arm, self._model = arm, model
        self._to_base = np.asarray(np.linalg.inv(_base(model, arm)), dtype=np.float64)
        # Not `viser.extras.ViserUrdf`: its package ends the process where a library for videos is missing.
        self._meshes = {
            node: server.scene.add_mesh_trimesh(f"{root}/mesh_{k}", model.scene.geometry[model.scene.graph[node][1]])
            for k, node in enumerate(model.scene.graph.nodes_geometry)
        }
        self._tool = server.scene.add_icosphere(f"{root}/tool", radius=TOOL * size(arm), color=FREE)

    def show(self, q: FloatArray, reading: Reading) -> None:
        """See :class:`DrawnArm`."""
        self._model.update_cfg(_configuration(self._model, self._arm, q))
        for node, mesh in self._meshes.items():
            there = self._to_base @ self._model.get_transform(node)
            mesh.position, mesh.wxyz = there[:3, 3], quaternion(np.ascontiguousarray(there[:3, :3]))
        self._tool.position = self._arm.forward(q)[1]
        _recolour(self._tool, share_colour(reading.share))


def read_urdf(file: pathlib.Path, arm: Arm) -> Any:
    """The model in a URDF file, if it is of an arm.

    Args:
        file: The file; meshes are searched for where it says.
        arm: An arm with joints of the same names and the same motion between base and tool.

    Returns:
        A `yourdfpy.URDF` with its meshes.

    Raises:
        InvalidInputError: The file cannot be read, has no visible shapes, lacks joints, or moves differently.
    """
    if not file.is_file():
        raise InvalidInputError(f"urdf: expected a file, got {str(file)!r}.")
    try:
        handler = functools.partial(yourdfpy.filename_handler_magic, dir=file.parent)
        model = yourdfpy.URDF.load(str(file), filename_handler=handler)
    except Exception as e:  # the parser and the readers of meshes raise anything
        raise InvalidInputError(f"urdf: {file} cannot be read ({e}).") from e
    if not model.scene.geometry:
        raise InvalidInputError(f"urdf: {file} has no visible shapes that can be read.")
    if missing := [name for name in arm.joint_names if name not in model.actuated_joint_names]:
        raise InvalidInputError(
            f"urdf: {file} has no joint {missing[0]!r} of arm {arm.name!r}; it has "
            f"{', '.join(model.actuated_joint_names)}."
        )
    if (off := _difference(model, arm)) > TOLERANCE:
        raise InvalidInputError(
            f"urdf: {file} moves differently from arm {arm.name!r}: the pose of the tool differs by up to {off:.3g}, "
            "in [m] or entries of the rotation."
        )
    return model


def _configuration(model: Any, arm: Arm, q: FloatArray) -> FloatArray:
    """Coordinates of all joints of a model, 0 for joints that the arm lacks."""
    given = dict(zip(arm.joint_names, q.tolist(), strict=True))
    return np.array([given.get(name, 0.0) for name in model.actuated_joint_names])


def _base(model: Any, arm: Arm) -> FloatArray:
    """The pose of the arm's base in the model. Shape (4, 4)."""
    found: FloatArray = np.eye(4) if arm.urdf is None else model.get_transform(arm.urdf.base)
    return found


def _difference(model: Any, arm: Arm) -> float:
    """By how much the pose of the tool in the last link of the model differs between five postures."""
    last = model.joint_map[arm.joint_names[-1]].child
    low, high = (np.nan_to_num(limit, posinf=np.pi, neginf=-np.pi) for limit in (arm.lower, arm.upper))
    poses = []
    for q in np.random.default_rng(0).uniform(low, high, (5, arm.joints)):
        model.update_cfg(_configuration(model, arm, q))
        tool = np.eye(4)
        tool[:3, :3], tool[:3, 3] = arm.forward(q)
        poses.append(np.linalg.inv(np.linalg.inv(_base(model, arm)) @ model.get_transform(last)) @ tool)
    return float(np.ptp(poses, axis=0).max())


def _recolour(handle: Any, colour: Colour) -> None:
    """Changes the colour of a handle if it differs: each change is a message to the browser."""
    if tuple(handle.color) != colour:
        handle.color = colour
