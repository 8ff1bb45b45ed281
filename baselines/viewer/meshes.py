"""The meshes of a URDF file as an arm in viser's scene."""

from __future__ import annotations

import functools
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import yourdfpy

from baselines.viewer.readings import Reading
from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.rotations import quaternion
from ikgym.validation import FloatArray

# How far the tool may be elsewhere, in [m] and as parts of a rotation, for a file to be of an arm.
TOLERANCE = 1e-3
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

    Args:
        server: Of viser.
        root: The name of the frame that it stands in.
        model: What :func:`read_urdf` gave.
        arm: The arm.
    """

    def __init__(self, server: Any, root: str, model: Any, arm: Arm) -> None:
        self._model, self._arm = model, arm
        self._to_base = np.asarray(np.linalg.inv(_base(model, arm)), dtype=np.float64)
        self._meshes = {
            node: server.scene.add_mesh_trimesh(f"{root}/{number}", model.scene.geometry[model.scene.graph[node][1]])
            for number, node in enumerate(model.scene.graph.nodes_geometry)
        }

    def show(self, q: FloatArray, reading: Reading) -> None:
        """See :class:`baselines.viewer.solids.Shape`; meshes keep the colours of their file."""
        del reading
        self._model.update_cfg(_configuration(self._model, self._arm.joint_names, q))
        for node, mesh in self._meshes.items():
            there = self._to_base @ self._model.get_transform(node)
            mesh.position = there[:3, 3]
            mesh.wxyz = quaternion(np.ascontiguousarray(there[:3, :3]))


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
