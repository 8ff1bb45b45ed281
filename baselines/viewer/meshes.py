"""The meshes of a URDF file, read within bounds, on the frames of an arm."""

from __future__ import annotations

import functools
import io
import pathlib
from typing import Any, NamedTuple

import numpy as np
import trimesh
import yourdfpy

from ikgym.arms import Arm
from ikgym.arms.urdf import MAX_BYTES
from ikgym.arms.urdf.xml import parse
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_file
from ikgym.validation import FloatArray

# Largest difference in [m], or in entries of a rotation, between the tools of an arm and of its URDF file. Files that
# have 1.57 for half of π are off by more than a millimetre.
TOLERANCE = 5e-3
#: Formats of meshes. Archives, and glTF, can describe more vertices than any memory holds.
FORMATS = ("dae", "obj", "ply", "stl")
#: Most bytes of all meshes of an arm together, and most links and shapes of its URDF file.
MOST_BYTES, MOST_PARTS = 2**27, 2000


class Shape(NamedTuple):
    """A mesh that moves with a frame of an arm."""

    frame: int  # number of the frame: 0 for the base, then one for each joint
    mesh: Any  # a `trimesh.Trimesh`, in that frame


class _Model(yourdfpy.URDF):  # type: ignore[misc]  # yourdfpy has no types
    """A model whose meshes are read within bounds."""

    def __init__(self, robot: Any, folder: pathlib.Path) -> None:
        self._left = MOST_BYTES
        super().__init__(robot, filename_handler=functools.partial(yourdfpy.filename_handler_magic, dir=folder))

    def _geometry2trimeshscene(self, geometry: Any, load_file: bool, force_mesh: bool, skip_materials: bool) -> Any:
        """The method of yourdfpy that opens meshes."""
        if geometry.mesh is None:
            return super()._geometry2trimeshscene(geometry, load_file, force_mesh, skip_materials)
        file = pathlib.Path(self._filename_handler(fname=geometry.mesh.filename))
        if not file.is_file():
            return None
        if (kind := file.suffix[1:].lower()) not in FORMATS:
            raise InvalidInputError(f"{file}: expected a mesh of the formats {', '.join(FORMATS)}, got {kind!r}")
        content = read_user_file(file, self._left)
        self._left -= len(content)
        # A node that is made of instances of others can make a billion of a kilobyte.
        if kind == "dae" and any(element.tag.endswith("instance_node") for element in parse(content).iter()):
            raise InvalidInputError(f"{file}: expected a COLLADA file without <instance_node>")
        scene = trimesh.load(io.BytesIO(content), kind, force="scene", skip_materials=True)
        for one in scene.geometry.values():
            if not isinstance(one, trimesh.Trimesh) or one.vertices.shape[1:] != (3,):
                raise InvalidInputError(f"{file}: expected triangles in space, got a {type(one).__name__}")
        return scene if geometry.mesh.scale is None else scene.scaled(geometry.mesh.scale)


def read_urdf(file: pathlib.Path, arm: Arm) -> list[Shape]:
    """The meshes in a URDF file, if it describes the arm.

    Args:
        file: The file; meshes are searched for where it says.
        arm: An arm with joints of the same names and the same motion between base and tool.

    Raises:
        InvalidInputError: The file or a mesh cannot be read, or is too large; it has no visible shapes, lacks joints,
            or moves differently.
    """
    content = read_user_file(file, MAX_BYTES)
    try:
        parts = sum(element.tag in ("link", "visual") for element in parse(content).iter())
        if parts > MOST_PARTS:
            raise InvalidInputError(f"expected at most {MOST_PARTS} links and shapes, got {parts}")
        robot = yourdfpy.URDF.load(io.BytesIO(content), build_scene_graph=False, load_meshes=False).robot
        model = _Model(robot, file.parent)
    except Exception as e:  # the parser and the readers of meshes raise anything
        raise InvalidInputError(f"urdf: {file} cannot be read ({e}).") from e
    if not model.scene.geometry:
        raise InvalidInputError(f"urdf: {file} has no visible shapes that can be read.")
    if missing := [name for name in arm.joint_names if name not in model.actuated_joint_names]:
        known = ", ".join(model.actuated_joint_names)
        raise InvalidInputError(f"urdf: {file} has no joint {missing[0]!r} of arm {arm.name!r}; it has {known}.")
    if (off := _difference(model, arm)) > TOLERANCE:
        raise InvalidInputError(
            f"urdf: {file} moves differently from arm {arm.name!r}: the pose of the tool differs by up to {off:.3g}, "
            "in [m] or entries of the rotation."
        )
    # At zero the frames of the arm's joints are parallel to its base.
    _move(model, arm, np.zeros(arm.joints))
    origins = np.vstack([np.zeros(3), np.cumsum(arm.offsets, axis=0)])
    above = {joint.child: joint for joint in model.joint_map.values()}
    shapes = []
    for node in model.scene.graph.nodes_geometry:
        place, geometry = model.scene.graph[node]
        place, link = _to_base(model, arm) @ place, model.scene.graph.transforms.parents[node]
        while link in above and above[link].name not in arm.joint_names:
            link = above[link].parent
        frame = arm.joint_names.index(above[link].name) + 1 if link in above else 0
        place[:3, 3] -= origins[frame]
        shapes.append(Shape(frame, model.scene.geometry[geometry].copy().apply_transform(place)))
    return shapes


def _move(model: Any, arm: Arm, q: FloatArray) -> None:
    """Moves a model to joint coordinates of the arm; joints that the arm lacks are at 0."""
    given = dict(zip(arm.joint_names, q.tolist(), strict=True))
    model.update_cfg(np.array([given.get(name, 0.0) for name in model.actuated_joint_names]))


def _to_base(model: Any, arm: Arm) -> FloatArray:
    """The transformation from the model's root to the arm's base. Shape (4, 4)."""
    out: FloatArray = np.eye(4) if arm.urdf is None else np.linalg.inv(model.get_transform(arm.urdf.base))
    return out


def _difference(model: Any, arm: Arm) -> float:
    """By how much the pose of the tool in the last link of the model differs between five postures."""
    last = model.joint_map[arm.joint_names[-1]].child
    low, high = (np.nan_to_num(limit, posinf=np.pi, neginf=-np.pi) for limit in (arm.lower, arm.upper))
    poses = []
    for q in np.random.default_rng(0).uniform(low, high, (5, arm.joints)):
        _move(model, arm, q)
        tool = np.eye(4)
        tool[:3, :3], tool[:3, 3] = arm.forward(q)
        poses.append(np.linalg.inv(_to_base(model, arm) @ model.get_transform(last)) @ tool)
    return float(np.ptp(poses, axis=0).max())
