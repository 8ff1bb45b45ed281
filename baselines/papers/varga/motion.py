"""Varga 2021: tests of what is said of the motion: its precision, its fluctuation, and the skew part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from baselines.papers.paper import Finding, rms, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.varga.episodes import (
    CONSIDERABLE,
    FAST,
    KEPT,
    METHOD,
    MORE,
    SLOW,
    fast,
    fluctuation,
    largest_jump,
    nominal_path,
    slow,
    smooth,
    variation,
    without_start,
)
from ikgym.validation import FloatArray


def acceptable(runs: Runs) -> Finding:
    """No number is given."""
    episode = fast(runs)
    p, o = float(episode.position_error.max()), float(episode.orientation_error.max())
    extent = float(np.ptp(runs.scenario(FAST).nominal()[:, 3:], axis=0).max())
    return Finding(
        "not testable",
        f"no number is given; here the largest errors are {1e3 * p:.0f} mm, {p / extent:.1%} of the largest extent of "
        f"the path, and {o:.2f} rad",
        {"largest_position_error_m": p, "largest_orientation_error_rad": o},
    )


def slow_is_finer(runs: Runs) -> Finding:
    """Position errors."""
    a, b = float(fast(runs).position_error.max()), float(slow(runs).position_error.max())
    return verdict(
        MORE * b <= a,
        f"largest position error {1e3 * a:.1f} mm fast, {1e3 * b:.2f} mm slow",
        fast_m=a,
        slow_m=b,
    )


def fast_fluctuates(runs: Runs) -> Finding:
    """α restarted as printed, and kept with the smaller bound."""
    nominal = fluctuation(np.diff(nominal_path(runs, FAST), axis=0) / runs.scenario(FAST).dt)
    episodes = {"α restarted": fast(runs), "α kept, up to 1e-4": runs.play(FAST, METHOD, **KEPT)}
    jumps = {label: largest_jump(episode.qdot) for label, episode in episodes.items()}
    rough = {label: fluctuation(episode.qdot) for label, episode in episodes.items()}
    a, b = rough.values()
    evidence = "; ".join(f"{label}: {jumps[label]:.0%} of the peak, {rough[label]:.2g}" for label in episodes)
    return verdict_by_condition(
        {label: jump > 0.1 for label, jump in jumps.items()},
        f"largest change in a step, and root mean square of the second differences: {evidence}, {a / b:.0f} times "
        f"less; of the nominal velocities {nominal:.2g}",
        **jumps,
        nominal=nominal,
    )


def _fluctuations(qdot: FloatArray) -> dict[str, float]:
    """How much joint velocities fluctuate, by measure."""
    velocities = without_start(qdot)
    bends, size = np.abs(np.diff(velocities, 2, axis=0)), rms(velocities)
    return {
        "root mean square": rms(bends),
        "root mean square, relative": rms(bends) / size,
        "median, relative": float(np.median(bends)) / size,
    }


def slow_fluctuates(runs: Runs) -> Finding:
    """In absolute and in relative measures, with α restarted and kept."""
    found: list[str] = []
    holds: dict[str, bool] = {}
    readings: dict[str, dict[str, Any]] = {"α restarted": {}, "α kept, up to 1e-4": KEPT}
    for label, parameters in readings.items():
        a, b = (_fluctuations(runs.play(name, METHOD, **parameters).qdot) for name in (FAST, SLOW))
        holds |= {f"{label}, {measure}": b[measure] > MORE * a[measure] for measure in a}
        found.append(f"{label}: " + "; ".join(f"{measure} {a[measure]:.2g} → {b[measure]:.2g}" for measure in a))
    return verdict_by_condition(
        holds,
        f"second differences of the velocities, fast → slow: {'. '.join(found)}. More: {_which(holds)}",
        holds=holds,
    )


def _which(holds: Mapping[str, bool]) -> str:
    """The conditions under which something holds."""
    return "; ".join(label for label, held in holds.items() if held) or "nowhere"


def other_joints(runs: Runs) -> Finding:
    """Distance from the nominal joint path."""
    apart = float(np.abs(fast(runs).q - nominal_path(runs, FAST)[1:]).max())
    return verdict(apart > 0.05, f"they separate by up to {apart:.2f} rad or m", largest_separation=apart)


def bounded(runs: Runs) -> Finding:
    """Peak velocities."""
    method, inverse = float(np.abs(fast(runs).qdot).max()), runs.play(FAST, "moore_penrose")
    other = float(np.abs(inverse.qdot).max())
    return verdict(
        MORE * method <= other,
        f"peak {method:.1f} rad/s against {other:.1f} rad/s of the pseudoinverse, which is the velocity limit",
        peak=method,
        peak_pseudoinverse=other,
    )


def smoother(runs: Runs) -> Finding:
    """By second differences and by total variation, with α restarted and kept."""
    kept = runs.play(FAST, METHOD, **KEPT), runs.play(FAST, "smoothed", policy=METHOD, options=KEPT)
    found: list[str] = []
    holds: dict[str, bool] = {}
    for label, (before, after) in {"α restarted": (fast(runs), smooth(runs)), "α kept, up to 1e-4": kept}.items():
        a, b = fluctuation(before.qdot), fluctuation(after.qdot)
        c, d = variation(before.qdot), variation(after.qdot)
        holds |= {f"{label}, second differences": a >= CONSIDERABLE * b, f"{label}, variation": c >= CONSIDERABLE * d}
        found.append(f"{label}: second differences {a:.2e} → {b:.2e}, total variation {c:.1f} → {d:.1f}")
    return verdict_by_condition(holds, f"{'; '.join(found)}. Significantly less: {_which(holds)}", holds=holds)


def smoothing_errs(runs: Runs) -> Finding:
    """Position errors."""
    a, b = float(fast(runs).position_error.max()), float(smooth(runs).position_error.max())
    return verdict(
        b >= CONSIDERABLE * a,
        f"largest position error {1e3 * a:.1f} mm before, {1e3 * b:.1f} mm after",
        before_m=a,
        after_m=b,
    )


def skew_determines(runs: Runs) -> Finding:
    """The skew part is that of eq. 8, sin θ times the axis: the same for θ and π − θ, which are |π − 2θ| apart."""
    angles = {name: _nominal_angles(runs, name) for name in (FAST, SLOW)}
    shares = {name: float((angle > 0.5 * np.pi).mean()) for name, angle in angles.items()}
    largest = {name: float(angle.max()) for name, angle in angles.items()}
    return verdict(
        max(shares.values()) == 0.0,
        f"`{FAST}` is beyond 90° for {shares[FAST]:.0%} of the time, up to {largest[FAST]:.2f} rad, where a rotation "
        f"{abs(np.pi - 2.0 * largest[FAST]):.2f} rad away has the same skew part; `{SLOW}` for {shares[SLOW]:.0%}, up "
        f"to {largest[SLOW]:.2f} rad",
        shares=shares,
        largest_angle_rad=largest,
    )


def _nominal_angles(runs: Runs, name: str) -> FloatArray:
    """Angles from home of the orientations on the nominal path, in [rad]. Shape (k,)."""
    rotations, _ = runs.scenario(name).arm.forward(nominal_path(runs, name))
    skew = 0.5 * (rotations - np.swapaxes(rotations, 1, 2))[:, (0, 0, 1), (1, 2, 2)]
    sine, cosine = np.linalg.norm(skew, axis=1), 0.5 * (np.trace(rotations, axis1=1, axis2=2) - 1.0)
    return np.asarray(np.arctan2(sine, cosine))
