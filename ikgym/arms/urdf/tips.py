"""The links of a URDF file that may be the tip of an arm, likely ones first."""

from __future__ import annotations

import re
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ikgym.arms.urdf.joint import read_joint
from ikgym.arms.urdf.tree import Tree
from ikgym.exceptions import InvalidInputError

#: Words in names of frames that are meant as the tip: ``tool0``, ``r_gripper_tool_frame``, ``panda_hand_tcp``.
WORDS = ("tool", "tcp", "end_effector", "ee", "eef", "flange", "grasp", "grasping", "gripper", "hand")
_FRAME = re.compile(rf"(?:.*_)?({'|'.join(WORDS)})\d*(?:_frame|_link)*", re.IGNORECASE)


class Tip(NamedTuple):
    """A link at the end of joints that move.

    Attributes:
        link: Its name.
        joints: Names of the moving joints from the base to it.
        kinds: Their kinds: ``revolute``, ``continuous``, ``prismatic``, or one that no arm has.
        fault: Why :func:`ikgym.arms.from_urdf` cannot read the chain; empty where it can.
    """

    link: str
    joints: tuple[str, ...]
    kinds: tuple[str, ...]
    fault: str = ""


def likely_tips(tree: Tree, base: str) -> list[Tip]:
    """The leaves below a base that move: readable ones, tool frames, and long chains first."""
    found = [_tip(leaf, tree.path(base, leaf)) for leaf in tree.leaves(base)]
    return sorted((tip for tip in found if tip.joints), key=_order)


def _order(tip: Tip) -> tuple[bool, bool, int, int]:
    frame = _FRAME.fullmatch(tip.link)
    word = len(WORDS) if frame is None else WORDS.index(frame[1].lower())
    return bool(tip.fault), frame is None, -len(tip.joints), word


def _tip(link: str, path: list[Element]) -> Tip:
    moving = [joint for joint in path if joint.get("type") != "fixed"]
    names, kinds = (tuple(joint.get(key, "") for joint in moving) for key in ("name", "type"))
    return Tip(link, names, kinds, _fault(path))


def _fault(path: list[Element]) -> str:
    try:
        for joint in path:
            read_joint(joint)
    except InvalidInputError as error:
        return str(error)
    return ""
