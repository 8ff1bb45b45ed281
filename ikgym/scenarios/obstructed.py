"""Scenarios of the problems with obstacles that others published."""

from __future__ import annotations

import numpy as np

from ikgym import arms, problems
from ikgym.arms import Arm
from ikgym.cost import TrackingCost
from ikgym.obstacles import Box
from ikgym.scenarios.scenario import Scenario
from ikgym.tasks import get as task
from ikgym.trajectories import PublishedPath
from ikgym.trajectories.orientations import matrices
from ikgym.validation import FloatArray

#: From waypoint to waypoint and from step to step in [s], as in the problems without obstacles.
PERIOD, DT = 0.2, 0.02


def scenario(problem: str) -> Scenario:
    """The scenario of a problem of :data:`ikgym.problems.OBSTRUCTED`; a collision stops the arm.

    Bodies are those of our arms, and not the publishers'.
    """
    source, kind, _ = problem.split("-", 2) if problem.count("-") > 1 else (*problem.split("-"), "")
    return Scenario(
        name=problem,
        arm=arm_of("fetch_arm" if source == "rlitg" else kind),
        task=task("pose"),
        trajectory=PublishedPath(problem, PERIOD),
        dt=DT,
        steps=round(PERIOD / DT) * (len(problems.waypoints(problem).positions) - 1),
        cost=TrackingCost(delta_x=1e-4),
        obstacles=boxes_of(problems.boxes(problem)),
        source="MinsungYoon/RL-ITG" if source == "rlitg" else "jstmn/cppflow",
    )


def arm_of(name: str) -> Arm:
    """The arm of a published problem, whose accelerations are not limited; the Panda ends at `panda_hand`."""
    arm = arms.get("panda-hand" if name == "panda" else name)
    tool = arms.get("panda").tool if name == "panda" else arm.tool
    return arm.replace(tool=tool, acceleration_limit=np.full(arm.joints, np.inf))


def boxes_of(rows: FloatArray) -> tuple[Box, ...]:
    """Upright boxes, from the rows of :func:`ikgym.problems.boxes`."""
    turned = matrices(np.column_stack([np.cos(0.5 * rows[:, 6]), *np.zeros((2, len(rows))), np.sin(0.5 * rows[:, 6])]))
    return tuple(Box(f"box {i + 1}", row[:3], row[3:6], turned[i]) for i, row in enumerate(rows))
