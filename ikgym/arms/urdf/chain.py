"""The chain of a URDF file between two links, checked before Pinocchio reads it; links that may be its tip."""

from __future__ import annotations

import logging
import math
import re
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ikgym.arms.urdf import xml
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError
from ikgym.validation import LARGEST, known_names

logger = logging.getLogger("ikgym")

MOVING = ("revolute", "continuous", "prismatic")
# Those that must have limits of their coordinate.
BOUNDED = ("revolute", "prismatic")
READABLE = (*MOVING, "fixed")
# Files round their axes, to (0.71, 0.71, 0) at worst; a length further from 1 is reported.
ROUNDING = 1e-2
# Limits of a revolute joint in [rad] beyond the first are taken for degrees, and beyond the second for no limits:
# public files have ±1e6 and ±1e16. Velocities in [rad/s] beyond the third are reported only: many public files have 100
# or 1000.
TWO_TURNS, ENDLESS, FAST = 4.0 * math.pi, 1e4, 50.0

#: Attributes of a limit: those of URDF, of its version 1.2, and others of public files.
LIMITS = (
    *("lower", "upper", "velocity", "effort"),
    *("acceleration", "deceleration", "jerk"),
    *("command_effort", "current", "gear_velocity", "k_velocity"),
)
#: Elements of a joint that place it or limit it. Others pass, unless their names are nearly these.
ELEMENTS = ("parent", "child", "origin", "axis", "limit", "mimic")

#: Words in names of frames that are meant as the tip: ``tool0``, ``r_gripper_tool_frame``, ``panda_hand_tcp``.
WORDS = ("tool", "tcp", "end_effector", "ee", "eef", "flange", "grasp", "grasping", "gripper", "hand")
_FRAME = re.compile(
    rf"(?:.*_)?(?:({'|'.join(WORDS)})\d*(?:_frame|_link)*|gripper(?:_[a-z0-9]+)?_base(?:_link)?)", re.IGNORECASE
)
#: Parts of names of joints that belong to a gripper.
_FINGER = re.compile("gripper|finger|thumb|index|little|pinky|jaw|knuckle|claw", re.IGNORECASE)


class UrdfJoint(NamedTuple):
    """A joint of the chain, its numbers checked.

    Attributes:
        name: Its name in the file.
        kind: One of ``READABLE``.
        xyz: Where the joint is in the frame of the joint before, in [m]. Three numbers.
        rpy: Roll, pitch and yaw of its frame in [rad]. Three numbers.
        axis: Direction of its axis in its frame, of unit length. Three numbers.
        lower: Lower limit in [rad] or [m], -inf where there is none.
        upper: Upper limit in [rad] or [m], inf where there is none.
        velocity: Largest speed in [rad/s] or [m/s], inf where there is none.
        remarks: What a user should know about these numbers.
    """

    name: str
    kind: str
    xyz: tuple[float, ...]
    rpy: tuple[float, ...]
    axis: tuple[float, ...]
    lower: float
    upper: float
    velocity: float
    remarks: tuple[str, ...] = ()


class Tip(NamedTuple):
    """A link at the end of joints that move.

    Attributes:
        link: Its name.
        joints: Names of the moving joints from the base to it.
        kinds: Their kinds: ``revolute``, ``continuous``, ``prismatic``, or one that no arm has.
        fault: Why :func:`ikgym.arms.from_urdf` cannot read the chain; empty where it can.
        leaf: Whether no link is below it.
    """

    link: str
    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    fault: str = ""
    leaf: bool = True

    @property
    def frame(self) -> bool:
        """Whether its name is that of a tool frame, such as ``tool0``, ``flange`` or ``panda_hand``."""
        return _FRAME.fullmatch(self.link) is not None

    @property
    def gripper(self) -> bool:
        """Whether the last joint has a name of a gripper's."""
        return of_gripper(self.joints[-1])


def of_gripper(joint: str) -> bool:
    """Whether a joint belongs to a gripper, by its name."""
    return _FINGER.search(joint) is not None


def read_chain(tree: Tree, base: str | None, tip: str | None) -> tuple[str, str, list[UrdfJoint]]:
    """The links at both ends of a chain, and its joints.

    The links of the whole file must be a tree. Numbers are checked between the two links only: no other joint
    has a say in where the tip is. Without a base it begins at the root, without a tip it ends at :func:`only_tip`.
    """
    known_names("link", [link for link in (base, tip) if link is not None], tree.links)
    base = tree.root if base is None else base
    tip = only_tip(tree, base) if tip is None else tip
    path = tree.path(base, tip)
    joints = list(map(read_joint, path))
    if not any(joint.kind in MOVING for joint in joints):
        raise InvalidInputError(f"expected a joint that moves between links {base!r} and {tip!r}, got none.")
    return base, tip, joints


def only_tip(tree: Tree, base: str) -> str:
    """The one leaf below the base that moves, else the one tool frame; never a link that a gripper moves.

    Tool frames on one chain, such as a hand and its ``tcp``, count as one.
    """
    found = likely_tips(tree, base)
    leaves = [tip for tip in found if tip.leaf]
    if not leaves:
        if len(tree.leaves(base)) == 1:
            return tree.leaves(base)[0]
        raise InvalidInputError(f"expected a joint that moves below link {base!r}, got none.")
    if len(leaves) == 1 and not leaves[0].gripper:
        return leaves[0].link
    frames = [tip for tip in found if tip.frame and not tip.fault and not tip.gripper]
    passed = [xml.find_required("", joint, "child").get("link") for joint in tree.path(base, (frames or found)[0].link)]
    if frames and all(tip.link in passed for tip in frames):
        logger.info("the arm ends at %r, the only tool frame", frames[0].link)
        return frames[0].link
    links = xml.listing([tip.link for tip in found])
    if len(leaves) == 1:
        name = leaves[0].joints[-1]
        [joint] = [joint for joint in tree.path(base, leaves[0].link) if joint.get("name") == name]
        before = xml.find_required("", joint, "parent").get("link")
        raise InvalidInputError(
            f"expected a tip, since joint {name!r} seems to belong to a gripper: "
            f"{before!r}, the link before it, or {links}."
        )
    raise InvalidInputError(f"expected a tip, since there are several: {links}.")


def likely_tips(tree: Tree, base: str) -> list[Tip]:
    """Leaves and tool frames below a base that move: readable ones, tool frames, no fingers, and long chains first."""
    leaves = tree.leaves(base)
    links = [link for link in tree.below(base) if link in leaves or _FRAME.fullmatch(link)]
    found = [_tip(link, tree.path(base, link), link in leaves) for link in links]
    return sorted((tip for tip in found if tip.joints), key=_order)


def _order(tip: Tip) -> tuple[bool, bool, bool, int, bool, int]:
    frame = _FRAME.fullmatch(tip.link)
    word = WORDS.index(frame[1].lower()) if frame and frame[1] else len(WORDS)
    return bool(tip.fault), not tip.frame, tip.gripper, -len(tip.joints), not tip.leaf, word


def _tip(link: str, path: list[Element], leaf: bool) -> Tip:
    moving = [joint for joint in path if joint.get("type") != "fixed"]
    names, kinds = (tuple(joint.get(key, "") for joint in moving) for key in ("name", "type"))
    return Tip(link, names, kinds, _fault(path), leaf)


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
        raise InvalidInputError(f"{where}: expected an independent joint, got one with <mimic>.")
    xml.known_elements(where, element, ELEMENTS)
    xyz, rpy = read_origin(where, element)
    axis, remarks = _axis(where, element) if kind in MOVING else ((1.0, 0.0, 0.0), [])
    limits = _limits(where, element, kind)
    return UrdfJoint(name, kind, xyz, rpy, axis, *limits, tuple(remarks + _doubts(where, kind, *limits)))


def read_origin(where: str, element: Element) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Position in [m], and roll, pitch and yaw in [rad], of the ``<origin>`` of an element; zeros without one.

    URDF 1.1 has ``quat_xyzw`` in place of ``rpy``.
    """
    origin = xml.find_optional(where, element, "origin")
    if origin is not None:
        xml.known_attributes(where, origin, ("xyz", "rpy", "quat_xyzw"))
    xyz, rpy = (xml.numbers(where, origin, key, 3) for key in ("xyz", "rpy"))
    if origin is None or "quat_xyzw" not in origin.attrib:
        return xyz, rpy
    if "rpy" in origin.attrib:
        raise InvalidInputError(f"{where}: expected rpy or quat_xyzw in <origin>, got both.")
    return xyz, _to_rpy(where, xml.numbers(where, origin, "quat_xyzw", 4))


def _to_rpy(where: str, quaternion: tuple[float, ...]) -> tuple[float, ...]:
    """Roll, pitch and yaw in [rad] of a unit quaternion (x, y, z, w)."""
    if abs(math.hypot(*quaternion) - 1.0) > ROUNDING:
        raise InvalidInputError(f"{where}: expected quat_xyzw of unit length, got {quaternion}.")
    x, y, z, w = quaternion
    # Twice the sums and differences of yaw and roll, which stay exact where the pitch is a quarter turn.
    both, apart = math.atan2(x + z, w - y), math.atan2(z - x, w + y)
    pitch = 2.0 * math.atan2(math.hypot(w + y, z - x), math.hypot(w - y, x + z)) - 0.5 * math.pi
    return both - apart, pitch, both + apart


def _axis(where: str, element: Element) -> tuple[tuple[float, ...], list[str]]:
    """The axis of a joint, of unit length, and a remark where it was not."""
    given = xml.find_optional(where, element, "axis")
    if given is None:
        return (1.0, 0.0, 0.0), []
    xml.known_attributes(where, given, ("xyz",))
    axis = xml.numbers(where, given, "xyz", 3)
    length = math.hypot(*axis)
    if not 1e-9 < length < LARGEST:
        raise InvalidInputError(f"{where}: expected an axis with a direction, got {axis}.")
    if abs(length - 1.0) <= ROUNDING:
        return axis, []  # rounded: Pinocchio and the arm scale it
    return tuple(x / length for x in axis), [f"{where}: its axis {axis} was scaled to unit length"]


def _doubts(where: str, kind: str, lower: float, upper: float, velocity: float) -> list[str]:
    """Remarks on limits that are unusual."""
    if kind == "continuous" and not math.isfinite(velocity):
        return [f"{where}: it is continuous and has no velocity limit, so no speed is too fast for it"]
    if kind == "prismatic" or not FAST < velocity < math.inf:
        return []
    return [f"{where}: degrees? Its velocity limit is {velocity:g} rad/s"]


def _limits(where: str, element: Element, kind: str) -> tuple[float, float, float]:
    """Lower and upper limit, and largest speed."""
    lower, upper, velocity = -math.inf, math.inf, math.inf
    limit = xml.find_optional(where, element, "limit") if kind in MOVING else None
    if limit is None and kind in BOUNDED:
        raise InvalidInputError(f"{where}: expected a <limit>, got none; an endless joint is of type 'continuous'.")
    if limit is not None:
        xml.known_attributes(where, limit, LIMITS)
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
        if kind == "revolute" and TWO_TURNS < max(-lower, upper) < ENDLESS:
            raise InvalidInputError(
                f"{where}: expected limits in radians within two turns, got {lower:g} and {upper:g}: degrees? A joint "
                "that turns without end is of type 'continuous'."
            )
    return lower, upper, velocity
