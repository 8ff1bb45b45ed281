"""Zhang 2020, section V: what is claimed of the time that an inverse takes."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.zhang.comparing import CHANGE, change
from baselines.papers.zhang.episodes import LINE
from ikgym.validation import FloatArray

PERIOD = 1e3  # of the robot, in [µs]
ITERATIONS = 10  # most of one period, as printed for n = 2
#: How many times as long an industrial computer of 2020 may have taken as the core that this runs on.
OLDER = 10.0


def interpreted_inverse(matrix: list[list[float]]) -> list[list[float]]:
    """The inverse of a positive definite matrix by Gauss and Jordan, in plain Python: no operation is compiled."""
    n = len(matrix)
    rows = [[*row, *(float(i == k) for k in range(n))] for i, row in enumerate(matrix)]
    for i in range(n):
        pivot = rows[i][i]
        rows[i] = top = [value / pivot for value in rows[i]]
        for k in range(n):
            if k != i:
                factor = rows[k][i]
                rows[k] = [value - factor * above for value, above in zip(rows[k], top, strict=True)]
    return [row[n:] for row in rows]


def _micros(work: Callable[[], object], times: int) -> float:
    """The median time of a call in [µs]."""
    spent = []
    with threadpool_limits(limits=1):
        for _ in range(times):
            begin = time.perf_counter_ns()
            work()
            spent.append(1e-3 * (time.perf_counter_ns() - begin))
    return float(np.median(spent))


def _printed_matrix(runs: Runs) -> FloatArray:
    """Ψ̄ᵀ Ψ̄ + λ̄ for n = 3 at the start of example 2, with one J."""
    scenario = runs.scenario(LINE)
    start = np.zeros(6) if scenario.start is None else scenario.start
    whole = np.kron(np.tril(np.ones((3, 3))), scenario.model.jacobian(start))
    return np.asarray(whole.T @ whole + 1e-3 * np.eye(18))


def _large_inverse(runs: Runs) -> Finding:
    numbers = {"horizon": 3, "iterations": ITERATIONS, "tolerance": 0.0, "rule": "constant", "damping": 1e-3}
    blocks = 1e-3 * float(np.median(runs.play(LINE, "mfapc", **numbers).time_ns))
    matrix = _printed_matrix(runs)
    rows, whole = matrix.tolist(), np.tile(matrix, (ITERATIONS, 1, 1))
    once, compiled = (_micros(lambda m=m: np.linalg.inv(m), 1000) for m in (matrix, whole))  # type: ignore[misc]
    single = _micros(lambda: interpreted_inverse(rows), 50)
    return verdict_by_condition(
        {"compiled": OLDER * once > PERIOD, "interpreted": ITERATIONS * single > PERIOD},
        f"times (median) compiled: {once:.0f} µs one inverse, {compiled:.0f} µs the ten of a period, {blocks:.0f} µs "
        f"all of `predict` by blocks, which needs none; interpreted: {1e-3 * single:.2g} ms one inverse, "
        f"{1e-3 * ITERATIONS * single:.2g} ms the ten of a period",
        compiled_one_us=once,
        compiled_ten_us=compiled,
        blocks_us=blocks,
        interpreted_one_us=single,
    )


def _lighter(runs: Runs) -> Finding:
    common = {"iterations": ITERATIONS, "tolerance": 0.0, "rule": "constant"}
    large = runs.play(LINE, "mfapc", horizon=3, damping=1e-3, **common)
    small = runs.play(LINE, "mfapc", horizon=2, damping=0.0, **common)
    a, b = (float(np.median(e.time_ns)) * 1e-3 for e in (large, small))
    return verdict(
        change(a, b) <= -CHANGE,
        f"median times of 10 iterations: {b:.0f} µs with n = 2 and λ = 0, {a:.0f} µs with n = 3 and λ > 0",
        small_us=b,
        large_us=a,
    )


CLAIMS = (
    Claim(
        "18 × 18",
        "With n = 3 the inverse of 18 × 18 numbers does not fit into the period of 1 ms.",
        "section V, example 2, part B",
        "wall times on one core of another machine than the paper's: the inverse compiled (NumPy) and interpreted "
        "(plain Python), once and for each of 10 iterations. Compiled it fits if one takes less than 0.1 ms, since a "
        "computer of 2020 may be ten times as slow; interpreted it does not fit if ten take more than 1 ms even here",
        _large_inverse,
    ),
    Claim(
        "n = 2, λ = 0",
        "n = 2 with λ = 0 reduces the amount of calculation.",
        "section V, example 2, eq. 59",
        "wall time of `mfapc` on `zhang6-lspb`, 10 iterations each, 10 % less",
        _lighter,
    ),
)
