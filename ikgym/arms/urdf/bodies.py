"""Bodies of an arm from the collision geometry of a URDF file."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from ikgym.arms.arm import Arm
from ikgym.arms.bodies import Bodies
from ikgym.arms.source import LinkShapes
from ikgym.arms.urdf import xml
from ikgym.arms.urdf.chain import read_origin
from ikgym.arms.urdf.covering import Capsule
from ikgym.arms.urdf.geometry import Solid, read_solid
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.bodies import OBSTACLE
from ikgym.kernels.bodies.clearance import near_rows
from ikgym.validation import FloatArray

logger = logging.getLogger("ikgym")

# Whole humanoids have about a hundred.
MAX_BODIES = 256
# Postures in which a pair has to touch to be left out, and pairs that are looked at together.
POSTURES, TOGETHER = 100, 64


def with_bodies(
    arm: Arm, tree: Tree, base: str, tip: str, folders: Sequence[Path] | None, bodyless: Sequence[str]
) -> tuple[Arm, tuple[LinkShapes, ...]]:
    """The arm with capsules around the collision geometry of all links below the base, and what they were made from.

    Geometry of a link off the chain is fixed, at the zero position of its joints, to the link of the chain before it.
    Pairs that touch in each of 100 random postures are ignored, and the log names them. Links of the chain, and links
    fixed to them, are :attr:`Bodies.unseen` where they have a shape but no body, or where nothing that moves with them
    has one.

    Args:
        arm: The arm, without bodies.
        tree: The links of the file.
        base: The link at which the arm begins.
        tip: That at which it ends.
        folders: That of the file, then those of packages; None where meshes stay closed.
        bodyless: Links that have no body.
    """
    found: list[tuple[str, int, Capsule]] = []
    shapes: list[LinkShapes] = []
    unseen: list[str] = []
    looked = {0, *(_place(arm, tree.path(base, link)).number for link in bodyless)}
    for link in tree.below(base):
        if link in bodyless:
            continue
        place = _place(arm, tree.path(base, link))
        read = [(each, read_solid(f"link {link!r}", each, folders)) for each in tree.collisions(link)]
        solids = [(each, solid) for each, solid in read if isinstance(solid, Solid)]
        reasons = [solid for _, solid in read if isinstance(solid, str)]
        if not solids and not reasons and tree.visible(link):
            reasons = ["it has a visual shape, but no collision shape"]
        if reasons and place.rigid:
            unseen.append(f"{link!r}: {reasons[0]}")
        elif reasons and folders is not None:
            logger.warning("%s: link %r, off the chain, has no body: %s.", arm.name, link, reasons[0])
        if solids or reasons:
            looked.add(place.number)
        if solids:
            capsules = list(_outermost(_place_capsules(arm, place, link, solids)))
            found += _name_capsules(link, place.number, capsules)
            sources = dict.fromkeys(solid.source for _, solid in solids)
            volumes = sum(solid.volume for _, solid in solids), sum(capsule.volume for capsule in capsules)
            shapes.append(LinkShapes(link, " and ".join(sources), *volumes))
        if len(found) > MAX_BODIES:
            raise InvalidInputError(f"expected at most {MAX_BODIES} bodies from collision shapes, got more.")
    for link in tree.links_between(base, tip):
        number = _place(arm, tree.path(base, link)).number
        if number not in looked:
            looked.add(number)
            unseen.append(f"{link!r}: it has no shape")
    return _with(arm, found, unseen), tuple(shapes)


def _with(arm: Arm, found: Sequence[tuple[str, int, Capsule]], unseen: Sequence[str]) -> Arm:
    """The arm with named capsules on its links, and with links that were not looked at."""
    if found:
        names, links, kept = zip(*found, strict=True)
        starts, ends, radii = map(np.array, zip(*kept, strict=True))
        arm = arm.replace(bodies=Bodies(names, links, starts, ends, radii))
        arm = arm.replace(bodies=arm.bodies.replace(ignored=_always_touching(arm)))
    return arm.replace(bodies=arm.bodies.replace(unseen=tuple(unseen))) if unseen else arm


class _Place(NamedTuple):
    """Where a link is when all joints are at 0.

    Attributes:
        number: Of the link of the arm that it is fixed to.
        rigid: Whether it is fixed to that link: no joint off the chain is between them.
        placement: In the frame of the base, with joints of the arm at 0.
    """

    number: int
    rigid: bool
    placement: Any


def _place(arm: Arm, path: Sequence[Element]) -> _Place:
    import pinocchio

    number, rigid, placement = 0, True, pinocchio.SE3.Identity()
    for joint in path:
        placement = placement * pinocchio.SE3(*_origin(xml.label(joint), joint))
        if number < arm.joints and joint.get("name") == arm.joint_names[number]:
            number += 1
        else:
            rigid &= joint.get("type") == "fixed"
    return _Place(number, rigid, placement)


def _place_capsules(arm: Arm, place: _Place, link: str, solids: Sequence[tuple[Element, Solid]]) -> list[Capsule]:
    """The capsules of a link in the frame of the arm's link."""
    import pinocchio

    capsules: list[Capsule] = []
    for collision, solid in solids:
        there = place.placement * pinocchio.SE3(*_origin(f"link {link!r}", collision))
        shift = there.translation - arm.offsets[: place.number].sum(axis=0)
        capsules += [Capsule(there.rotation @ a + shift, there.rotation @ b + shift, r) for a, b, r in solid.capsules]
    return capsules


def _origin(where: str, element: Element) -> tuple[FloatArray, FloatArray]:
    """Rotation and position of the ``<origin>`` of an element."""
    import pinocchio

    xyz, rpy = read_origin(where, element)
    return pinocchio.rpy.rpyToMatrix(*rpy), np.array(xyz)


def _outermost(capsules: list[Capsule]) -> Iterator[Capsule]:
    """Those that no other contains: a cylinder with a sphere at each end is one capsule."""
    for i, one in enumerate(capsules):
        around = [j for j, other in enumerate(capsules) if j != i and other.contains(one)]
        # Of two that are the same the first one stays.
        if all(j > i and one.contains(capsules[j]) for j in around):
            yield one


def _name_capsules(link: str, number: int, capsules: list[Capsule]) -> Iterator[tuple[str, int, Capsule]]:
    for i, capsule in enumerate(capsules, 1):
        yield link if len(capsules) == 1 else f"{link}[{i}]", number, capsule


def _always_touching(arm: Arm) -> list[tuple[str, str]]:
    """The pairs that touch in all of some random postures."""
    postures, bodies, always = _postures(arm), arm.bodies, list[tuple[str, str]]()
    obstacles = np.empty((0, OBSTACLE)), np.empty((0, len(bodies)), dtype=np.bool_)
    counts, distances = np.empty(POSTURES, dtype=np.int64), np.empty((POSTURES, TOGETHER))
    pairs, gradients = np.empty((POSTURES, TOGETHER, 2), dtype=np.int64), np.empty((POSTURES, TOGETHER, arm.joints))
    for begin in range(0, len(bodies.pairs), TOGETHER):
        shapes = bodies.shapes._replace(pairs=bodies.pairs[begin : begin + TOGETHER].copy())
        near_rows(arm.chain, shapes, *obstacles, postures, 0.0, counts, distances, pairs, gradients)
        touching = np.concatenate([pairs[i, : counts[i]] for i in range(POSTURES)])
        found, times = np.unique(touching, axis=0, return_counts=True)
        always += [(bodies.names[i], bodies.names[j]) for i, j in found[times == POSTURES].tolist()]
    if always:
        logger.info("%s: ignored, since they always touch: %s", arm.name, ", ".join(map(" and ".join, always)))
    return always


def _postures(arm: Arm) -> FloatArray:
    """Random postures within the limits, or within half a turn or a metre of 0 where there are none. Shape (·, n)."""
    most = np.where(arm.chain.prismatic, 1.0, np.pi)
    lower, upper = np.where(np.isfinite(arm.lower), arm.lower, -most), np.where(np.isfinite(arm.upper), arm.upper, most)
    return np.random.default_rng(0).uniform(lower, upper, (POSTURES, arm.joints))
