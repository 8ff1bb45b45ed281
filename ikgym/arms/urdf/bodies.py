"""Bodies of an arm from the collision geometry of a URDF file."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import numpy.typing as npt

from ikgym.arms.arm import Arm
from ikgym.arms.bodies import Bodies
from ikgym.arms.urdf import xml
from ikgym.arms.urdf.chain import read_origin
from ikgym.arms.urdf.covering import Capsule
from ikgym.arms.urdf.geometry import Solid, read_solid
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray

logger = logging.getLogger("ikgym")

# Whole humanoids have about a hundred.
MAX_BODIES = 256
# Postures in which a pair has to touch to be left out.
POSTURES = 100


def with_bodies(arm: Arm, tree: Tree, base: str, folder: Path | None) -> Arm:
    """The arm with capsules around the collision geometry of all links below the base.

    Geometry of a link off the chain is fixed, at the zero position of its joints, to the link of the chain before it.
    Pairs that touch in each of 100 random postures are ignored, and the log names them. Without a folder meshes stay
    closed.
    """
    found: list[tuple[str, int, Capsule]] = []
    solids: list[Solid] = []
    closed = 0
    for link in tree.below(base):
        read = [(each, read_solid(f"link {link!r}", each, folder)) for each in tree.collisions(link)]
        closed += sum(solid is None for _, solid in read)
        if opened := [(each, solid) for each, solid in read if solid is not None]:
            solids += [solid for _, solid in opened]
            if sum(len(solid.capsules) for solid in solids) > MAX_BODIES:
                raise InvalidInputError(f"expected at most {MAX_BODIES} bodies from collision shapes, got more.")
            number, capsules = _on_link(arm, tree.path(base, link), link, opened)
            found += _named(link, number, capsules)
    _report(arm.name, solids, closed)
    if not found:
        return arm
    names, links, kept = zip(*found, strict=True)
    starts, ends, radii = map(np.array, zip(*kept, strict=True))
    arm = arm.replace(bodies=Bodies(names, links, starts, ends, radii))
    return arm.replace(bodies=arm.bodies.replace(ignored=_always_touching(arm)))


def _on_link(arm: Arm, path: list[Element], link: str, read: list[tuple[Element, Solid]]) -> tuple[int, list[Capsule]]:
    """The number of the arm's link to which a link is fixed, and its capsules there, without those inside others."""
    import pinocchio

    number = 0
    placement = pinocchio.SE3.Identity()
    for joint in path:
        placement = placement * pinocchio.SE3(*_origin(xml.label(joint), joint))
        if number < arm.joints and joint.get("name") == arm.joint_names[number]:
            number += 1
    capsules: list[Capsule] = []
    for collision, solid in read:
        there = placement * pinocchio.SE3(*_origin(f"link {link!r}", collision))
        shift = there.translation - arm.offsets[:number].sum(axis=0)
        capsules += [Capsule(there.rotation @ a + shift, there.rotation @ b + shift, r) for a, b, r in solid.capsules]
    return number, list(_outermost(capsules))


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


def _named(link: str, number: int, capsules: list[Capsule]) -> Iterator[tuple[str, int, Capsule]]:
    for i, capsule in enumerate(capsules, 1):
        yield link if len(capsules) == 1 else f"{link}[{i}]", number, capsule


def _always_touching(arm: Arm) -> list[tuple[str, str]]:
    """Of the pairs that touch in the first posture those that touch in all of them."""
    postures = _postures(arm)
    always: list[tuple[str, str]] = []
    others = arm
    while True:
        distance, pair = others.clearance(postures[0])
        if distance >= 0.0:
            break
        first, second = (arm.bodies.names[i] for i in pair)
        if (_pair_alone(arm, pair).clearance(postures)[0] < 0.0).all():
            always.append((first, second))
        others = others.replace(bodies=others.bodies.replace(ignored=(*others.bodies.ignored, (first, second))))
    if always:
        logger.info("%s: ignored, since they always touch: %s", arm.name, ", ".join(map(" and ".join, always)))
    return always


def _pair_alone(arm: Arm, pair: npt.NDArray[np.int64]) -> Arm:
    bodies = arm.bodies
    names, links = [bodies.names[i] for i in pair], [bodies.links[i] for i in pair]
    return arm.replace(bodies=Bodies(names, links, bodies.starts[pair], bodies.ends[pair], bodies.radii[pair]))


def _postures(arm: Arm) -> FloatArray:
    """Random postures within the limits, or within half a turn or a metre of 0 where there are none. Shape (·, n)."""
    most = np.where(arm.chain.prismatic, 1.0, np.pi)
    lower, upper = np.where(np.isfinite(arm.lower), arm.lower, -most), np.where(np.isfinite(arm.upper), arm.upper, most)
    return np.random.default_rng(0).uniform(lower, upper, (POSTURES, arm.joints))


def _report(name: str, solids: list[Solid], closed: int) -> None:
    if solids:
        before = 1e3 * sum(solid.volume for solid in solids)
        after = 1e3 * sum(capsule.volume for solid in solids for capsule in solid.capsules)
        logger.info("%s: %d collision shapes of %.3g l, within capsules of %.3g l", name, len(solids), before, after)
    if closed:
        logger.info("%s: %d meshes were not opened and are no bodies; from_urdf(…, meshes=True) opens", name, closed)
