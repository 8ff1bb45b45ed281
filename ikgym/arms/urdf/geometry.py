"""Collision geometry of a URDF file as capsules in the frame of its link; meshes only where a caller asks for them."""

from __future__ import annotations

import io
import logging
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from ikgym.arms.urdf import xml
from ikgym.arms.urdf.covering import Capsule, along, around, around_box
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.files import read_user_file
from ikgym.validation import LARGEST, FloatArray

logger = logging.getLogger("ikgym")

MESHES = (".stl", ".obj", ".ply", ".dae")
# Collision meshes take some hundred kilobytes.
MESH_BYTES = 64 * 2**20
# A package is a folder at most so far above the URDF file.
LEVELS = 8


class Solid(NamedTuple):
    """A solid and the capsules around it.

    Attributes:
        capsules: In the frame of the shape.
        volume: Of the solid in [m³]; that of its convex hull for a mesh.
        source: ``mesh`` or ``shape``.
    """

    capsules: list[Capsule]
    volume: float
    source: str = "shape"


def read_solid(where: str, collision: Element, folders: Sequence[Path] | None) -> Solid | str | None:
    """The solid of a ``<collision>``; None for one without extent.

    Args:
        where: Name of the link in messages.
        collision: The element.
        folders: That of the URDF file, then those of packages; None where meshes stay closed.

    Returns:
        A mesh that is not opened is a text, the reason.
    """
    geometry = list(xml.find_required(where, collision, "geometry"))
    if len(geometry) != 1 or geometry[0].tag not in (*READERS, "mesh"):
        got = xml.listing([shape.tag for shape in geometry])
        raise InvalidInputError(f"{where}: expected one of {xml.listing([*READERS, 'mesh'])} in <geometry>, got {got}.")
    (shape,) = geometry
    if shape.tag != "mesh":
        return READERS[shape.tag](where, shape)
    if folders is None:
        return f"its mesh {shape.get('filename')!r} was not opened"
    try:
        return _mesh(where, shape, folders)
    except InvalidInputError as error:
        return str(error).removeprefix(f"{where}: ").removesuffix(".")


def _sizes(where: str, shape: Element, key: str, count: int = 1) -> tuple[float, ...] | None:
    """Sizes in [m]; None, and a line in the log, where one is 0: others read such a file, and nothing is there."""
    xml.attribute(where, shape, key)
    sizes = xml.numbers(where, shape, key, count)
    if min(sizes) < 0.0 or max(sizes) > LARGEST:
        raise InvalidInputError(
            f"{where}: expected {key} of <{shape.tag}> from 0 to {LARGEST:g} m, got {shape.get(key)!r}."
        )
    if min(sizes) > 0.0:
        return sizes
    logger.warning("%s: a <%s> with %s 0 is left out.", where, shape.tag, key)
    return None


def _sphere(where: str, shape: Element) -> Solid | None:
    size = _sizes(where, shape, "radius")
    return None if size is None else Solid([along(2, 0.0, size[0])], 4.0 / 3.0 * math.pi * size[0] ** 3)


def _cylinder(where: str, shape: Element) -> Solid | None:
    size, length = _sizes(where, shape, "radius"), _sizes(where, shape, "length")
    if size is None or length is None:
        return None
    return Solid([along(2, length[0], size[0])], math.pi * size[0] ** 2 * length[0])


def _capsule(where: str, shape: Element) -> Solid | None:
    solid = _cylinder(where, shape)
    return solid and solid._replace(volume=solid.capsules[0].volume)


def _box(where: str, shape: Element) -> Solid | None:
    size = _sizes(where, shape, "size", 3)
    return None if size is None else Solid(around_box(size), math.prod(size))


def _mesh(where: str, shape: Element, folders: Sequence[Path]) -> Solid:
    name = xml.attribute(where, shape, "filename")
    points, volume = _corners(where, name, folders)
    scale = np.array(xml.numbers(where, shape, "scale", 3)) if "scale" in shape.attrib else np.ones(3)
    points = points * scale
    if not (np.abs(points) <= LARGEST).all():
        raise InvalidInputError(f"{where}: expected corners of at most {LARGEST:g} m in {name!r}.")
    return Solid([around(points)], volume * abs(float(np.prod(scale))), "mesh")


def _corners(where: str, name: str, folders: Sequence[Path]) -> tuple[FloatArray, float]:
    """The outer corners of a mesh, of shape (p, 3), and the volume of their convex hull, in the unit of the mesh.

    Its name is a path from the folder of the URDF file, or ``package://…``, or ``file://…``.
    """
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependencyError('Meshes need trimesh: pip install "ikgym[urdf]"') from error
    path = _search(where, name, folders)
    if path.suffix.lower() not in MESHES:
        raise InvalidInputError(f"{where}: expected a mesh of kind {', '.join(MESHES)}, got {name!r}.")
    content = read_user_file(path, MESH_BYTES)
    if path.suffix.lower() == ".dae" and (not content.lstrip().startswith(b"<") or b"<!DOCTYPE" in content):
        raise InvalidInputError(f"{where}: expected XML without a DOCTYPE in {name!r}.")
    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=path.suffix[1:].lower(), process=False)
        if not (np.abs(mesh.vertices) <= LARGEST).all():
            raise InvalidInputError(f"expected corners of at most {LARGEST:g} m")
        hull = mesh.convex_hull
        points, volume = np.array(hull.vertices, dtype=float), float(hull.volume)
    except Exception as error:  # whatever trimesh raises, it is about this file
        raise InvalidInputError(f"{where}: its mesh {name!r} cannot be read: {error}") from error
    return points, volume


def _search(where: str, name: str, folders: Sequence[Path]) -> Path:
    """The first file that a mesh can be."""
    for path in _candidates(name, folders):
        if path.is_file():
            return path
    raise InvalidInputError(f"{where}: its mesh {name!r} was not found from {', '.join(map(str, folders))}.")


def _candidates(name: str, folders: Sequence[Path]) -> Iterator[Path]:
    scheme, _, rest = name.rpartition("://")
    if scheme != "package":
        yield folders[0] / rest
        return
    folder, *packages = folders
    for package in packages:
        yield package / rest
        if package.name == rest.split("/")[0]:
            yield package.parent / rest
    for above in (folder, *folder.parents)[:LEVELS]:
        yield above / rest
        if above.name == rest.split("/")[0]:
            yield above.parent / rest


READERS = {"sphere": _sphere, "cylinder": _cylinder, "capsule": _capsule, "box": _box}
