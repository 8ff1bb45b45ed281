"""Varga 2021: what is claimed, and how it is tested."""

from __future__ import annotations

import numpy as np

from baselines.papers.paper import Claim, Finding, rms, verdict
from baselines.papers.runs import Runs
from baselines.papers.varga.episodes import FAST, METHOD, PRINTED, fast, fluctuation, slow, smooth
from baselines.status import Status


def _printed_step(runs: Runs) -> Finding:
    episode = runs.play(FAST, METHOD, **PRINTED)
    share = float((episode.status == Status.DIVERGED).mean())
    worst = float(episode.position_error.max())
    return verdict(
        share == 0.0,
        f"{100 * share:.0f} % of the steps diverged, largest position error {worst:.2g} m",
        share_diverged=share,
        largest_position_error_m=worst,
    )


def _limit_reached(runs: Runs) -> Finding:
    """In both readings of the arm, and with both bounds of α."""
    shares = {
        f"{name}, α up to {alpha}": float((runs.play(name, METHOD, alpha_max=float(alpha)).iterations == 450).mean())
        for name in (FAST, "varga7-literal-fast")
        for alpha in ("1e-4", "5e-4")
    }
    evidence = "; ".join(f"{label}: {100 * share:.1f} %" for label, share in shares.items())
    return verdict(max(shares.values()) > 0.5, evidence, **shares)


def _offline(runs: Runs) -> Finding:
    millis = 1e-6 * fast(runs).time_ns
    p50, late = float(np.median(millis)), float((millis > 1.0).mean())
    return verdict(
        p50 > 1.0,
        f"median {p50:.2f} ms a step, {100 * late:.1f} % of the steps took longer than the 1 ms of the grid",
        median_time_ms=p50,
        share_over_1_ms=late,
    )


def _lagrange(runs: Runs) -> Finding:
    """Like with like: both with finite differences, both with analytic gradients."""
    ratios = {}
    for gradient in ("finite_difference", "analytic"):
        reduced = runs.play(FAST, "rhc_lagrange", gradient=gradient)
        plain = runs.play(FAST, METHOD, gradient=gradient)
        ratios[gradient] = float(np.median(reduced.time_ns) / np.median(plain.time_ns))
    return verdict(
        min(ratios.values()) > 1.1,
        f"median time with multipliers over that without: {ratios['finite_difference']:.2f} with finite differences, "
        f"where a state's difference touches one grid point only, {ratios['analytic']:.2f} with analytic gradients",
        **ratios,
    )


def _slow_is_finer(runs: Runs) -> Finding:
    a, b = float(fast(runs).position_error.max()), float(slow(runs).position_error.max())
    return verdict(
        b < a,
        f"largest position error {1e3 * a:.1f} mm fast, {1e3 * b:.2f} mm slow",
        fast_m=a,
        slow_m=b,
    )


def _slow_fluctuates(runs: Runs) -> Finding:
    a, b = (fluctuation(e.qdot) / rms(e.qdot) for e in (fast(runs), slow(runs)))
    return verdict(
        b > a,
        f"root mean square of the second differences over that of the velocities: {a:.2e} fast, {b:.2e} slow",
        fast=a,
        slow=b,
    )


def _other_joints(runs: Runs) -> Finding:
    path = runs.scenario(FAST).nominal_joint_path()
    apart = 0.0 if path is None else float(np.abs(fast(runs).q - path[1:]).max())
    return verdict(apart > 0.05, f"they separate by up to {apart:.2f} rad or m", largest_separation=apart)


def _acceptable(runs: Runs) -> Finding:
    episode = fast(runs)
    p, o = float(episode.position_error.max()), float(episode.orientation_error.max())
    return Finding(
        "not testable",
        f"no number is given; here the largest errors are {1e3 * p:.0f} mm, {p / 5.5:.1%} of the arm, and {o:.2f} rad",
        {"largest_position_error_m": p, "largest_orientation_error_rad": o},
    )


def _bounded(runs: Runs) -> Finding:
    method, inverse = float(np.abs(fast(runs).qdot).max()), runs.play(FAST, "moore_penrose")
    other = float(np.abs(inverse.qdot).max())
    return verdict(
        method < other,
        f"peak {method:.1f} rad/s against {other:.1f} rad/s of the pseudoinverse, which is the velocity limit",
        peak=method,
        peak_pseudoinverse=other,
    )


def _smoother(runs: Runs) -> Finding:
    a, b = fluctuation(fast(runs).qdot), fluctuation(smooth(runs).qdot)
    return verdict(
        b < a,
        f"root mean square of the second differences of the velocities {a:.2e} before, {b:.2e} after",
        before=a,
        after=b,
    )


def _smoothing_errs(runs: Runs) -> Finding:
    a, b = float(fast(runs).position_error.max()), float(smooth(runs).position_error.max())
    return verdict(
        b > a, f"largest position error {1e3 * a:.1f} mm before, {1e3 * b:.1f} mm after", before_m=a, after_m=b
    )


CLAIMS = (
    Claim(
        "printed step",
        "The descent with α between 1e-8 and 5e-4 solves the fast task.",
        "section IV",
        "`varga7-fast`, `rhc_gradient` with `alpha_max=5e-4`: steps that blew up",
        _printed_step,
    ),
    Claim(
        "limit reached",
        "In most of the time the maximal number of 450 steps was reached.",
        "section IV, fig. 6",
        "share of control steps with 450 descent steps",
        _limit_reached,
    ),
    Claim(
        "offline only",
        "Each step takes around 1 s; the method is mainly for offline applications.",
        "section IV, fig. 6; section VI",
        "wall time of each call of the compiled method, finite differences as in the paper",
        _offline,
    ),
    Claim(
        "multipliers cost more",
        "Without Lagrange multipliers and reduced gradient the solution is considerably less complex.",
        "abstract",
        "median time of a call of `rhc_lagrange` beside `rhc_gradient`",
        _lagrange,
    ),
    Claim(
        "acceptable precision",
        "A relatively fast motion is tracked with acceptable precision.",
        "section IV, fig. 2 and 3",
        "largest errors on `varga7-fast`",
        _acceptable,
    ),
    Claim(
        "slow is finer",
        "A much slower motion is tracked more precisely.",
        "section IV, fig. 7 and 8",
        "largest position errors on `varga7-fast` and `varga7-slow`",
        _slow_is_finer,
    ),
    Claim(
        "slow fluctuates",
        "With the slow motion more significant fluctuations of the joint velocities occur.",
        "section IV, fig. 10",
        "second differences relative to the velocities, slow and fast",
        _slow_fluctuates,
    ),
    Claim(
        "other joint paths",
        "Nominal and actual joint paths differ: the solution is ambiguous, and an optimal one was chosen.",
        "section IV, fig. 4",
        "largest distance of the joint coordinates from the nominal ones",
        _other_joints,
    ),
    Claim(
        "velocities bounded",
        "Penalties for high joint velocities handle singularities better than the pseudoinverse.",
        "abstract, section III",
        "peak joint velocity beside that of `moore_penrose`",
        _bounded,
    ),
    Claim(
        "smoothing calms",
        "Second-order smoothing significantly reduces the fluctuation of the joint velocities.",
        "section V, fig. 11",
        "second differences with and without the wrapper `smoothed`, Λ = 300 / s",
        _smoother,
    ),
    Claim(
        "smoothing errs",
        "With smoothed trajectories the tracking error is significantly higher.",
        "section V, fig. 13 and 14",
        "largest position errors with and without the wrapper",
        _smoothing_errs,
    ),
)
