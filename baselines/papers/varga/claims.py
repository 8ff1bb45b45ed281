"""Varga 2021: the tests of the claims in ``claims.toml``, each function named after its claim."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from baselines.episodes import Episode
from baselines.papers.comparisons import CONSIDERABLY, above, larger, largest_error, peak_speed, rms
from baselines.papers.paper import Figures, Finding, in_unit
from baselines.papers.runs import Runs, nominal_joints
from baselines.papers.varga.episodes import (
    ALPHAS,
    FAST,
    KEPT,
    LITERAL,
    METHOD,
    READINGS,
    SLOW,
    at_limit,
    fast,
    fluctuation,
    largest_jump,
    nominal_angles,
    share_diverged,
    slow,
    smooth,
    time_of_step,
    variation,
    without_start,
)
from baselines.papers.varga.interpreted import descend
from ikgym.validation import FloatArray


def _all_readings(runs: Runs) -> dict[str, Episode]:
    """The episodes of both readings of the arm and all four readings of the descent."""
    return {
        ", ".join([arm, *reading.values()]): runs.play(name, METHOD, **reading)
        for arm, name in (("varga7", FAST), ("literal", LITERAL))
        for reading in READINGS
    }


def _by_arm(shares: dict[str, float]) -> Figures:
    """Shares by the reading of the arm; α restarted, unshifted and shifted, then α kept."""
    arms = ("varga7", "literal")
    return in_unit({arm: [share for label, share in shares.items() if label.startswith(arm)] for arm in arms}, "%")


def printed_step(runs: Runs) -> Finding:
    """Share of the steps that diverge with the printed bounds of α, in all readings."""
    shares = {label: share_diverged(episode) for label, episode in _all_readings(runs).items()}
    return Finding({label: share == 0.0 for label, share in shares.items()}, _by_arm(shares))


def limit_reached(runs: Runs) -> Finding:
    """Share of the steps with all 450 iterations, in all readings."""
    shares = {label: at_limit(episode) for label, episode in _all_readings(runs).items()}
    return Finding(above(shares, 0.5), _by_arm(shares))


def offline_only(runs: Runs) -> Finding:
    """Processor time of a step with the stop test, with all iterations, and interpreted."""
    descents: dict[str, dict[str, Any]] = {
        "with the stop test": {},
        "450 iterations": {"tolerance": 0.0},
        "analytic gradients": {"tolerance": 0.0, "gradient": "analytic"},
    }
    times = {label: time_of_step(runs, **parameters) for label, parameters in descents.items()}
    times["in NumPy"] = _time_interpreted(runs) * 450
    return Finding(above(times, 1e-3), in_unit(times, "ms"))


def _time_interpreted(runs: Runs, iterations: int = 15) -> float:
    """Processor time of one iteration of the interpreted descent in [s]."""
    scenario = runs.scenario(FAST)
    q, nominal = np.zeros(scenario.joints), scenario.nominal()[1:3]  # the path starts at home
    times = []
    for _ in range(3):
        begin = time.thread_time()
        descend(scenario, q, nominal, iterations)
        times.append(time.thread_time() - begin)
    return min(times) / iterations


def time_proportional(runs: Runs) -> Finding:
    """Time per iteration in steps of 50 to 450 iterations."""
    numbers = (50, 150, 250, 350, 450)
    times = [time_of_step(runs, tolerance=0.0, iterations=number) / number for number in numbers]
    return Finding(not larger(max(times), min(times)), in_unit({"": times}, "µs"))


def multipliers_cost_more(runs: Runs) -> Finding:
    """Time of `rhc_lagrange` over that of `rhc_gradient`, with the same gradients."""
    ratios = {}
    for gradient in ("finite_difference", "analytic"):
        plain = runs.play(FAST, METHOD, gradient=gradient)
        for states, label in ((True, "X kept"), (False, "X eliminated")):
            reduced = runs.play(FAST, "rhc_lagrange", gradient=gradient, states=states)
            ratio = float(np.median(reduced.time_ns) / np.median(plain.time_ns))
            ratios[f"{label}, {gradient.replace('_', ' ')}"] = ratio
    return Finding({label: ratio >= CONSIDERABLY for label, ratio in ratios.items()}, ratios)


def acceptable_precision(runs: Runs) -> Finding:
    """Largest errors on the fast path."""
    episode = fast(runs)
    largest = largest_error(episode)
    extent = float(np.ptp(runs.scenario(FAST).nominal()[:, 3:], axis=0).max())
    figures = {"[mm]": 1e3 * largest, "of the extent [%]": 100.0 * largest / extent}
    return Finding(None, {**figures, "[rad]": float(episode.orientation_error.max())})


def slow_is_finer(runs: Runs) -> Finding:
    """Largest position errors on the fast and the slow path."""
    a, b = largest_error(fast(runs)), largest_error(slow(runs))
    return Finding(larger(a, b), in_unit({"fast": a, "slow": b}, "mm"))


def fast_fluctuates(runs: Runs) -> Finding:
    """Largest change of a velocity in one step over the peak."""
    jumps = {name: largest_jump(runs.play(FAST, METHOD, **alpha).qdot) for name, alpha in ALPHAS.items()}
    return Finding(above(jumps, 0.1), in_unit(jumps, "%"))


def _fluctuations(qdot: FloatArray) -> dict[str, float]:
    """Fluctuation of joint velocities in three measures."""
    velocities = without_start(qdot)
    differences, size = np.abs(np.diff(velocities, 2, axis=0)), rms(velocities)
    return {
        "RMS": rms(differences),
        "relative RMS": rms(differences) / size,
        "relative median": float(np.median(differences)) / size,
    }


def slow_fluctuates(runs: Runs) -> Finding:
    """Second differences on the fast and the slow path, in three measures."""
    holds: dict[str, bool] = {}
    figures: dict[str, list[float]] = {}
    for name, alpha in ALPHAS.items():
        a, b = (_fluctuations(runs.play(path, METHOD, **alpha).qdot) for path in (FAST, SLOW))
        for measure in a:
            holds[f"{name}, {measure}"] = larger(b[measure], a[measure])
            figures.setdefault(measure, []).extend((a[measure], b[measure]))
    return Finding(holds, figures)


def other_joint_paths(runs: Runs) -> Finding:
    """Largest distance of a joint coordinate from its nominal one."""
    apart = float(np.abs(fast(runs).q - nominal_joints(runs.scenario(FAST))).max())
    return Finding(apart > 0.05, {"[rad or m]": apart})


def velocities_bounded(runs: Runs) -> Finding:
    """Peak joint velocities of the method and of the pseudoinverse."""
    method, other = map(peak_speed, (fast(runs), runs.play(FAST, "moore_penrose")))
    return Finding(larger(other, method), {"method [rad/s]": method, "pseudoinverse [rad/s]": other})


def smoothing_calms(runs: Runs) -> Finding:
    """Fluctuation before and after smoothing, by second differences and by total variation."""
    kept = runs.play(FAST, METHOD, **KEPT), runs.play(FAST, "smoothed", policy=METHOD, options=KEPT)
    holds: dict[str, bool] = {}
    figures: dict[str, list[float]] = {}
    for label, (before, after) in {"restarted": (fast(runs), smooth(runs)), "kept": kept}.items():
        for name, measure in (("second differences", fluctuation), ("variation", variation)):
            a, b = measure(before.qdot), measure(after.qdot)
            holds[f"{label}, {name}"] = larger(a, b, CONSIDERABLY)
            figures.setdefault(name, []).extend((a, b))
    return Finding(holds, figures)


def smoothing_errs(runs: Runs) -> Finding:
    """Largest position errors before and after smoothing."""
    a, b = largest_error(fast(runs)), largest_error(smooth(runs))
    return Finding(larger(b, a, CONSIDERABLY), in_unit({"before": a, "after": b}, "mm"))


def skew_part_determines(runs: Runs) -> Finding:
    """Share of the nominal paths beyond 90°: the skew part is sin θ times the axis, the same for θ and π − θ."""
    angles = {name: nominal_angles(runs, path) for name, path in (("fast", FAST), ("slow", SLOW))}
    shares = {name: float((angle > 0.5 * np.pi).mean()) for name, angle in angles.items()}
    return Finding(max(shares.values()) == 0.0, in_unit(shares, "%"))
