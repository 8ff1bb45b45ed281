"""The command ``ikgym scenarios``."""

from __future__ import annotations

import re
import textwrap

import numpy as np

from baselines.cli import shell
from baselines.cli.own_path import describe_bodies
from ikgym import scenarios
from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.scenarios.scenario import duration


def _scenario_row(name: str) -> tuple[str, ...]:
    scenario = scenarios.get(name)
    return scenario.arm.name, scenario.task.name, f"{scenario.steps}", scenario.source


def _scenario(name: str, _: shell.Names) -> str:
    scenario = scenarios.find(name)
    lines = [f"{scenario.name}: {scenario.steps} steps of {scenario.dt:g} s", ""]
    lines += [textwrap.fill(scenario.source, shell.width()), ""] if scenario.source else []
    for key, value in _parts(scenario).items():
        lines.append(textwrap.fill(f"  {key:16} {value}", shell.width(), subsequent_indent=19 * " "))
    return "\n".join(lines)


def _parts(scenario: Scenario) -> dict[str, object]:
    limit = np.unique(scenario.velocity_limit)
    return (
        {
            "arm": f"{scenario.arm.name}: {', '.join(scenario.arm.joint_names)}",
            "nominal model": scenario.model.name,
            "task": scenario.task.name,
            "trajectory": type(scenario.trajectory).__name__,
            "random": "yes, by the seed" if scenario.random else "no",
            "velocity limit": f"{', '.join(f'{x:g}' for x in limit)} rad/s or m/s",
            "accelerations": _accelerations(scenario.arm),
            "cost": scenario.cost,
        }
        | _bodies(scenario)
        | _path(scenario)
    )


def _bodies(scenario: Scenario) -> dict[str, object]:
    """The bodies of the arm, and the obstacles, a line for each kind; nothing where there are none."""
    bodies, kinds = scenario.arm.bodies, dict[str, list[str]]()
    for one in scenario.obstacles:
        kind = re.sub("(?<=[a-z])(?=[A-Z])", " ", type(one).__name__).lower()
        kinds.setdefault(kind, []).append(f"{one.name} (moves)" if one.motion is not None else one.name)
    if not len(bodies) and not kinds and not bodies.unseen:
        return {}
    count = "an arm that touches something is stopped" if scenario.collides else "do not count"
    arm = {"bodies": describe_bodies(scenario.arm)} if len(bodies) or bodies.unseen else {}
    near = {} if scenario.proximity is None else {"proximity": scenario.proximity}
    return {**arm, **{kind: ", ".join(names) for kind, names in kinds.items()}, "collisions": count, **near}


def _accelerations(arm: Arm) -> str:
    """The limits of acceleration, and the joints that have none."""
    without = [name for name, one in zip(arm.joint_names, arm.acceleration_limit, strict=True) if not np.isfinite(one)]
    if len(without) == arm.joints:
        return "no limit stated"
    stated = ", ".join(f"{x:g}" for x in np.unique(arm.acceleration_limit) if np.isfinite(x))
    return f"{stated} rad/s² or m/s²" + (f"; no limit stated for {', '.join(without)}" if without else "")


def _path(scenario: Scenario) -> dict[str, object]:
    """Duration of a path in space, and whether the arm can reach it."""
    if scenario.random or scenario.trajectory.joint_path(np.zeros(1)) is not None:
        return {}
    out: dict[str, object] = {}
    if (time := duration(scenario.trajectory)) is not None:
        cut = f": {scenario.cut_off:.3g} s are cut off" if scenario.cut_off else ""
        out["path takes"] = f"{time:.3g} s, the episode {scenario.steps * scenario.dt:.3g} s{cut}"
    return out | {"poses in reach": _reach(scenario)}


def _reach(scenario: Scenario) -> str:
    """The poses of a path that the arm cannot reach, wherever it comes from."""
    missed = scenarios.gaps(scenario)
    if not missed:
        return f"all, taken one by one; {shell.CONSOLE} path follows them from the start"
    worst = max(missed, key=lambda gap: (gap.distance, gap.angle))
    first, last = (f"{gap.time:.3g} s" for gap in (missed[0], missed[-1]))
    far = f"{worst.distance:.3g} m and {worst.angle:.3g} rad"
    return f"not all: missed from {first} to {last}, at ({shell.numbers(worst.position)}) m by {far}"


main = shell.list_command(
    "scenarios",
    "scenario",
    lambda: (*scenarios.names(), *scenarios.problems_from_elsewhere()),
    (("arm", "task", "steps", "source"), _scenario_row),
    _scenario,
    endings=(".toml",),
)
