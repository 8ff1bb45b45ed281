"""Zhang 2020, section V: what is claimed of the two examples."""

from __future__ import annotations

import time

import numpy as np
from threadpoolctl import threadpool_limits

from baselines.papers.paper import Claim, Finding, verdict
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import HELIX, LINE, constant, iterative, lambdas_used, predictive, settled_from
from baselines.solvers.levenberg_marquardt.mfapc import EXAMPLE_2
from baselines.status import Status
from ikgym.rotations import rodrigues, rotation_vector

SWITCH = 33  # the sample at which λ turns, as printed


def _switch(runs: Runs) -> Finding:
    lambdas = lambdas_used(predictive(runs))
    turn = int(lambdas.argmax()) + 1
    return verdict(
        turn == SWITCH, f"λ turns at k = {turn}, at {lambdas.max():.2f} m²", sample=turn, lambda_m2=float(lambdas.max())
    )


def _up_and_down(runs: Runs) -> Finding:
    change = np.diff(lambdas_used(predictive(runs)))
    turns = int((np.diff(np.sign(change)) != 0.0).sum())
    return verdict(
        turns == 1 and change[0] > 0.0,
        f"{int((change > 0.0).sum())} samples up, then {int((change < 0.0).sum())} down, {turns} turn between them",
        turns=turns,
    )


def _poor_start(runs: Runs) -> Finding:
    error = predictive(runs).position_error
    start = min(8, len(error) // 2)
    first, later = float(error[:start].max()), float(error[settled_from(predictive(runs)) :].max())
    return verdict(
        first > later,
        f"errors up to {first:.1f} m in the first {start} samples, {1e3 * later:.0f} mm after the transient",
        first_m=first,
        later_m=later,
    )


def _faster(runs: Runs) -> Finding:
    free = predictive(runs)
    peak = float(lambdas_used(free).max())
    held = constant(runs, HELIX, round(peak, 4), 5)
    a, b = (float(e.position_error[settled_from(e) :].max()) for e in (held, free))
    return verdict(
        b < a,
        f"largest error after the transient {1e3 * b:.1f} mm, {1e3 * a:.1f} mm with λ held at {peak:.2f} m²",
        falling_m=b,
        held_m=a,
    )


def _excellent(runs: Runs) -> Finding:
    helix, line = predictive(runs).position_error, iterative(runs)
    settled = float(helix[settled_from(predictive(runs)) :].max())
    p, o = float(line.position_error.max()), float(line.orientation_error.max())
    return Finding(
        "not testable",
        f"no number is given; here {1e3 * settled:.0f} mm on the helix of radius 3 m, {p:.1g} m and {o:.1g} rad on the "
        "line, the model being exact",
        {"helix_m": settled, "line_m": p, "line_rad": o},
    )


def _heavy(runs: Runs) -> Finding:
    numbers = {"horizon": 3, "iterations": 10, "tolerance": 0.0, "rule": "constant", "damping": 1e-3}
    micros = 1e-3 * runs.play(LINE, "mfapc", **numbers).time_ns
    p50, p99 = float(np.median(micros)), float(np.percentile(micros, 99))
    scenario = runs.scenario(LINE)
    start = np.zeros(6) if scenario.start is None else scenario.start
    whole = np.kron(np.tril(np.ones((3, 3))), scenario.model.jacobian(start))
    matrix, spent = whole.T @ whole + 1e-3 * np.eye(18), []
    with threadpool_limits(limits=1):
        for _ in range(1000):
            begin = time.perf_counter_ns()
            np.linalg.inv(matrix)
            spent.append(1e-3 * (time.perf_counter_ns() - begin))
    dense = float(np.median(spent))
    return verdict(
        dense > 1e3,
        f"times: NumPy inverts 18 × 18 in {dense:.0f} µs (median); all of `predict`, 10 iterations by blocks, takes "
        f"{p50:.0f} µs (median), {p99:.0f} µs (99th percentile)",
        dense_inverse_us=dense,
        predict_p50_us=p50,
        predict_p99_us=p99,
    )


def _lighter(runs: Runs) -> Finding:
    common = {"iterations": 10, "tolerance": 0.0, "rule": "constant"}
    large = runs.play(LINE, "mfapc", horizon=3, damping=1e-3, **common)
    small = runs.play(LINE, "mfapc", horizon=2, damping=0.0, **common)
    a, b = (float(np.median(e.time_ns)) * 1e-3 for e in (large, small))
    return verdict(
        b < a,
        f"median times of 10 iterations: {b:.0f} µs with n = 2 and λ = 0, {a:.0f} µs with n = 3 and λ > 0",
        small_us=b,
        large_us=a,
    )


def _within_ten(runs: Runs) -> Finding:
    episode = iterative(runs, stop="first_point")
    met, most = float((episode.status == Status.CONVERGED).mean()), int(episode.iterations.max())
    return verdict(
        met == 1.0 and most <= 10,
        f"{100 * met:.0f} % of the points met to δ = 1e-10, in {most} iterations at most",
        share_met=met,
        most_iterations=most,
    )


def _horizon_met(runs: Runs) -> Finding:
    episode = iterative(runs)
    limit = float((episode.status == Status.ITERATION_LIMIT).mean())
    patient = runs.play(LINE, "mfapc", **{**EXAMPLE_2, "iterations": 100})
    still = float((patient.status == Status.ITERATION_LIMIT).mean())
    return verdict(
        limit == 0.0,
        f"(40) is unmet after 10 iterations in {100 * limit:.1f} % of the samples, after 100 in {100 * still:.1f} %: "
        "once the first point is met, the second is but to the second order of the way in one period",
        share_after_10=limit,
        share_after_100=still,
    )


def _printed_angle(runs: Runs) -> Finding:
    """Like (51)-(54), from the product of two rotations about the same axis."""
    del runs
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    wrong: dict[str, float] = {}
    right: dict[str, float] = {}
    for angle in (1e-2, 1e-4, 1e-6, 1e-8):
        d = rodrigues(axis, 1.0 + angle) @ rodrigues(axis, 1.0).T
        with np.errstate(invalid="ignore", divide="ignore"):
            theta = np.arccos((np.trace(d) - 1.0) / 2.0)
            printed = (
                np.array([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / (2.0 * np.sin(theta)) * theta
            )
        for errors, vector in ((wrong, printed), (right, rotation_vector(d))):
            error = float(np.linalg.norm(vector - angle * axis) / angle)
            errors[f"{angle:.0e} rad"] = error if np.isfinite(error) else 1.0
    lost = [angle for angle, error in wrong.items() if error > 1e-6]
    best = max(error for angle, error in right.items() if angle in lost) if lost else 0.0
    return verdict(
        not lost,
        f"more than the sixth digit is wrong or no number comes out at {', '.join(lost)}; the atan2 form used here is "
        f"right to {'the sixth' if best < 1e-6 else 'no sixth'} digit there",
        **{f"printed at {angle}": error for angle, error in wrong.items()},
    )


CLAIMS = (
    Claim(
        "switch at 33",
        "The error falls below 10 at k = 33, and λ turns there.",
        "section V, example 1, fig. 3",
        "`zhang3-helix`, `mfapc` with the numbers of example 1: sample of the largest λ",
        _switch,
    ),
    Claim(
        "up, then down",
        "λ increases at first, and decreases from one sample on.",
        "section V, example 1, fig. 3",
        "signs of the changes of λ",
        _up_and_down,
    ),
    Claim(
        "poor start",
        "The tracking is poor at first, as the initial values violate the kinematics.",
        "section V, example 1, fig. 2",
        "largest errors at the start and after the transient",
        _poor_start,
    ),
    Claim(
        "falling λ",
        "The falling λ accelerates the convergence of the tracking error.",
        "section V, example 1",
        "largest error after the transient beside that with λ held at its peak",
        _faster,
    ),
    Claim(
        "excellent",
        "MFAPC shows an excellent control performance.",
        "abstract; section VI",
        "largest errors of both examples",
        _excellent,
    ),
    Claim(
        "18 × 18",
        "With n = 3 the inverse of 18 × 18 numbers does not fit into the period of 1 ms.",
        "section V, example 2, part B",
        "wall time here, on one core of another machine than the paper's: the inverse alone, and `mfapc` with n = 3 "
        "and λ > 0 on `zhang6-lspb`",
        _heavy,
    ),
    Claim(
        "n = 2, λ = 0",
        "n = 2 with λ = 0 reduces the amount of calculation.",
        "section V, example 2, eq. 59",
        "wall time of `mfapc` on `zhang6-lspb`, 10 iterations each",
        _lighter,
    ),
    Claim(
        "ten iterations",
        "Iterative MFAPC with n = 2 and λ = 0 tracks the line with at most 10 iterations a period.",
        "section V, example 2, fig. 6, 7 and 9",
        '`zhang6-lspb`, `mfapc` with `stop="first_point"`: share of the points met and iterations',
        _within_ten,
    ),
    Claim(
        "whole horizon",
        "The iteration finds the minimum of the error of the whole horizon, which ends it.",
        "section IV C, eq. 40; section V, example 2, part A",
        "`zhang6-lspb`, `mfapc` as printed: share of the samples at which δ = 1e-10 was not reached",
        _horizon_met,
    ),
    Claim(
        "printed angle",
        "The rotation between two orientations follows from (52)–(54).",
        "section V, example 2, eq. 52–54",
        "rotations of 1e-2 to 1e-8 rad, which δ = 1e-10 asks for",
        _printed_angle,
    ),
)
