"""Meshes of URDF files, opened only where a caller asks for it."""

from __future__ import annotations

import io
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.files import read_user_file
from ikgym.validation import LARGEST, FloatArray

KINDS = (".stl", ".obj", ".ply", ".dae")
# Collision meshes take some hundred kilobytes.
MAX_BYTES = 64 * 2**20
# A package is a folder at most so far above the URDF file.
LEVELS = 8


def corners(where: str, name: str, folder: Path) -> tuple[FloatArray, float]:
    """The corners of a mesh, of shape (p, 3), and the volume of their convex hull, in the unit of the mesh.

    Its name is a path from the folder of the URDF file, or ``package://…``, or ``file://…``.
    """
    try:
        import trimesh
    except ImportError as error:
        raise MissingDependencyError('Meshes need trimesh: pip install "ikgym[urdf]"') from error
    path = _found(where, name, folder)
    if path.suffix.lower() not in KINDS:
        raise InvalidInputError(f"{where}: expected a mesh of kind {', '.join(KINDS)}, got {name!r}.")
    content = read_user_file(path, MAX_BYTES)
    if path.suffix.lower() == ".dae" and (not content.lstrip().startswith(b"<") or b"<!DOCTYPE" in content):
        raise InvalidInputError(f"{where}: expected XML without a DOCTYPE in {name!r}.")
    try:
        mesh = trimesh.load_mesh(io.BytesIO(content), file_type=path.suffix[1:].lower(), process=False)
        points, volume = np.array(mesh.vertices, dtype=float), float(mesh.convex_hull.volume)
    except Exception as error:  # whatever trimesh raises, it is about this file
        raise InvalidInputError(f"{where}: expected a mesh in {name!r}, got the error: {error}") from error
    if points.ndim != 2 or len(points) < 4 or not (np.abs(points) <= LARGEST).all():
        raise InvalidInputError(f"{where}: expected a mesh with at least 4 finite corners in {name!r}.")
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
