"""Defaults of solvers on arms of 1 to 21 m: which parameters depend on the arm's size, and what the defaults cost."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

import baselines
import ikgym
from baselines.episodes import rollouts
from baselines.solvers.arm_size import length
from benchmarks.effort import FULL, Effort
from benchmarks.table import Column, Table
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.trajectories import RandomJointSpline

#: The arms, with their control periods in [s].
ARMS = {"panda": 1e-3, "iiwa14": 1e-3, "tiago": 4e-3, "varga7": 1e-3, "khan8": 1e-3}
#: What has a default that depends on the arm, and what it was for all arms.
BEFORE: dict[str, dict[str, Any]] = {
    "jacobian_transpose": {"length": 1.0},
    "fixed_point": {"length": 1.0},
    "abstract_rotation": {"lambda_a": 5e-4},
}
WEIGHED = ("jacobian_transpose", "fixed_point")
DAMPINGS = (1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 1e-1)
SHARES = (0.25, 0.5, 1.0, 2.0, 4.0)
#: Of arms that have no limits: what an action of 1 means in [rad/s], and the limits of motions in [rad], [rad/s] and
#: [rad/s²].
ACTION = 10.0
LIMITS = {"position": 2.9, "velocity": 2.0, "acceleration": 10.0}
CONDITIONS = (
    "Whole poses of smooth random joint motions within the limits, the same for all solvers, {episodes} an arm and "
    "{steps} steps each (4 ms on tiago, 1 ms on others). Costs are geometric means over the episodes."
)


class Score(NamedTuple):
    """What a policy makes of the episodes of an arm.

    Attributes:
        cost: Geometric mean of the cost.
        position: Median of the largest position error in [m].
        orientation: Median of the largest orientation error in [rad].
    """

    cost: float
    position: float
    orientation: float


def tables(effort: Effort = FULL) -> list[Table]:
    """What the defaults changed, and how costs depend on the damping and on what 1 rad counts as."""
    conditions = CONDITIONS.format(episodes=effort.episodes, steps=2 * effort.steps)
    return [
        _changes(effort, conditions),
        _grid("dls", "damping", [(f"{value:g}", value) for value in DAMPINGS], effort),
        *(_grid(policy, "length", [(f"× {share:g}", share) for share in SHARES], effort) for policy in WEIGHED),
    ]


@functools.lru_cache
def scenario(name: str, steps: int) -> Scenario:
    """Random smooth joint motions of an arm, given as poses."""
    arm, dt = ikgym.arms.get(name), ARMS[name]
    missing = missing_limits(arm)
    return Scenario(
        f"{name}-defaults",
        arm,
        ikgym.tasks.get("pose"),
        RandomJointSpline.within(arm, steps * dt, spans=4, margin=0.05, **missing),
        velocity_limit=np.full(arm.joints, ACTION) if "velocity_limit" in missing else arm.velocity_limit,
        dt=dt,
        steps=steps,
    )


def missing_limits(arm: Arm) -> dict[str, Any]:
    """Limits for an arm that lacks some."""
    made: dict[str, Any] = {}
    if not np.isfinite(arm.lower).all():
        bound = np.full(arm.joints, LIMITS["position"])
        made |= {"lower": -bound, "upper": bound}
    for kind in ("velocity", "acceleration"):
        if not np.isfinite(getattr(arm, f"{kind}_limit")).all():
            made[f"{kind}_limit"] = LIMITS[kind]
    return made


def score(arm: str, policy: str, parameters: Mapping[str, Any], effort: Effort) -> Score:
    """What a policy makes of the episodes of an arm."""
    which = scenario(arm, 2 * effort.steps)
    made = baselines.make(policy, which, **parameters)
    played = rollouts(which, made, list(range(effort.episodes)))
    costs = [float((one.tracking_cost + one.velocity_cost).sum()) for one in played]
    return Score(
        float(np.exp(np.log(costs).mean())),
        float(np.median([one.position_error.max() for one in played])),
        float(np.median([one.orientation_error.max() for one in played])),
    )


def _changes(effort: Effort, conditions: str) -> Table:
    rows: dict[str, tuple[float | None, ...]] = {}
    for policy, given in BEFORE.items():
        for arm in ARMS:
            old, new = score(arm, policy, given, effort), score(arm, policy, {}, effort)
            errors = 1e3 * old.position, 1e3 * new.position, 1e3 * old.orientation, 1e3 * new.orientation
            rows[f"{policy}, {arm}"] = (*errors, old.cost, new.cost, new.cost / old.cost)
    return Table(
        "defaults",
        "Solvers whose defaults depend on the arm's size",
        f"{conditions} Errors are medians of the largest of each episode. Before: "
        + "; ".join(f"{policy} with {name}={value:g}" for policy, one in BEFORE.items() for name, value in one.items())
        + ".",
        (
            Column("position_before", "position before", "mm"),
            Column("position_after", "after", "mm"),
            Column("orientation_before", "orientation before", "mrad"),
            Column("orientation_after", "after", "mrad"),
            Column("cost_before", "cost before"),
            Column("cost_after", "after"),
            Column("ratio", "after / before"),
        ),
        rows,
    )


def _grid(policy: str, parameter: str, values: list[tuple[str, float]], effort: Effort) -> Table:
    """Costs by arm and parameter, over the least in the row; a length counts in units of the default."""
    rows: dict[str, tuple[float | None, ...]] = {}
    for arm in ARMS:
        unit = 1.0
        if parameter == "length":
            unit = baselines.make(policy, scenario(arm, 2 * effort.steps)).parameters[parameter]
        costs = [score(arm, policy, {parameter: unit * value}, effort).cost for _, value in values]
        rows[f"{arm}, {length(ikgym.arms.get(arm)):.1f} m"] = tuple(cost / min(costs) for cost in costs)
    return Table(
        f"defaults_{policy}",
        f"Cost of {policy} by its {parameter}" + (" in units of the default" if parameter == "length" else ""),
        "Conditions as in the first table of defaults; costs over the least in the row.",
        tuple(Column(f"at_{value:g}", label) for label, value in values),
        rows,
    )
