"""Collision geometry of a URDF file as capsules in the frame of its link."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from ikgym.arms.urdf import meshes, xml
from ikgym.arms.urdf.covering import Capsule, along, around, around_box
from ikgym.exceptions import InvalidInputError


class Solid(NamedTuple):
    """A solid and the capsules around it.

    Attributes:
        capsules: In its own frame.
        volume: Of the solid in [m³]; that of its convex hull for a mesh.
    """

    capsules: list[Capsule]
    volume: float


def read_solid(where: str, collision: Element, folder: Path | None) -> Solid | None:
    """The solid of a ``<collision>``; None for a mesh where no folder says that meshes are opened."""
    geometry = list(xml.required(where, collision, "geometry"))
    if len(geometry) != 1 or geometry[0].tag not in (*READERS, "mesh"):
        got = xml.listing([shape.tag for shape in geometry])
        raise InvalidInputError(f"{where}: expected one of {xml.listing([*READERS, 'mesh'])} in <geometry>, got {got}.")
    (shape,) = geometry
    if shape.tag == "mesh":
        return None if folder is None else _mesh(where, shape, folder)
    return READERS[shape.tag](where, shape)


def _sizes(where: str, shape: Element, key: str, count: int = 1) -> tuple[float, ...]:
    xml.attribute(where, shape, key)
    sizes = xml.numbers(where, shape, key, count)
    if min(sizes) <= 0.0:
        raise InvalidInputError(f"{where}: expected {key} of <{shape.tag}> above 0, got {shape.get(key)!r}.")
    return sizes


def _sphere(where: str, shape: Element) -> Solid:
    (radius,) = _sizes(where, shape, "radius")
    return Solid([along(2, 0.0, radius)], 4.0 / 3.0 * math.pi * radius**3)


def _cylinder(where: str, shape: Element) -> Solid:
    (radius,), (length,) = _sizes(where, shape, "radius"), _sizes(where, shape, "length")
    return Solid([along(2, length, radius)], math.pi * radius**2 * length)


def _capsule(where: str, shape: Element) -> Solid:
    (radius,), (length,) = _sizes(where, shape, "radius"), _sizes(where, shape, "length")
    capsule = along(2, length, radius)
    return Solid([capsule], capsule.volume)


def _box(where: str, shape: Element) -> Solid:
    size = _sizes(where, shape, "size", 3)
    return Solid(around_box(size), math.prod(size))


def _mesh(where: str, shape: Element, folder: Path) -> Solid:
    points, volume = meshes.corners(where, xml.attribute(where, shape, "filename"), folder)
    scale = np.array(xml.numbers(where, shape, "scale", 3)) if "scale" in shape.attrib else np.ones(3)
    return Solid([around(points * scale)], volume * abs(float(np.prod(scale))))


READERS = {"sphere": _sphere, "cylinder": _cylinder, "capsule": _capsule, "box": _box}
