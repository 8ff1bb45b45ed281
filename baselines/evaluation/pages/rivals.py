"""The page of rivals: solvers of other projects beside ours on the paths of real arms, errors, limits and times."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib.metadata
from collections.abc import Iterator, Sequence

from baselines import registry
from baselines.evaluation.pages.entries import FORESIGHT, Entry, first_seed, solver
from baselines.evaluation.pages.markdown import conditions, table, time
from baselines.evaluation.pages.measurement import Line, Measurement, Section
from baselines.evaluation.report import NOTHING, number
from baselines.solvers.rivals.base import Rival
from ikgym import scenarios

#: Who of ours is compared, as far as it is registered.
OURS = ("dls", "null_space", "weighted_pseudoinverse", "qp", "sns", "rhc", FORESIGHT)
#: Who the times and the errors of the others are stated relative to.
BASIS = "pink"
#: What a quick trial plays.
QUICK_SETS = ("panda-line", "tiago-line")
#: Errors below this, in [m], count as none where errors are compared: float32 actions leave a tenth of it.
ROUNDING = 1e-6

INTRODUCTION = f"""\
Solvers of other projects beside ours, as policies like all others: the same scenarios, the same limits in the plant,
one run on one machine. Each is handed the model as a file and its limits, and asked at each step for the pose of the
next. [How they are set](#settings) follows their documentation. Written by
`python -m baselines.leaderboard --pages rivals`, see [conditions](#conditions); everything below is worked out from
what was measured, which lies in [rivals.json](rivals.json).

- **position, orientation**: the largest distance from the reference pose in the episode, and the largest angle to it;
  of the tool's axis alone where the task is `axis`.
- **stop, velocity, acceleration**: steps in which that limit of the arm held a joint back, so that it moved otherwise
  than commanded. A solver that keeps the limits has none.
- **no solution**: steps in which the solver found no joint velocities, and the arm was stopped.
- **p50, p99**: time of a call of `predict`, without the first. **× {BASIS}** is p50 relative to that of `{BASIS}`.
- Of the others `roboticstoolbox` knows no limits; `mink` and `ssik` know those of position and velocity; `pink` knows
  those of acceleration, too, where an arm has them: of these arms the Panda. `ssik` has no arm with a prismatic joint,
  no tool axis without an angle about it, and holds one coordinate of the self-motion, on the Panda joint 6.
- On the paths `turn`, `edge` and `fast` a stop, the reach or the speed of the joints stands in the way. There an error
  of position can be paid for by one of orientation, and solvers weigh the two differently.
"""


def entries() -> tuple[Entry, ...]:
    """Who is compared: ours, then theirs.

    Raises:
        MissingDependencyError: The package of a rival is not installed.
    """
    known = registry.names()
    return tuple(map(_entry, (*(name for name in OURS if name in known), *_installed())))


def versions() -> dict[str, str]:
    """The versions of the rivals' packages that are installed, and of the solvers of their programs."""
    found = {}
    for name in (*(kind.distribution for kind in _rivals().values()), "daqp", "quadprog"):
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    return found


def page(measurement: Measurement) -> str:
    """The page as Markdown."""
    out = ["# Solvers of other projects", "", INTRODUCTION, "## In short", "", *_short(measurement), ""]
    for one in measurement.sections:
        out += [f"## {one.name}", "", *_table(one), ""]
    return "\n".join([*out, *_settings(), "", *conditions(measurement)]) + "\n"


def _rivals() -> dict[str, type[Rival]]:
    classes = {name: registry.get(name) for name in registry.names()}
    return {name: kind for name, kind in classes.items() if issubclass(kind, Rival)}


def _installed() -> Iterator[str]:
    """The rivals, each of which has to be there."""
    for name, kind in _rivals().items():
        kind.imported()
        yield name


def _entry(name: str) -> Entry:
    """One seed is enough: paths are the same at every reset."""
    return first_seed(solver(name, timed=1))


def _short(measurement: Measurement) -> list[str]:
    """A line a policy: the paths that it tracks best, limits that it ran into, and its time."""
    head = ["policy", "paths", f"position within {1e6 * ROUNDING:g} µm or 5 % of the smallest", "no limit hit"]
    lines = []
    for name in dict.fromkeys(line.name for one in measurement.sections for line in one.lines):
        played = [(one, line) for one in measurement.sections for line in one.lines if line.name == name]
        best = sum(_error(line) <= max(ROUNDING, 1.05 * min(map(_error, one.lines))) for one, line in played)
        clean = sum(not any(line.held or ()) for _, line in played)
        slower = [ratio for one, line in played if (ratio := _slower(one, line)) is not None]
        cells = [f"`{name}`", str(len(played)), str(best), str(clean)]
        lines.append([*cells, f"{sorted(slower)[len(slower) // 2]:.2g}" if slower else NOTHING])
    return table([*head, f"p50 × {BASIS}, median"], lines, text=(0,))


def _table(one: Section) -> list[str]:
    scenario = scenarios.get(one.name)
    head = ["policy", "position [mm]", "orientation [rad]", "stop", "velocity", "acceleration", "no solution"]
    head += ["p50 [µs]", "p99 [µs]", f"× {BASIS}"]
    lines = [_cells(one, line) for line in sorted(one.lines, key=_error)]
    about = f"{scenario.steps:,} steps of {1e3 * scenario.dt:g} ms, task `{scenario.task.name}`."
    return [about, "", *table(head, lines, text=(0,))]


def _cells(one: Section, line: Line) -> Sequence[str]:
    angle = NOTHING if line.angle is None else number(line.angle[0][0])
    held = [NOTHING if steps is None else str(steps) for steps in (*(line.held or 3 * (None,)), line.unsolved)]
    slower = _slower(one, line)
    relative = NOTHING if slower is None else f"{slower:.2g}"
    name, error = f"`{line.name}`", number(1e3 * _error(line))
    return [name, error, angle, *held, time(line.time_p50_us), time(line.time_p99_us), relative]


def _error(line: Line) -> float:
    return line.error[0][0] if line.error is not None else float("inf")


def _slower(one: Section, line: Line) -> float | None:
    """The median time relative to that of the basis; None where one of them has none."""
    basis = next((other.time_p50_us for other in one.lines if other.name == BASIS), None)
    return line.time_p50_us / basis if basis and line.time_p50_us else None


def _settings() -> list[str]:
    """What each rival is made with."""
    lines = []
    for name, kind in _rivals().items():
        policy = {f.name: f.default for f in dataclasses.fields(kind) if f.name in kind.parameter_names()}
        lines.append([f"`{name}`", f"`{kind.distribution}`", ", ".join(f"`{k} = {v!r}`" for k, v in policy.items())])
    return ["## Settings", "", *table(["policy", "package", "parameters"], lines, text=(0, 1, 2))]
