"""Solvers on a path as it is, retimed, and with late drives, in one table."""

from __future__ import annotations

import dataclasses
import textwrap
import time
from collections.abc import Iterable, Sequence

import numpy as np

import ikgym
from baselines import registry
from baselines.controller.drives import PREDICTED, SETTINGS
from baselines.evaluation import report
from baselines.evaluation.columns import COLUMNS, ERRORS, TIMES, Column
from baselines.evaluation.compare.rule import PREFERRED, RULE, Recommendation, Rows, fault, needs_retiming, recommend
from baselines.evaluation.metrics import Row
from baselines.evaluation.run import evaluate
from baselines.evaluation.summary import summarise
from baselines.evaluation.table import plain
from baselines.paths import retime
from baselines.paths.late import describe_drives, late
from baselines.paths.survey import RESERVE, describe_reserve
from baselines.solvers.rivals.base import Rival
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Names of the paths in tables.
AS_IT_IS, RETIMED, LATE = "as it is", "retimed", "late drives"
#: Remark on the times of solvers of other projects.
LIBRARY = "p50, p99 of pink and mink: calls of the library alone; with late drives all calls of the controller"
#: Steps in which such a library is timed alone, without the checks and conversions of its policy.
STEPS = 500


@dataclasses.dataclass(frozen=True, eq=False)
class Comparison:
    """Results of solvers on a path."""

    dt: float  # the control period in [s]
    rows: Sequence[Row]  # rows of all solvers, path by path
    recommendation: Recommendation  # the solver to take
    notes: Sequence[str]  # further remarks
    drives: str  # the late drives

    def table(self, width: int = report.WIDTH) -> str:
        """Table, notes and recommendation as plain text; columns that decide nothing are left out if too wide."""
        lines = summarise(self.rows).assign(  # one row a line
            label=[solver_of(row) for row in self.rows],
            follows=["no" if fault(row, self.dt) else "yes" for row in self.rows],
        )
        table, _ = plain(SHOWN, lines, width)
        texts = [
            f"{LATE}: {self.drives}; each solver as in baselines.Controller",
            *[LIBRARY] * any(registry.get(row.policy).rival for row in self.rows),
        ]
        below = [textwrap.fill(text, width, subsequent_indent="  ") for text in (*texts, *self.notes, RULE)]
        last = textwrap.fill(str(self.recommendation), width)
        return "\n".join([table, "", *below, "", last])


def solver_of(row: Row) -> str:
    """The solver of a row, also of one with late drives."""
    return str(row.parameters["policy"] if row.policy == PREDICTED else row.policy)


SHOWN = (
    Column("label", "solver", format=str),
    Column("scenario", "path", format=str),
    *(COLUMNS[key] for key in ERRORS[:3]),
    dataclasses.replace(COLUMNS["qddot_peak"], drop=0),  # decides
    dataclasses.replace(COLUMNS["steps_at_joint_limit"], unit="[steps]"),
    *(COLUMNS[key] for key in TIMES[:2]),
    Column("follows", "follows", format=str),
)


def compare(scenario: Scenario, *, reserve: float = RESERVE, progress: bool = False) -> Comparison:
    """Plays solvers on a path, and recommends one by :func:`baselines.evaluation.compare.rule.recommend`.

    Args:
        scenario: A scenario whose path is the same at every reset.
        reserve: As for :func:`baselines.paths.survey`, where the path is retimed.
        progress: Whether to show bars on stderr.

    Raises:
        InvalidInputError: The path is random, or no solver suits the scenario.
    """
    if scenario.random:
        raise InvalidInputError(f"Expected a path that is the same at every reset, got scenario {scenario.name!r}.")
    stated = np.isfinite(scenario.arm.acceleration_limit).all()
    notes = [] if stated else [f"{report.STATED_NOTE}; --acceleration states limits"]
    paths = [scenario.replace(name=AS_IT_IS), *_retime(scenario, reserve, notes)]
    played = evaluate(paths, PREFERRED, progress=progress)
    notes += [f"left out: {one.policy}: {one.reason}" for one in played.skipped if one.scenario == AS_IT_IS]
    rows = [*played]
    for path in paths:
        rows = [with_library_times(row, path) if row.scenario == path.name else row for row in rows]
    as_it_is, retimed = (_by_solver(rows, name) for name in (AS_IT_IS, RETIMED))
    taken = paths[needs_retiming(as_it_is, retimed, scenario.dt)]
    driven = taken.replace(name=LATE, plant=late(scenario.plant))
    delayed = evaluate(driven, [(PREDICTED, {"policy": name, **SETTINGS}) for name in as_it_is], progress=progress)
    chosen = recommend(as_it_is, retimed, _by_solver(delayed, LATE), scenario.dt)
    return Comparison(scenario.dt, [*rows, *delayed], chosen, notes, describe_drives(scenario.plant))


def _retime(scenario: Scenario, reserve: float, notes: list[str]) -> list[Scenario]:
    """The path in a time in which it can be driven, if there is one; a note says in which, or why there is none."""
    try:
        found = retime(scenario, reserve=reserve)
    except (InvalidInputError, ModuleNotFoundError) as error:
        notes.append(f"not retimed: {error}")
        return []
    asked = f"in {found.duration:.4g} s where {found.asked:.4g} s were asked for"
    notes.append(f"retimed: from the best start, {asked}{describe_reserve(reserve)}")
    return [found.scenario.replace(name=RETIMED)]


def _by_solver(rows: Iterable[Row], path: str) -> Rows:
    return {solver_of(row): row for row in rows if row.scenario == path}


def with_library_times(row: Row, scenario: Scenario) -> Row:
    """The row with the median and the 99th percentile of the library's calls; other rows as they are."""
    policy = registry.make(row.policy, scenario, **row.parameters)
    if not isinstance(policy, Rival):
        return row
    spent = 1e6 * library_times(policy, scenario, STEPS)
    return dataclasses.replace(
        row, **dict(zip(("time_p50_us", "time_p99_us"), np.percentile(spent, (50, 99)), strict=True))
    )


def library_times(policy: Rival, scenario: Scenario, steps: int) -> FloatArray:
    """Durations in [s] of the library's calls in the first steps of an episode. Shape (k,)."""
    env = ikgym.RedundantIKEnv(scenario, preview=1)
    (observation, _), call = env.reset(seed=0), policy.make_step()
    start, spent = observation["q"].copy(), np.empty(min(steps, scenario.steps))
    for k in range(len(spent)):
        q, qdot, pose, nominal = (observation[key] for key in ("q", "qdot", "pose", "nominal"))
        seen = policy.target(q, qdot, start, pose, nominal[0])
        begin = time.perf_counter()
        found = call(seen)
        spent[k] = time.perf_counter() - begin
        wanted = np.zeros(len(q)) if found is None else found / scenario.velocity_limit
        observation, *_ = env.step(np.clip(wanted, -1.0, 1.0).astype(np.float32))
    return spent
