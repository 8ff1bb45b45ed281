"""The tree of links of a URDF file."""

from __future__ import annotations

from xml.etree.ElementTree import Element

from ikgym.arms.urdf import xml
from ikgym.exceptions import InvalidInputError

# Parsers of URDF call themselves once a link: a chain of thousands overflows their stack, and that is the end
# of the whole process.
MAX_JOINTS = 128
KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


class Tree:
    """The links of a robot, each but the root below one joint.

    Args:
        data: Content of the file.

    Attributes:
        name: Name of the robot.
        links: Names of all links.
        root: The link above all others.
    """

    def __init__(self, data: bytes) -> None:
        robot = xml.parse(data)
        if robot.tag != "robot":
            raise InvalidInputError(f"expected the root element <robot>, got <{robot.tag}>.")
        if any("xacro" in element.tag for element in robot):
            raise InvalidInputError("expected a URDF, got macros of xacro; expand them first: xacro FILE > arm.urdf")
        self._elements = xml.index_by_name(robot, "link")
        self.links = tuple(self._elements)
        self._above: dict[str, tuple[Element, str]] = {}
        self._below: dict[str, list[str]] = {link: [] for link in self.links}
        for joint in xml.index_by_name(robot, "joint").values():
            self._add(joint)
        self.root = self._only_root()
        self.name = xml.attribute("robot", robot, "name")

    def _add(self, joint: Element) -> None:
        where = xml.label(joint)
        xml.attribute(where, joint, "type", KINDS)
        parent, child = (
            xml.attribute(where, xml.find_required(where, joint, end), "link", self._below)
            for end in ("parent", "child")
        )
        if child in self._above:
            both = f"{xml.label(self._above[child][0])} and {where}"
            raise InvalidInputError(f"link {child!r}: expected one joint above it, got {both}.")
        self._above[child] = joint, parent
        self._below[parent].append(child)

    def _only_root(self) -> str:
        roots = [link for link in self.links if link not in self._above]
        if len(roots) > 1:
            raise InvalidInputError(f"expected one link without a joint above it, got {xml.listing(roots)}.")
        # Each link has one joint above it, so links that the root does not reach form a loop.
        looping = set(self.links).difference(*map(self.below, roots))
        if looping:
            raise InvalidInputError(f"expected a tree of links, got a loop of {xml.listing(sorted(looping))}.")
        return roots[0]

    def leaves(self, base: str) -> list[str]:
        """The links below the base that have no other below them."""
        return [link for link in self.below(base) if not self._below[link]]

    def collisions(self, link: str) -> list[Element]:
        """The collision geometry of a link."""
        return self._elements[link].findall("collision")

    def visible(self, link: str) -> bool:
        """Whether a link has a visual shape."""
        return self._elements[link].find("visual") is not None

    def links_between(self, base: str, tip: str) -> list[str]:
        """The links from base to tip, without the base."""
        return [xml.find_required("", joint, "child").get("link", "") for joint in self.path(base, tip)]

    def path(self, base: str, tip: str) -> list[Element]:
        """The joints from base to tip."""
        joints: list[Element] = []
        passed = [tip]
        while passed[-1] != base:
            if passed[-1] == self.root:
                raise InvalidInputError(
                    f"expected a base above tip {tip!r}, one of {xml.listing(passed[1:])}; got {base!r}."
                )
            joint, parent = self._above[passed[-1]]
            joints.append(joint)
            passed.append(parent)
        if len(joints) > MAX_JOINTS:
            raise InvalidInputError(
                f"expected at most {MAX_JOINTS} joints from {base!r} to {tip!r}, got {len(joints)}."
            )
        return joints[::-1]

    def below(self, base: str) -> list[str]:
        """The base and all links below it."""
        reached = [base]
        for link in reached:
            reached.extend(self._below[link])
        return reached
