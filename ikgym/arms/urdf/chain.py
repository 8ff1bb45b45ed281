"""The chain of a URDF file between two links, checked before Pinocchio reads it; links that may be its tip."""

from __future__ import annotations

import math
import re
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ikgym.arms.urdf import xml
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names

MOVING = ("revolute", "continuous", "prismatic")
# Those that must have limits of their coordinate.
BOUNDED = ("revolute", "prismatic")
READABLE = (*MOVING, "fixed")
# Files round their axes, to (0.71, 0.71, 0) at worst; a length further from 1 is a mistake.
AXIS_TOLERANCE = 1e-2

#: Words in names of frames that are meant as the tip: ``tool0``, ``r_gripper_tool_frame``, ``panda_hand_tcp``.
WORDS = ("tool", "tcp", "end_effector", "ee", "eef", "flange", "grasp", "grasping", "gripper", "hand")
_FRAME = re.compile(rf"(?:.*_)?({'|'.join(WORDS)})\d*(?:_frame|_link)*", re.IGNORECASE)


class UrdfJoint(NamedTuple):
    """A joint of the chain, its numbers checked.

    Attributes:
        name: Its name in the file.
        kind: One of ``READABLE``.
        xyz: Where the joint is in the frame of the joint before, in [m]. Three numbers.
        rpy: Roll, pitch and yaw of its frame in [rad]. Three numbers.
        axis: Direction of its axis in its frame, nearly of unit length. Three numbers.
        lower: Lower limit in [rad] or [m], -inf where there is none.
        upper: Upper limit in [rad] or [m], inf where there is none.
        velocity: Largest speed in [rad/s] or [m/s], inf where there is none.
    """

    name: str
    kind: str
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]
    axis: tuple[float, ...]
    lower: float
    upper: float
    velocity: float


class Tip(NamedTuple):
    """A link at the end of joints that move.

    Attributes:
        link: Its name.
        joints: Names of the moving joints from the base to it.
        kinds: Their kinds: ``revolute``, ``continuous``, ``prismatic``, or one that no arm has.
        fault: Why :func:`ikgym.arms.from_urdf` cannot read the chain; empty where it can.
    """

    link: str
    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    fault: str = ""


def read_chain(tree: Tree, base: str | None, tip: str | None) -> tuple[str, list[UrdfJoint]]:
    """The link at the beginning of a chain, and its joints.

    The links of the whole file must be a tree. Numbers are checked between the two links only: no other joint
    has a say in where the tip is. Without a base it begins at the root, and without a tip it ends at the only leaf that
    moves.
    """
    known_names("link", [link for link in (base, tip) if link is not None], tree.links)
    base = tree.root if base is None else base
    tip = only_tip(tree, base) if tip is None else tip
    path = tree.path(base, tip)
    joints = list(map(read_joint, path))
    if not any(joint.kind in MOVING for joint in joints):
        raise InvalidInputError(f"expected a joint that moves between links {base!r} and {tip!r}, got none.")
    return base, joints


def only_tip(tree: Tree, base: str) -> str:
    """The one leaf below the base that moves; the only leaf where none does."""
    leaves = tree.leaves(base)
    found = [tip.link for tip in likely_tips(tree, base)] if len(leaves) > 1 else leaves
    if not found:
        raise InvalidInputError(f"expected a joint that moves below link {base!r}, got none.")
    if len(found) > 1:
        raise InvalidInputError(f"expected a tip, since there are several: {xml.listing(found)}.")
    return found[0]


def likely_tips(tree: Tree, base: str) -> list[Tip]:
    """The leaves below a base that move: readable ones, tool frames, and long chains first."""
    found = [_tip(leaf, tree.path(base, leaf)) for leaf in tree.leaves(base)]
    return sorted((tip for tip in found if tip.joints), key=_order)


def _order(tip: Tip) -> tuple[bool, bool, int, int]:
    frame = _FRAME.fullmatch(tip.link)
    word = len(WORDS) if frame is None else WORDS.index(frame[1].lower())
    return bool(tip.fault), frame is None, -len(tip.joints), word


def _tip(link: str, path: list[Element]) -> Tip:
    moving = [joint for joint in path if joint.get("type") != "fixed"]
    names, kinds = (tuple(joint.get(key, "") for joint in moving) for key in ("name", "type"))
    return Tip(link, names, kinds, _fault(path))


def _fault(path: list[Element]) -> str:
    try:
        for joint in path:
            read_joint(joint)
    except InvalidInputError as error:
        return str(error)
    return ""


def read_joint(element: Element) -> UrdfJoint:
    """A joint on the way to the tip."""
    where, kind, name = xml.label(element), element.get("type", ""), element.get("name", "")
    if kind not in READABLE:
        raise InvalidInputError(
            f"{where}: expected one of {xml.listing(READABLE)} on the way to the tip, got {kind!r}."
        )
    if element.find("mimic") is not None:
        raise InvalidInputError(f"{where}: expected a joint that moves on its own, got one with <mimic>.")
    origin = xml.optional(where, element, "origin")
    xyz, rpy = (xml.numbers(where, origin, key, 3) for key in ("xyz", "rpy"))
    axis = _axis(where, element) if kind in MOVING else (1.0, 0.0, 0.0)
    return UrdfJoint(name, kind, xyz, rpy, axis, *_limits(where, element, kind))


def _axis(where: str, element: Element) -> tuple[float, ...]:
    given = xml.optional(where, element, "axis")
    axis = (1.0, 0.0, 0.0) if given is None else xml.numbers(where, given, "xyz", 3)
    if abs(math.hypot(*axis) - 1.0) > AXIS_TOLERANCE:
        raise InvalidInputError(f"{where}: expected an axis of unit length, got {axis}.")
    return axis


def _limits(where: str, element: Element, kind: str) -> tuple[float, float, float]:
    """Lower and upper limit, and largest speed."""
    lower, upper, velocity = -math.inf, math.inf, math.inf
    limit = xml.optional(where, element, "limit") if kind in MOVING else None
    if limit is None and kind in BOUNDED:
        raise InvalidInputError(f"{where}: expected a <limit>, got none; an endless joint is of type 'continuous'.")
    if limit is not None:
        xml.attribute(where, limit, "velocity")
        (velocity,) = xml.numbers(where, limit, "velocity", 1)
        if velocity <= 0.0:
            raise InvalidInputError(
                f"{where}: expected a velocity limit above 0, got {velocity:g}; write that of the data sheet."
            )
    if kind in BOUNDED:
        (lower,), (upper,) = (xml.numbers(where, limit, key, 1) for key in ("lower", "upper"))
        if lower >= upper:
            raise InvalidInputError(f"{where}: expected limits lower < upper, got {lower:g} and {upper:g}.")
    return lower, upper, velocity
