"""A joint of a URDF file, its numbers checked."""

from __future__ import annotations

import math
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ikgym.arms.urdf import xml
from ikgym.exceptions import InvalidInputError

MOVING = ("revolute", "continuous", "prismatic")
# Those that must have limits of their coordinate.
BOUNDED = ("revolute", "prismatic")
READABLE = (*MOVING, "fixed")
KINDS = (*READABLE, "floating", "planar")
# Files round their axes, to (0.71, 0.71, 0) at worst; a length further from 1 is a mistake.
AXIS_TOLERANCE = 1e-2


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
