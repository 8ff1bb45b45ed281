"""The command ``ikgym arms``."""

from __future__ import annotations

import dataclasses
import textwrap
from collections import Counter
from collections.abc import Sequence

import numpy as np

from baselines.cli import shell
from baselines.cli.own_path import ROBOT_OPTIONS, RobotOptions, describe_bodies, look_at
from baselines.cli.parsing import Rule
from ikgym import arms, scenarios
from ikgym.arms import Arm, Tip
from ikgym.scenarios.files import document

#: Most tips in a table; names alone of the others.
MOST_TIPS = 8


@dataclasses.dataclass(frozen=True)
class Arguments(shell.Names, RobotOptions):
    """Arguments of the command line."""


RULES = (Rule(ROBOT_OPTIONS, lambda given: any(_is_urdf(name) for name in given.names), "without a URDF file"),)


def _is_urdf(name: str) -> bool:
    return name.endswith(".urdf")


def _arm_row(name: str) -> tuple[str, ...]:
    arm = arms.get(name)
    return str(arm.joints), str(sum(arm.prismatic)), ", ".join(kinds_of_limits(arm)) or "none"


def kinds_of_limits(arm: Arm) -> list[str]:
    """The kinds of limits of an arm."""
    ends = np.concatenate([arm.lower, arm.upper])
    kinds = {"joints": ends, "velocity": arm.velocity_limit, "acceleration": arm.acceleration_limit}
    return [kind for kind, values in kinds.items() if np.isfinite(values).any()]


def _show(name: str, given: Arguments) -> str:
    """An arm in full: of the catalogue, of a scenario file, or of a URDF file."""
    if name.endswith(".toml"):
        return _table(name, scenarios.find(name).arm)
    if not _is_urdf(name):
        return _table(name, arms.get(name))
    found = arms.tips(name, base=given.base) if given.tip is None else ()
    if len(found) < 2:
        return _from_urdf(name, given.tip, given)
    first = found[0]
    return _choice(name, found) + ("" if first.fault else f"\n\n{_from_urdf(name, first.link, given)}")


def _from_urdf(name: str, tip: str | None, given: Arguments) -> str:
    """The arm of a URDF file, and how a scenario file names it."""
    arm = dataclasses.replace(given, tip=tip).robot(name)
    title = name if tip is None else f"{name} to {tip}"
    return f"{_table(title, arm)}\n\n{_scenario_table(name, tip, given, arm)}"


def _choice(name: str, found: Sequence[Tip]) -> str:
    """The links of a file that can be the tip, likely ones first, and how to choose one."""
    rows = [("tip", "joints", "kinds", "from … to"), *map(_tip_row, found[:MOST_TIPS])]
    others = [tip.link for tip in found[MOST_TIPS:]]
    title = (
        f"{name}: no link can be the tip"
        if found[0].fault
        else f"{name}: {len(found)} links can be the tip; choose one with --tip, such as --tip {found[0].link}"
    )
    table = shell.align(rows, shell.width())
    return "\n".join([title, "", table, *([shell.listing("others", others)] if others else [])])


def _tip_row(tip: Tip) -> tuple[str, ...]:
    kinds = ", ".join(f"{count} {kind}" for kind, count in Counter(tip.kinds).items())
    ends = f"cannot be read: {tip.fault}" if tip.fault else f"{tip.joints[0]} … {tip.joints[-1]}"
    if tip.gripper and not tip.fault:
        ends += ", which seems to belong to a gripper"
    return tip.link, str(len(tip.joints)), kinds, ends


def _table(name: str, arm: Arm) -> str:
    """The joints of an arm with their limits."""
    rows: list[tuple[str, ...]] = [("joint", "kind", "lower", "upper", "velocity", "acceleration")]
    numbers = zip(arm.lower, arm.upper, arm.velocity_limit, arm.acceleration_limit, strict=True)
    for joint, prismatic, limits in zip(arm.joint_names, arm.prismatic, numbers, strict=True):
        unit = "m" if prismatic else "rad"
        units = unit, unit, f"{unit}/s", f"{unit}/s²"
        cells = [f"{x:.4g} {per}" if np.isfinite(x) else "none" for x, per in zip(limits, units, strict=True)]
        rows.append((joint, "prismatic" if prismatic else "revolute", *cells))
    rotation, position = arm.forward(np.zeros(arm.joints))
    x, z = (f"its {axis} axis along ({shell.numbers(rotation[:, i])})" for i, axis in ((0, "x"), (2, "z")))
    tool = f"tool at ({shell.numbers(position)}) m, {x}, {z}, where q = 0"
    home = "none stated" if arm.home is None else f"({shell.numbers(arm.home)}) rad or m"
    title = f"{name}: {arm.joints} joints, {tool}, home posture {home}"
    return "\n\n".join([textwrap.fill(title, shell.width()), shell.align(rows, shell.width()), *_bodies(arm)])


def _bodies(arm: Arm) -> list[str]:
    """The bodies of an arm, with the meshes of its file, a line for each link; nothing if there are none."""
    arm = look_at(arm)
    bodies, links = arm.bodies, ("the base", *arm.joint_names)
    text = textwrap.fill(f"Bodies: {describe_bodies(arm)}", shell.width(), break_on_hyphens=False)
    if not len(bodies):
        return [text] if bodies.unseen else []
    lengths = np.linalg.norm(bodies.ends - bodies.starts, axis=1)
    kinds = [f"capsule of {length:.3g} m" if length else "sphere" for length in lengths]
    texts = [
        f"{name} ({kind}, radius {r:.3g} m)" for name, kind, r in zip(bodies.names, kinds, bodies.radii, strict=True)
    ]
    rows = [
        (links[link], ", ".join(text for text, place in zip(texts, bodies.links, strict=True) if place == link))
        for link in sorted(set(bodies.links))
    ]
    table = shell.align([("moved by", f"bodies; {len(bodies.pairs)} pairs of them can meet"), *rows], shell.width())
    return [table, text]


def _scenario_table(name: str, tip: str | None, given: Arguments, arm: Arm) -> str:
    """The arm as a scenario file has it."""
    stated = bool(np.isfinite(arm.acceleration_limit).any())
    limit = arm.acceleration_limit if stated else None
    table: dict[str, object] = {"urdf": name, "base": given.base, "tip": tip, "tool": given.tool}
    table |= {"packages": given.packages or None, "bodyless": given.bodyless or None, "acceleration_limit": limit}
    head = "In a scenario file:" if stated else "In a scenario file (add acceleration_limit, which no URDF states):"
    return f"{head}\n\n{document({'arm': table}).strip()}"


main = shell.list_command(
    "arms",
    "arm",
    arms.names,
    (("joints", "prismatic", "limits"), _arm_row),
    _show,
    endings=(".urdf", ".toml"),
    options=Arguments,
    rules=RULES,
)
