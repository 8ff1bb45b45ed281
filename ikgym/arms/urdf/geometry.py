"""Collision geometry of a URDF file as capsules in the frame of its link; meshes only where a caller asks for them."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from ikgym.arms.urdf import xml
from ikgym.arms.urdf.covering import Capsule, along, around, around_box
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.files import read_user_file
from ikgym.validation import LARGEST, FloatArray

MESHES = (".stl", ".obj", ".ply", ".dae")
# Collision meshes take some hundred kilobytes.
MESH_BYTES = 64 * 2**20
# A package is a folder at most so far above the URDF file.
LEVELS = 8


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
    points, volume = _corners(where, xml.attribute(where, shape, "filename"), folder)
    scale = np.array(xml.numbers(where, shape, "scale", 3)) if "scale" in shape.attrib else np.ones(3)
    return Solid([around(points * scale)], volume * abs(float(np.prod(scale))))


def _corners(where: str, name: str, folder: Path) -> tuple[FloatArray, float]:
    """The outer corners of a mesh, of shape (p, 3), and the volume of their convex hull, in the unit of the mesh.

    Its name is a path from the folder of the URDF file, or ``package://…``, or ``file://…``.
    """
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependencyError('Meshes need trimesh: pip install "ikgym[urdf]"') from error
    path = _found(where, name, folder)
    if path.suffix.lower() not in MESHES:
        raise InvalidInputError(f"{where}: expected a mesh of kind {', '.join(MESHES)}, got {name!r}.")
    content = read_user_file(path, MESH_BYTES)
    if path.suffix.lower() == ".dae" and (not content.lstrip().startswith(b"<") or b"<!DOCTYPE" in content):
        raise InvalidInputError(f"{where}: expected XML without a DOCTYPE in {name!r}.")
    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=path.suffix[1:].lower(), process=False)
        hull = mesh.convex_hull
        points, volume = np.array(hull.vertices, dtype=float), float(hull.volume)
    except Exception as error:  # whatever trimesh raises, it is about this file
        raise InvalidInputError(f"{where}: expected a mesh in {name!r}, got the error: {error}") from error
    if not (np.abs(points) <= LARGEST).all():
        raise InvalidInputError(f"{where}: expected corners of at most {LARGEST:g} in {name!r}.")
    return points, volume


def _found(where: str, name: str, folder: Path) -> Path:
    for path in _candidates(name, folder):
        if path.is_file():
            return path
    raise InvalidInputError(
        f"{where}: expected the mesh {name!r} below {str(folder)!r} or beside it, found no such file."
    )


def _candidates(name: str, folder: Path) -> Iterator[Path]:
    scheme, _, rest = name.rpartition("://")
    if scheme != "package":
        yield folder / rest
        return
    for above in (folder, *folder.parents)[:LEVELS]:
        yield above / rest
        if above.name == rest.split("/")[0]:
            yield above.parent / rest


READERS = {"sphere": _sphere, "cylinder": _cylinder, "capsule": _capsule, "box": _box}
