"""Arms from URDF files, read through Pinocchio."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.arms.arm import Arm
from ikgym.arms.source import UrdfReference
from ikgym.arms.urdf.bodies import with_bodies
from ikgym.arms.urdf.chain import MOVING, Tip, UrdfJoint, likely_tips, of_gripper, read_chain
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.files import read_user_file
from ikgym.validation import (
    FloatArray,
    about,
    different_texts,
    flag,
    frozen_array,
    known_name,
    known_names,
    rotation_matrix,
    shorten,
)

logger = logging.getLogger("ikgym")

# Descriptions of whole humanoids take a few hundred kilobytes.
MAX_BYTES = 16 * 2**20


class _Home(NamedTuple):
    """Joints and tool of the arm at q = 0, in the frame of the base link."""

    axes: FloatArray
    points: FloatArray
    rotation: FloatArray
    position: FloatArray


def from_urdf(
    path: str | PathLike[str],
    *,
    base: str | None = None,
    tip: str | None = None,
    name: str | None = None,
    tool: npt.ArrayLike | None = None,
    tool_rotation: npt.ArrayLike | None = None,
    meshes: bool = False,
    packages: str | PathLike[str] | Sequence[str | PathLike[str]] = (),
    bodyless: Sequence[str] = (),
) -> Arm:
    """An arm from the chain between two links of a URDF file.

    Revolute, continuous, prismatic and fixed joints are read, with their names and their limits of position and
    velocity; a continuous joint has none of position. A URDF has no limits of acceleration:
    ``arm.replace(acceleration_limit=…)`` adds them. Joints off the chain, a gripper's for example, have no coordinate
    in the arm.

    Collision geometry of the base and of all links below it becomes :attr:`Arm.bodies`, called after the links; links
    off the chain are fixed at the zero position of its joints. Spheres and capsules are exact. A cylinder becomes
    the capsule of its axis and radius, 4/3 π r³ larger; a box up to four capsules along its longest edge, or the sphere
    around it where that is smaller; a mesh the smallest capsule around its corners that a search finds. Pairs that
    touch in each of 100 random postures are ignored, and the log names them. A link of the chain, or one fixed to it,
    that has a shape but no body is :attr:`Bodies.unseen`, and so is one that moves with nothing that has a body.

    Axes are scaled to unit length; the log names those that are off by more than 1e-2, velocity limits above 50 rad/s,
    which may be in degrees, and continuous joints without one. Refused are limits of more than two turns, up to 1e4
    rad; unknown attributes, such as ``RPY``, and elements that are nearly known, such as ``<limits>``, between the two
    links; and files with a DOCTYPE, of more than 16 MiB, or with more than 128 joints between the two links.

    Args:
        path: The file.
        base: The link to begin at, whose frame becomes the base frame. The root link if it is left out.
        tip: The link to end at, whose frame becomes the tool's if there is no tool offset. If it is left out, the only
            leaf below the base that moves, or the only tool frame, but no finger; :func:`tips` lists them.
        name: Name of the arm, by default that of the robot in the file.
        tool: Tool point in the frame of the tip, in [m]; the frame's origin if it is left out. Shape (3,).
        tool_rotation: Orientation of the tool in the frame of the tip, a rotation matrix; that of the frame if it
            is left out. Shape (3, 3).
        meshes: Whether collision meshes are opened at once: STL, OBJ, PLY and DAE, by a path from the file or by the
            name of a package. A scenario with obstacles or collisions opens them in any case.
        packages: Folders in which packages of meshes are searched, or that are such packages, before the folders above
            the file.
        bodyless: Links without a body, since they may touch.

    Returns:
        The arm. Lengths in [m], angles in [rad], as in the file. Its :attr:`Arm.urdf` names the file.

    Raises:
        InvalidInputError: The file cannot be read, is no URDF, or has no such chain from base to tip; collision
            geometry has a wrong number; or the tool offset has a wrong shape or is no rotation.
        UnknownNameError: There is no link of that name; the message has the nearest one.
        MissingDependencyError: Pinocchio is not installed, or for meshes trimesh or SciPy.
    """
    flag("meshes", meshes)
    content = read_user_file(path, MAX_BYTES)
    with about(path):
        tree = Tree(content)
        begin, end, joints = read_chain(tree, base, tip)
        moving = [joint for joint in joints if joint.kind in MOVING]
        tool = None if tool is None else frozen_array("tool", tool, (3,))
        tool_rotation = None if tool_rotation is None else rotation_matrix("tool_rotation", tool_rotation)
        home = _with_tool(_home(joints), tool, tool_rotation)
        arm = Arm(
            tree.name if name is None else name,
            np.diff(home.points, axis=0, prepend=np.zeros((1, 3))),  # all link frames are parallel to the base at q = 0
            home.axes,
            [joint.kind == "prismatic" for joint in moving],
            tool=home.position - home.points[-1],
            tool_rotation=home.rotation,
            lower=np.array([joint.lower for joint in moving]),
            upper=np.array([joint.upper for joint in moving]),
            velocity_limit=np.array([joint.velocity for joint in moving]),
            joint_names=[joint.name for joint in moving],
        )
        file = Path(path).resolve()
        searched, bodyless = _folders(packages), tuple(different_texts("bodyless", bodyless))
        known_names("link", bodyless, tree.below(begin))
        folders = (file.parent, *searched) if meshes else None
        arm, shapes = with_bodies(arm, tree, begin, end, folders, bodyless)
        reference = UrdfReference(file, base, tip, tool, tool_rotation, meshes, searched, bodyless, shapes)
        object.__setattr__(arm, "urdf", reference)
        remarks = [remark for joint in joints for remark in joint.remarks]
        if of_gripper(moving[-1].name):
            remarks.append(f"the last joint of the arm, {moving[-1].name!r}, seems to belong to a gripper")
        for remark in remarks:
            logger.warning("%s: %s.", file.name, remark)
        return arm


def open_meshes(arm: Arm) -> Arm:
    """The arm with bodies from the meshes of its URDF file; the arm itself where no link would gain any.

    Raises:
        InvalidInputError: The file cannot be read any more, or a mesh is of no known kind.
        MissingDependencyError: trimesh or SciPy are not installed.
    """
    source = arm.urdf
    if source is None or source.meshes or not arm.bodies.unseen:
        return arm
    options = {name: getattr(source, name) for name in ("base", "tip", "tool", "tool_rotation", "packages", "bodyless")}
    read = from_urdf(source.file, meshes=True, **options)
    opened = arm.replace(bodies=read.bodies)
    object.__setattr__(opened, "urdf", read.urdf)
    return opened


def tips(path: str | PathLike[str], *, base: str | None = None) -> tuple[Tip, ...]:
    """The links of a URDF file that may be the tip: leaves and tool frames that move, likely ones first.

    Those whose chain :func:`from_urdf` reads come before all others; among them tool frames by their names, leaves or
    not, then links that no finger moves, then those with the most joints.

    Args:
        path: The file.
        base: The link to begin at, the root if it is left out.

    Raises:
        InvalidInputError: The file cannot be read, or is no URDF.
        UnknownNameError: There is no link of that name.
    """
    content = read_user_file(path, MAX_BYTES)
    with about(path):
        tree = Tree(content)
        if base is not None:
            known_name("link", base, tree.links)
        return tuple(likely_tips(tree, tree.root if base is None else base))


def _folders(packages: object) -> tuple[Path, ...]:
    """Folders of packages, as absolute paths."""
    given = [packages] if isinstance(packages, (str, PathLike)) else packages
    if not isinstance(given, (tuple, list)) or not all(isinstance(one, (str, PathLike)) for one in given):
        raise InvalidInputError(f"packages: expected a folder or a list of folders, got {shorten(packages)}.")
    folders = tuple(Path(one).resolve() for one in given)
    for folder in folders:
        if not folder.is_dir():
            raise InvalidInputError(f"packages: expected a folder, found none at {str(folder)!r}.")
    return folders


def _with_tool(tip: _Home, tool: FloatArray | None, tool_rotation: FloatArray | None) -> _Home:
    """The arm with a tool at its tip; without an offset bit for bit as it was."""
    if tool is not None:
        tip = tip._replace(position=tip.position + tip.rotation @ tool)
    return tip if tool_rotation is None else tip._replace(rotation=tip.rotation @ tool_rotation)


def _home(joints: Sequence[UrdfJoint]) -> _Home:
    try:
        import pinocchio
    except ImportError as error:
        raise MissingDependencyError('URDF files need Pinocchio: pip install "ikgym[urdf]"') from error
    try:
        model = pinocchio.buildModelFromXML(_bare_urdf(joints))
        data = model.createData()
        # Columns of the Jacobian hold the axes, linear rows first. A single column comes as a plain vector.
        jacobian = pinocchio.computeJointJacobians(model, data, pinocchio.neutral(model)).reshape(6, -1)
        pinocchio.updateFramePlacements(model, data)
        tip = data.oMf[model.getFrameId(f"link{len(joints)}")]
    except Exception as error:  # whatever Pinocchio raises, it is about this file
        raise InvalidInputError(f"expected a URDF that Pinocchio can read, got its error: {error}") from error
    prismatic = np.array([joint.kind == "prismatic" for joint in joints if joint.kind != "fixed"])
    return _Home(
        axes=np.where(prismatic, jacobian[:3], jacobian[3:]).T,
        points=np.array([placement.translation for placement in data.oMi][1:]),
        rotation=np.array(tip.rotation),
        position=np.array(tip.translation),
    )


def _bare_urdf(joints: Sequence[UrdfJoint]) -> str:
    """The chain and nothing else, written anew.

    Two parsers may see one file differently: Pinocchio gets the numbers that were checked, and nothing that
    was not, such as meshes, names and other branches.
    """
    links = [f'<link name="link{i}"/>' for i in range(len(joints) + 1)]
    chain = [
        f'<joint name="joint{i}" type="{joint.kind}"><parent link="link{i}"/><child link="link{i + 1}"/>'
        f'<origin xyz="{_text(joint.xyz)}" rpy="{_text(joint.rpy)}"/><axis xyz="{_text(joint.axis)}"/>'
        '<limit lower="0" upper="0" velocity="0" effort="0"/></joint>'
        for i, joint in enumerate(joints)
    ]
    return f'<robot name="chain">{"".join(links + chain)}</robot>'


def _text(numbers: Sequence[float]) -> str:
    return " ".join(map(repr, numbers))
