"""The chain of a URDF file between two links, checked before Pinocchio reads it."""

from __future__ import annotations

from ikgym.arms.urdf import xml
from ikgym.arms.urdf.joint import BOUNDED, MOVING, UrdfJoint, read_joint
from ikgym.arms.urdf.tips import likely_tips
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names


def read_chain(tree: Tree, base: str | None, tip: str | None) -> tuple[str, list[UrdfJoint]]:
    """The link at the beginning of a chain, and its joints.

    The links of the whole file must be a tree. Numbers are checked between the two links only: no other joint
    has a say in where the tip is. Without a base it begins at the root, and without a tip it ends at the only leaf that
    moves.
    """
    known_names("link", [link for link in (base, tip) if link is not None], tree.links)
    base = tree.root if base is None else base
    tip = only_tip(tree, base) if tip is None else tip
    path = tree.path(base, tip)
    if without := [xml.label(joint) for joint in path if joint.get("type") in BOUNDED and joint.find("limit") is None]:
        raise InvalidInputError(
            f"{', '.join(without)}: expected a <limit>, got none; an endless joint is of type 'continuous'."
        )
    joints = list(map(read_joint, path))
    if not any(joint.kind in MOVING for joint in joints):
        raise InvalidInputError(f"expected a joint that moves between links {base!r} and {tip!r}, got none.")
    return base, joints


def only_tip(tree: Tree, base: str) -> str:
    """The one leaf below the base that moves; the only leaf where none does."""
    leaves = tree.leaves(base)
    found = [tip.link for tip in likely_tips(tree, base)] if len(leaves) > 1 else leaves
    if not found:
        raise InvalidInputError(f"expected a joint that moves below link {base!r}, got none.")
    if len(found) > 1:
        raise InvalidInputError(f"expected a tip, since there are several: {xml.listing(found)}.")
    return found[0]
