"""The command ``ikgym arms``."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baselines.cli import shell
from ikgym import arms
from ikgym.arms import Arm


def main(arguments: Sequence[str]) -> int:
    """The command line: names, or options; returns the exit code."""
    return shell.list_members("arms", ARMS, arguments)


def _arm_row(name: str) -> tuple[str, ...]:
    arm = arms.get(name)
    return str(arm.joints), str(sum(arm.prismatic)), ", ".join(kinds_of_limits(arm)) or "none"


def kinds_of_limits(arm: Arm) -> list[str]:
    """The kinds of limits of an arm."""
    ends = np.concatenate([arm.lower, arm.upper])
    kinds = {"joints": ends, "velocity": arm.velocity_limit, "acceleration": arm.acceleration_limit}
    return [kind for kind, values in kinds.items() if np.isfinite(values).any()]


def _arm(name: str) -> str:
    arm = arms.from_urdf(name) if name.endswith(".urdf") else arms.get(name)
    rows: list[tuple[str, ...]] = [("joint", "kind", "lower", "upper", "velocity limit", "acceleration limit")]
    numbers = zip(arm.prismatic, arm.lower, arm.upper, arm.velocity_limit, arm.acceleration_limit, strict=True)
    for joint, (prismatic, *limits) in enumerate(numbers, 1):
        unit = "m" if prismatic else "rad"
        units = unit, unit, f"{unit}/s", f"{unit}/s²"
        cells = [f"{value:.4g} {ending}" for value, ending in zip(limits, units, strict=True)]
        rows.append((str(joint), "prismatic" if prismatic else "revolute", *cells))
    tool = shell.numbers(arm.forward(np.zeros(arm.joints))[1])
    home = "none stated" if arm.home is None else f"({shell.numbers(arm.home)}) rad or m"
    title = f"{name}: {arm.joints} joints, tool at ({tool}) m where q = 0, home posture {home}"
    return f"{title}\n\n{shell.aligned(rows, 80)}"


ARMS = shell.Catalogue("arm", arms.names, ("arm", "joints", "prismatic", "limits"), _arm_row, _arm, ".urdf")
