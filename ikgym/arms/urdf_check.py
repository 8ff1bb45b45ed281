"""Checks of a URDF file before Pinocchio reads it: the XML, the tree of links, the numbers."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names

MOVING = ("revolute", "continuous", "prismatic")
# Those that must have limits of their coordinate.
BOUNDED = ("revolute", "prismatic")
READABLE = (*MOVING, "fixed")
KINDS = (*READABLE, "floating", "planar")
# Files round their axes, to (0.71, 0.71, 0) at worst; a length further from 1 is a mistake.
AXIS_TOLERANCE = 1e-2
# Parsers of URDF call themselves once a link: a chain of thousands overflows their stack, and that is the end
# of the whole process.
MAX_JOINTS = 128

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)


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


def read_chain(data: bytes, base: str | None, tip: str | None) -> tuple[str, list[UrdfJoint]]:
    """The name of the robot and the joints between two of its links.

    The links of the whole file must be a tree. Numbers are checked between the two links only: no other joint
    has a say in where the tip is.

    Args:
        data: Content of the file.
        base: Link to begin at, the root if it is None.
        tip: Link to end at, the only leaf below the base if it is None.

    Returns:
        The name, and the joints from base to tip.

    Raises:
        InvalidInputError: The file is no URDF, or has no chain of readable joints from base to tip.
        UnknownNameError: There is no such link.
    """
    robot = parse(data)
    if robot.tag != "robot":
        raise InvalidInputError(f"expected the root element <robot>, got <{robot.tag}>.")
    if any("xacro" in element.tag for element in robot):
        raise InvalidInputError("expected a URDF, got macros of xacro; expand them first: xacro FILE > arm.urdf")
    tree = _Tree(robot)
    known_names("link", [link for link in (base, tip) if link is not None], tree.links)
    base = tree.root if base is None else base
    tip = tree.only_leaf(base) if tip is None else tip
    path = tree.path(base, tip)
    if without := [_label(joint) for joint in path if joint.get("type") in BOUNDED and joint.find("limit") is None]:
        raise InvalidInputError(
            f"{', '.join(without)}: expected a <limit>, got none; an endless joint is of type 'continuous'."
        )
    joints = [_joint(element) for element in path]
    if not any(joint.kind in MOVING for joint in joints):
        raise InvalidInputError(f"expected a joint that moves between links {base!r} and {tip!r}, got none.")
    return _attribute("robot", robot, "name"), joints


def parse(data: bytes) -> Element:
    """The root of an XML document.

    Raises:
        InvalidInputError: It is no XML, or has a DOCTYPE.
    """
    guard = expat.ParserCreate()
    guard.StartDoctypeDeclHandler = _refuse_doctype
    try:
        # Entities are declared in a DOCTYPE only: past this line there are none that could be expanded.
        guard.Parse(data, True)
        return ElementTree.fromstring(data)
    except InvalidInputError:
        raise
    except (expat.ExpatError, ElementTree.ParseError, LookupError, ValueError) as error:
        raise InvalidInputError(f"expected XML, got {len(data)} bytes with a fault: {error}.") from error


def _refuse_doctype(*_: object) -> None:
    raise InvalidInputError("expected no DOCTYPE: a URDF needs none, and its entities could grow without bound.")


class _Tree:
    """The links of a robot, each but the root below one joint.

    Raises:
        InvalidInputError: A name is missing or taken, a joint does not join two links, or they are no tree.
    """

    def __init__(self, robot: Element) -> None:
        self.links = tuple(_named(robot, "link"))
        self._above: dict[str, tuple[Element, str]] = {}
        self._below: dict[str, list[str]] = {link: [] for link in self.links}
        for joint in _named(robot, "joint").values():
            where = _label(joint)
            _attribute(where, joint, "type", KINDS)
            parent, child = (
                _attribute(where, _required(where, joint, end), "link", self._below) for end in ("parent", "child")
            )
            if child in self._above:
                both = f"{_label(self._above[child][0])} and {where}"
                raise InvalidInputError(f"link {child!r}: expected one joint above it, got {both}.")
            self._above[child] = joint, parent
            self._below[parent].append(child)
        roots = [link for link in self.links if link not in self._above]
        if len(roots) > 1:
            raise InvalidInputError(f"expected one link without a joint above it, got {_listing(roots)}.")
        # Each link has one joint above it, so what the root does not reach goes round in a loop.
        looping = set(self.links).difference(*map(self._reached, roots))
        if looping:
            raise InvalidInputError(f"expected a tree of links, got a loop of {_listing(sorted(looping))}.")
        self.root = roots[0]

    def only_leaf(self, base: str) -> str:
        """The one link below the base that has no other below it."""
        leaves = [link for link in self._reached(base) if not self._below[link]]
        if len(leaves) > 1:
            raise InvalidInputError(f"expected a tip, since there are several: {_listing(sorted(leaves))}.")
        return leaves[0]

    def path(self, base: str, tip: str) -> list[Element]:
        """The joints from base to tip."""
        joints: list[Element] = []
        passed = [tip]
        while passed[-1] != base:
            if passed[-1] == self.root:
                raise InvalidInputError(
                    f"expected a base above tip {tip!r}, one of {_listing(passed[1:])}; got {base!r}."
                )
            joint, parent = self._above[passed[-1]]
            joints.append(joint)
            passed.append(parent)
        if len(joints) > MAX_JOINTS:
            raise InvalidInputError(
                f"expected at most {MAX_JOINTS} joints from {base!r} to {tip!r}, got {len(joints)}."
            )
        return joints[::-1]

    def _reached(self, base: str) -> list[str]:
        reached = [base]
        for link in reached:
            reached.extend(self._below[link])
        return reached


def _joint(element: Element) -> UrdfJoint:
    where, kind, name = _label(element), element.get("type", ""), element.get("name", "")
    if kind not in READABLE:
        raise InvalidInputError(f"{where}: expected one of {_listing(READABLE)} on the way to the tip, got {kind!r}.")
    if element.find("mimic") is not None:
        raise InvalidInputError(f"{where}: expected a joint that moves on its own, got one with <mimic>.")
    origin = _optional(where, element, "origin")
    xyz, rpy = (_numbers(where, origin, key, 3) for key in ("xyz", "rpy"))
    axis: tuple[float, ...] = (1.0, 0.0, 0.0)
    lower, upper, velocity = -math.inf, math.inf, math.inf
    if kind in MOVING:
        given = _optional(where, element, "axis")
        if given is not None:
            axis = _numbers(where, given, "xyz", 3)
        if abs(math.hypot(*axis) - 1.0) > AXIS_TOLERANCE:
            raise InvalidInputError(f"{where}: expected an axis of unit length, got {axis}.")
        limit = (_optional if kind == "continuous" else _required)(where, element, "limit")
        if limit is not None:
            _attribute(where, limit, "velocity")
            (velocity,) = _numbers(where, limit, "velocity", 1)
            if velocity <= 0.0:
                raise InvalidInputError(f"{where}: expected a velocity limit above 0, got {velocity:g}.")
        if kind != "continuous":
            (lower,), (upper,) = (_numbers(where, limit, key, 1) for key in ("lower", "upper"))
            if lower >= upper:
                raise InvalidInputError(f"{where}: expected limits lower < upper, got {lower:g} and {upper:g}.")
    return UrdfJoint(name, kind, xyz, rpy, axis, lower, upper, velocity)


def _named(robot: Element, tag: str) -> dict[str, Element]:
    named: dict[str, Element] = {}
    for element in robot.iterfind(tag):
        name = _attribute("robot", element, "name")
        if name in named:
            raise InvalidInputError(f"expected every {tag} to have a name of its own, got two called {name!r}.")
        named[name] = element
    if not named:
        raise InvalidInputError(f"expected at least one <{tag}> in <robot>, got none.")
    return named


def _label(joint: Element) -> str:
    return f"joint {joint.get('name')!r}"


def _required(where: str, element: Element, tag: str) -> Element:
    found = _optional(where, element, tag)
    if found is None:
        raise InvalidInputError(f"{where}: expected a <{tag}>, got none.")
    return found


def _optional(where: str, element: Element, tag: str) -> Element | None:
    found = element.findall(tag)
    if len(found) > 1:
        raise InvalidInputError(f"{where}: expected one <{tag}>, got {len(found)}.")
    return found[0] if found else None


def _attribute(where: str, element: Element, key: str, choices: Collection[str] | None = None) -> str:
    value = element.get(key)
    if not value:
        raise InvalidInputError(f'{where}: expected <{element.tag} {key}="…">, got none.')
    if choices is not None and value not in choices:
        raise InvalidInputError(
            f"{where}: expected {key} of <{element.tag}> to be one of {_listing(choices)}; got {value!r}."
        )
    return value


def _numbers(where: str, element: Element | None, key: str, count: int) -> tuple[float, ...]:
    """Finite numbers, zeros where there are none: the default that URDF has for most."""
    text = None if element is None else element.get(key)
    if text is None:
        return (0.0,) * count
    words = text.split()
    if len(words) != count or not all(map(_NUMBER.fullmatch, words)) or not all(map(math.isfinite, map(float, words))):
        many = "a finite number" if count == 1 else f"{count} finite numbers"
        raise InvalidInputError(f"{where}: expected {key} to be {many}, got {text!r}.")
    return tuple(map(float, words))


def _listing(names: Collection[str], most: int = 20) -> str:
    names = list(names)
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(map(repr, names[:most])) + more or "none"
