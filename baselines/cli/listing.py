"""Arms, scenarios and policies as text: all in a table, or one in full."""

from __future__ import annotations

import dataclasses
import inspect
import re
import textwrap
from collections.abc import Callable, Sequence
from typing import Annotated

import numpy as np
import tyro

from baselines import registry
from baselines.cli import shell
from ikgym import arms, scenarios
from ikgym.arms import Arm
from ikgym.exceptions import UnknownNameError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


@dataclasses.dataclass(frozen=True)
class Names:
    """Arguments of a list."""

    names: Annotated[tyro.conf.Positional[tuple[str, ...]], tyro.conf.arg(metavar="NAME …")] = ()
    """Names to show in full, or files: .urdf for arms, .toml for scenarios. The list if left out."""


@dataclasses.dataclass(frozen=True)
class Catalogue:
    """A registry for printing.

    Args:
        kind: The word for a member.
        names: Gives the names of all members.
        head: Heads of the columns; the last column fills the line.
        row: The other cells of a member's line.
        full: The full description of a member.
        ending: Suffix of files that are shown in full like members; none if empty.
    """

    kind: str
    names: Callable[[], Sequence[str]]
    head: tuple[str, ...]
    row: Callable[[str], tuple[str, ...]]
    full: Callable[[str], str]
    ending: str = ""

    def knows(self, name: str) -> bool:
        """Whether there is such a member, or the name is that of a file."""
        return name in self.names() or bool(self.ending and name.endswith(self.ending))


def main(word: str, catalogue: Catalogue, arguments: Sequence[str]) -> int:
    """Prints a catalogue, or some of its members in full.

    Args:
        word: The command.
        catalogue: The catalogue.
        arguments: Names, or options.
    """
    prog = f"{shell.CONSOLE} {word}"
    options = shell.parse(Names, arguments, prog=prog, description=f"Lists the {word}, or shows some in full.")
    print(shown(catalogue, options.names, shell.width()))
    return 0


def shown(catalogue: Catalogue, names: Sequence[str], width: int) -> str:
    """The table of a catalogue, or some of its members in full.

    Args:
        catalogue: The catalogue.
        names: Names or files to show in full; none for the table.
        width: Characters of a line.

    Raises:
        UnknownNameError: There is no such member; the message has the nearest name.
        InvalidInputError: A file cannot be read.
        MissingDependencyError: A URDF file is to be read, and Pinocchio is not installed.
    """
    known = catalogue.names()
    for name in names:
        if not catalogue.knows(name):
            raise UnknownNameError(catalogue.kind, name, known)
    if names:
        return "\n\n".join(_refilled(catalogue.full(name), width) for name in names)
    return aligned([catalogue.head, *((name, *catalogue.row(name)) for name in known)], width)


def aligned(rows: Sequence[Sequence[str]], width: int) -> str:
    """A table whose first row is the head, its last column wrapped to fit.

    Args:
        rows: Cells, the same number in each row.
        width: Characters of a line.
    """
    sizes = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)]
    start = sum(sizes) + 2 * len(sizes)
    lines = []
    for row in rows:
        wrapped = textwrap.wrap(row[-1], max(width - start, 16), break_on_hyphens=False) or [""]
        cells = "  ".join(f"{cell:{size}}" for cell, size in zip(row[:-1], sizes, strict=True))
        lines += [f"{cells}  {wrapped[0]}".rstrip(), *(" " * start + line for line in wrapped[1:])]
    return "\n".join([*lines[:1], "-" * min(max(map(len, lines)), width), *lines[1:]])


def _arm_row(name: str) -> tuple[str, ...]:
    arm = arms.get(name)
    return str(arm.joints), str(sum(arm.prismatic)), ", ".join(kinds_of_limits(arm)) or "none"


def kinds_of_limits(arm: Arm) -> list[str]:
    """The kinds of limits of an arm."""
    ends = np.concatenate([arm.lower, arm.upper])
    kinds = {"joints": ends, "velocity": arm.velocity_limit, "acceleration": arm.acceleration_limit}
    return [kind for kind, values in kinds.items() if np.isfinite(values).any()]


def _arm(name: str) -> str:
    arm = arms.from_urdf(name) if name.endswith(ARMS.ending) else arms.get(name)
    rows: list[tuple[str, ...]] = [("joint", "kind", "lower", "upper", "velocity limit", "acceleration limit")]
    numbers = zip(arm.prismatic, arm.lower, arm.upper, arm.velocity_limit, arm.acceleration_limit, strict=True)
    for joint, (prismatic, *limits) in enumerate(numbers, 1):
        unit = "m" if prismatic else "rad"
        units = unit, unit, f"{unit}/s", f"{unit}/s²"
        cells = [f"{value:.4g} {ending}" for value, ending in zip(limits, units, strict=True)]
        rows.append((str(joint), "prismatic" if prismatic else "revolute", *cells))
    tool = _numbers(arm.forward(np.zeros(arm.joints))[1])
    home = "none stated" if arm.home is None else f"({_numbers(arm.home)}) rad or m"
    title = f"{name}: {arm.joints} joints, tool at ({tool}) m where q = 0, home posture {home}"
    return f"{title}\n\n{aligned(rows, 80)}"


def _numbers(values: Sequence[float] | FloatArray) -> str:
    return ", ".join(f"{x:.4g}" for x in np.round(np.array(values), 9) + 0.0)


def _scenario_row(name: str) -> tuple[str, ...]:
    scenario = scenarios.get(name)
    return scenario.arm.name, scenario.task.name, f"{scenario.steps}", scenario.source


def _scenario(name: str) -> str:
    scenario = scenarios.find(name)
    lines = [f"{scenario.name}: {scenario.steps} steps of {scenario.dt:g} s", ""]
    lines += [scenario.source, ""] if scenario.source else []
    return "\n".join([*lines, *(f"  {key:16} {value}" for key, value in _parts(scenario).items())])


def _parts(scenario: Scenario) -> dict[str, object]:
    limit = np.unique(scenario.velocity_limit)
    return {
        "arm": scenario.arm.name,
        "nominal model": scenario.model.name,
        "task": scenario.task.name,
        "trajectory": type(scenario.trajectory).__name__,
        "random": "yes, by the seed" if scenario.random else "no",
        "velocity limit": f"{', '.join(f'{x:g}' for x in limit)} rad/s or m/s",
        "cost": scenario.cost,
    } | _path(scenario)


def _path(scenario: Scenario) -> dict[str, object]:
    """Duration of a path in space, and whether the arm can reach it."""
    if scenario.random or scenario.trajectory.joint_path(np.zeros(1)) is not None:
        return {}
    out: dict[str, object] = {}
    if (duration := getattr(scenario.trajectory, "duration", None)) is not None:  # some go on for ever
        out["path takes"] = f"{duration:.3g} s, the episode {scenario.steps * scenario.dt:.3g} s"
    return out | {"within reach": _reach(scenario)}


def _reach(scenario: Scenario) -> str:
    """The poses of a path that the arm cannot reach."""
    missed = scenarios.gaps(scenario)
    if not missed:
        return "all sampled poses"
    worst = max(missed, key=lambda gap: (gap.distance, gap.angle))
    first, last = (f"{gap.time:.3g} s" for gap in (missed[0], missed[-1]))
    far = f"{worst.distance:.3g} m and {worst.angle:.3g} rad"
    return f"not all poses: missed from {first} to {last}, at ({_numbers(worst.position)}) m by {far}"


def _policy_row(name: str) -> tuple[str, ...]:
    return (summary(name) + (" Reference." if registry.get(name).reference else ""),)


def summary(name: str) -> str:
    """The first sentence about a policy."""
    return " ".join(_plain(registry.get(name).__doc__ or "").split("\n\n")[0].split())


def _policy(name: str) -> str:
    policy = registry.get(name)
    fields = policy.__dataclass_fields__
    given = [(p, fields[p].default, fields[p].default_factory) for p in policy.parameter_names()]
    parameters = [
        f"  {p} = {default!r}" if made is dataclasses.MISSING else f"  {p} = {made()!r}" for p, default, made in given
    ]
    title = f"{name}{' (reference)' if policy.reference else ''}: {policy.__module__}.{policy.__qualname__}"
    return "\n".join([title, "", _plain(inspect.getdoc(policy) or ""), "", "Defaults:", *(parameters or ["  none"])])


def _plain(text: str) -> str:
    """A docstring without the roles of Sphinx, policies by their names."""
    known = {registry.get(name).__name__: name for name in registry.names()}
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", lambda m: f"`{known.get(m[1], m[1])}`", text)
    return text.replace("``", "`")


def _refilled(text: str, width: int) -> str:
    """A text with its paragraphs and items filled to the width."""
    parts: list[str] = []
    for line in text.splitlines():
        item = re.match(r" *- | {0,4}\w+:( |$)| *\w.*?  |  \w+ = ", line)
        if not line.strip() or item or not (parts and parts[-1]):
            parts.append(line.rstrip())
        else:
            parts[-1] += f" {line.strip()}"
    return "\n".join(_filled(part, width) for part in parts)


def _filled(part: str, width: int) -> str:
    indent = len(part) - len(part.lstrip())
    hanging = indent + 2 if part.lstrip().startswith("- ") else indent + 4 if indent else 0
    return textwrap.fill(part, width, subsequent_indent=" " * hanging, break_on_hyphens=False)


ARMS = Catalogue("arm", arms.names, ("arm", "joints", "prismatic", "limits"), _arm_row, _arm, ".urdf")
SCENARIOS = Catalogue(
    "scenario",
    lambda: (*scenarios.names(), *scenarios.problems_from_elsewhere()),
    ("scenario", "arm", "task", "steps", "source"),
    _scenario_row,
    _scenario,
    ".toml",
)
POLICIES = Catalogue("policy", registry.names, ("policy", "what it does"), _policy_row, _policy)
