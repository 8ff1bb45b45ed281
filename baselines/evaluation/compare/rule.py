"""The rule that recommends a solver for a path, from measured rows."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping

from baselines.evaluation.columns import number
from baselines.evaluation.metrics import Row

#: Solvers in the order in which they are preferred.
PREFERRED = ("qp", "sns", "rhc_foresight", "dls", "pink", "mink")
#: Share of the control period that the median call may take. Its 99th percentile, on a computer without real time, is
#: that of other programs.
SHARE = 0.5
#: How many times the least joint acceleration of a solver counts as calm, and how many times the smallest product of
#: error and acceleration counts as equally good.
CALM, ALIKE = 3.0, 2.0
#: The rule in one sentence.
RULE = (
    "Of the solvers that follow (with late drives too, if any does) and accelerate at most "
    f"{CALM:g} times as much as the calmest, the one with the smallest product of largest error and largest "
    f"acceleration is recommended; up to {ALIKE:g} times that product, the first in the order {', '.join(PREFERRED)}."
)

#: One row a solver, by its name.
Rows = Mapping[str, Row]


@dataclasses.dataclass(frozen=True)
class Recommendation:
    """A solver for a path."""

    solver: str | None  # its name; None where no solver follows the path
    retimed: bool  # whether it follows the retimed path alone
    late: bool  # whether it follows with late drives, too
    reason: str  # why this one

    def __str__(self) -> str:
        if self.solver is None:
            return f"Recommended: none of these solvers. {self.reason}"
        path = " on the retimed path, which ikgym path --retime writes" * self.retimed
        return f"Recommended: {self.solver}{path}. {self.reason}"


def fault(row: Row, dt: float) -> str:
    """Why the solver of a row does not follow a path with the control period dt in [s]; empty where it does."""
    if not row.followed:
        turned = row.orientation_error_max
        return f"errs by {1e3 * row.position_error_max:.3g} mm" + (f", {1e3 * turned:.3g} mrad" if turned else "")
    if row.steps_at_joint_limit:
        return "has a joint at a stop"
    if row.time_p50_us is not None and row.time_p50_us > SHARE * 1e6 * dt:
        return f"takes {row.time_p50_us:.0f} µs a call of a period of {1e6 * dt:.0f} µs"
    return ""


def followers(rows: Rows, dt: float) -> list[str]:
    """The solvers that follow, the preferred first."""
    return [name for name in PREFERRED if name in rows and not fault(rows[name], dt)]


def needs_retiming(as_it_is: Rows, retimed: Rows, dt: float) -> bool:
    """Whether no solver follows the path as it is, and one does retimed."""
    return not followers(as_it_is, dt) and bool(followers(retimed, dt))


def recommend(as_it_is: Rows, retimed: Rows, late: Rows, dt: float) -> Recommendation:
    """The solver to take.

    1. The path is taken as it is if a solver follows it, else retimed.
    2. Of the solvers that follow it, those are kept that follow with late drives, if any do.
    3. Of these, those are kept whose largest joint acceleration is at most three times the least.
    4. Of these, those are kept whose product of largest error and largest joint acceleration is at most twice the
       smallest. The error counts in [mm] or [mrad], whichever is larger.
    5. Of these, the first is taken in the order of :data:`PREFERRED`.

    Args:
        as_it_is: Rows on the path as it is.
        retimed: Rows on the retimed path; empty where there is none.
        late: Rows with late drives.
        dt: The control period in [s].
    """
    slower = needs_retiming(as_it_is, retimed, dt)
    rows = retimed if slower else as_it_is
    able = followers(rows, dt)
    missed = f"No solver follows the path{' as it is' * slower}: {_first_fault(as_it_is, dt)}."
    if not able:
        return Recommendation(None, False, False, missed)
    robust = [name for name in able if name in followers(late, dt)]
    kept = robust or able
    least = min(rows[name].qddot_peak for name in kept)
    calm = [name for name in kept if rows[name].qddot_peak <= CALM * least]
    best = min(_product(rows[name]) for name in calm)
    solver = next(name for name in calm if _product(rows[name]) <= ALIKE * best)
    before = [name for name in PREFERRED[: PREFERRED.index(solver)] if name in rows]
    also = "with late drives too" if robust else "but not with late drives"
    reasons = [
        *[missed] * slower,
        *(f"{name} {_drawback(name, rows, late if robust else {}, dt, least, solver)}." for name in before),
        f"{solver} follows the path, {also}.",
    ]
    return Recommendation(solver, slower, bool(robust), " ".join(reasons))


def _product(row: Row) -> float:
    """Largest error in [mm] or [mrad], whichever is larger, times largest joint acceleration."""
    return 1e3 * max(row.position_error_max, row.orientation_error_max or 0.0) * row.qddot_peak


def _drawback(name: str, rows: Rows, late: Rows, dt: float, least: float, solver: str) -> str:
    """Why a solver was passed over."""
    if why := fault(rows[name], dt):
        return why
    if name in late and (why := fault(late[name], dt)):
        return f"{why} with late drives"
    if rows[name].qddot_peak > CALM * least:
        return f"needs {number(rows[name].qddot_peak / least)} times the acceleration of the calmest"
    times = number(_product(rows[name]) / _product(rows[solver])) if _product(rows[solver]) else "many"
    return f"has {times} times the product of error and acceleration"


def _first_fault(rows: Rows, dt: float) -> str:
    name = next(name for name in PREFERRED if name in rows)
    return f"{name} {fault(rows[name], dt)}"
