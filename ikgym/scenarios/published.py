"""Scenarios of problems that others published and that have no file: random ones, and those with obstacles."""

from __future__ import annotations

import numpy as np

from ikgym import arms, problems
from ikgym.obstacles import Box
from ikgym.scenarios.scenario import Scenario
from ikgym.trajectories import PublishedPath
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray

#: Scenarios that differ in their problem alone, by the beginnings of the names.
LIKE = {
    "rlitg": "rlitg-hello",
    "cppflow-fetch": "cppflow-fetch-hello",
    "cppflow-panda": "cppflow-panda-square",
}
#: From waypoint to waypoint, in [s].
PERIOD = 0.2


def scenario(problem: str, like: Scenario) -> Scenario:
    """The scenario of a problem, like that of another one; a collision with its obstacles stops the arm.

    Bodies are those of our arms, and not the publishers'. Among obstacles the Panda has its hand.
    """
    arm = like.arm
    if arm.name == "panda":
        hand = arms.get("panda-hand")
        arm = hand.replace(tool=arm.tool, acceleration_limit=arm.acceleration_limit)
    return like.replace(
        name=problem,
        arm=arm,
        trajectory=PublishedPath(problem, PERIOD),
        steps=round(PERIOD / like.dt) * (len(problems.waypoints(problem).positions) - 1),
        start=None,
        obstacles=_boxes(problems.boxes(problem)),
    )


def _boxes(rows: FloatArray) -> tuple[Box, ...]:
    """Upright boxes, from the rows of :func:`ikgym.problems.boxes`."""
    turned = matrices(np.column_stack([np.cos(0.5 * rows[:, 6]), *np.zeros((2, len(rows))), np.sin(0.5 * rows[:, 6])]))
    return tuple(Box(f"box {i + 1}", row[:3], row[3:6], turned[i]) for i, row in enumerate(rows))
