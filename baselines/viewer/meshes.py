"""The meshes of a URDF file as an arm in viser's scene."""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import yourdfpy

from baselines.viewer.bodies import TOOL, size
from baselines.viewer.readings import AT, FREE, Colour, Reading, share_colour
from baselines.viewer.solids import add_mesh, recolour
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.rotations import quaternion
from ikgym.validation import FloatArray

# How far the tool may be elsewhere, in [m] and as parts of a rotation, for a file to be of an arm: files that have 1.57
# for half of π are off by more than a millimetre.
TOLERANCE = 5e-3
# Postures at which that is looked at.
POSTURES = 5


def read_urdf(file: pathlib.Path, arm: Arm) -> Any:
    """The model in a file, if it is of an arm.

    Args:
        file: The URDF file; meshes are looked for where it says.
        arm: What it is to be of: the same joints by name, with the same motion between base and tool.

    Returns:
        A `yourdfpy.URDF` with its meshes.

    Raises:
        InvalidInputError: The file cannot be read, has no visible shapes, lacks joints, or moves in another way.
    """
    if not file.is_file():
        raise InvalidInputError(f"urdf: expected a file, got {str(file)!r}.")
    try:
        handler = functools.partial(yourdfpy.filename_handler_magic, dir=file.parent)
        model = yourdfpy.URDF.load(str(file), filename_handler=handler)
    except Exception as e:  # the parser and the readers of meshes raise what they like
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
            f"urdf: {file} moves otherwise than arm {arm.name!r}: its tool is off by up to {off:.3g}, in [m] or parts "
            "of a rotation."
        )
    return model


class Meshes:
    """An arm with the meshes of a URDF file, see :class:`baselines.viewer.solids.Shape`.

    Meshes keep the colours of their file; what a joint near a limit moves takes that of the limit.

    Args:
        server: Of viser.
        root: The name of the frame that it stands in.
        model: What :func:`read_urdf` gave.
        arm: The arm.
    """

    def __init__(self, server: Any, root: str, model: Any, arm: Arm) -> None:
        self._model, self._arm = model, arm
        self._to_base = np.asarray(np.linalg.inv(_base(model, arm)), dtype=np.float64)
        self._meshes = [
            _Mesh(server, f"{root}/{number}", model, node)
            for number, node in enumerate(model.scene.graph.nodes_geometry)
        ]
        self._joints = [_joint(model, arm.joint_names, mesh.node) for mesh in self._meshes]
        self._tool = server.scene.add_icosphere(f"{root}/tool", radius=TOOL * size(arm), color=FREE)

    def show(self, q: FloatArray, reading: Reading) -> None:
        """See :class:`baselines.viewer.solids.Shape`."""
        self._model.update_cfg(_configuration(self._model, self._arm.joint_names, q))
        for mesh, joint in zip(self._meshes, self._joints, strict=True):
            mesh.show(self._to_base @ self._model.get_transform(mesh.node), _colour(reading, joint))
        self._tool.position = self._arm.forward(q)[1]
        recolour(self._tool, share_colour(reading.share))


class _Mesh:
    """A mesh of a model, and the same in one colour, one of which is seen."""

    def __init__(self, server: Any, name: str, model: Any, node: str) -> None:
        self.node = node
        shape = model.scene.geometry[model.scene.graph[node][1]]
        self._own = server.scene.add_mesh_trimesh(f"{name}/own", shape)
        self._plain = add_mesh(server, f"{name}/plain", shape, AT, visible=False)

    def show(self, there: FloatArray, colour: Colour) -> None:
        """Moves it to where it is, of shape (4, 4)."""
        position, wxyz = there[:3, 3], quaternion(np.ascontiguousarray(there[:3, :3]))
        for mesh in (self._own, self._plain):
            mesh.position, mesh.wxyz = position, wxyz
        self._own.visible, self._plain.visible = colour == FREE, colour != FREE
        recolour(self._plain, colour)


def _joint(model: Any, names: Sequence[str], node: str) -> int | None:
    """The joint of the arm that moves a mesh, the last one on the way to it; None where there is none."""
    moved_by = {model.joint_map[name].child: number for number, name in enumerate(names)}
    parents, link = model.scene.graph.transforms.parents, node
    while link in parents:
        link = parents[link]
        if link in moved_by:
            return moved_by[link]
    return None


def _colour(reading: Reading, joint: int | None) -> Colour:
    return FREE if joint is None else reading.colours[joint]


def _configuration(model: Any, names: Sequence[str], q: FloatArray) -> FloatArray:
    """Coordinates of all joints of a model, 0 for those that are none of the arm's."""
    given: Mapping[str, float] = dict(zip(names, q.tolist(), strict=True))
    return np.array([given.get(name, 0.0) for name in model.actuated_joint_names])


def _base(model: Any, arm: Arm) -> FloatArray:
    """Where the arm's base is in the model. Shape (4, 4)."""
    link = arm.urdf.base if arm.urdf is not None else None
    found: FloatArray = np.eye(4) if link is None else model.get_transform(link)
    return found


def _difference(model: Any, arm: Arm) -> float:
    """By how much the way from the tool to the last link of the model differs between postures."""
    last = model.joint_map[arm.joint_names[-1]].child
    low, high = (np.nan_to_num(limit, posinf=np.pi, neginf=-np.pi) for limit in (arm.lower, arm.upper))
    ways = []
    for q in np.random.default_rng(0).uniform(low, high, (POSTURES, arm.joints)):
        model.update_cfg(_configuration(model, arm.joint_names, q))
        tool = np.eye(4)
        tool[:3, :3], tool[:3, 3] = arm.forward(q)
        ways.append(np.linalg.inv(np.linalg.inv(_base(model, arm)) @ model.get_transform(last)) @ tool)
    return float(np.ptp(ways, axis=0).max())
