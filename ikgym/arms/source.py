"""Where an arm was read from."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from ikgym.validation import FloatArray


class LinkShapes(NamedTuple):
    """The collision shapes of a link, and the capsules around them.

    Attributes:
        link: Its name.
        source: What they were made from: ``mesh``, ``shape``, or both.
        volume: Of the shapes in [m³]; that of the convex hull for a mesh.
        covered: Of the capsules in [m³], those that overlap counted twice.
    """

    link: str
    source: str
    volume: float
    covered: float


class UrdfReference(NamedTuple):
    """The source of an arm from a URDF file; see :func:`ikgym.arms.from_urdf`.

    Attributes:
        file: The file, as an absolute path.
        base: The link at its beginning, None for the root.
        tip: The link at its end, None for the only one that it can be.
        tool: Tool point in the frame of the tip in [m], None for its origin. Shape (3,).
        tool_rotation: Orientation of the tool in the frame of the tip, None for that frame's. Shape (3, 3).
        meshes: Whether collision meshes were opened.
        packages: Folders that packages of meshes were searched in, as absolute paths.
        bodyless: Links that have no body, since they may touch.
        shapes: The links with bodies.
    """

    file: Path
    base: str | None
    tip: str | None
    tool: FloatArray | None
    tool_rotation: FloatArray | None
    meshes: bool = False
    packages: tuple[Path, ...] = ()
    bodyless: tuple[str, ...] = ()
    shapes: tuple[LinkShapes, ...] = ()
