"""Varga 2021: tests of what is said of the descent, of its steps and of the time that it takes."""

from __future__ import annotations

import time

import numpy as np

from baselines.episodes import Episode
from baselines.papers.paper import Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.varga.episodes import (
    CONSIDERABLE,
    FAST,
    LITERAL,
    METHOD,
    MORE,
    READINGS,
    at_limit,
    diverged,
    fast,
)
from baselines.papers.varga.interpreted import descend

_INTERPRETED_STEPS = 15


def _all_readings(runs: Runs) -> dict[str, Episode]:
    """Both readings of the arm with all of the descent."""
    return {
        f"`{name}`, {', '.join(reading.values())}": runs.play(name, METHOD, **reading)
        for name in (FAST, LITERAL)
        for reading in READINGS
    }


def printed_step(runs: Runs) -> Finding:
    """Which readings blow up with the printed bounds of α."""
    shares = {label: diverged(episode) for label, episode in _all_readings(runs).items()}
    episode = fast(runs)
    cost = float((episode.tracking_cost + episode.velocity_cost).sum())
    evidence = "; ".join(f"{label}: {100 * share:.0f} %" for label, share in shares.items())
    return verdict_by_condition(
        {label: share == 0.0 for label, share in shares.items()},
        f"share of the steps that blew up: {evidence}. The first has a total cost of {cost:.4g} and errors up to "
        f"{1e3 * episode.position_error.max():.0f} mm",
        total_cost=cost,
        **shares,
    )


def limit_reached(runs: Runs) -> Finding:
    """In all readings."""
    shares = {label: at_limit(episode) for label, episode in _all_readings(runs).items()}
    evidence = "; ".join(f"{label}: {100 * share:.1f} %" for label, share in shares.items())
    return verdict_by_condition({label: share > 0.5 for label, share in shares.items()}, evidence, **shares)


def offline(runs: Runs) -> Finding:
    """As the descent stops, with all its steps, and interpreted."""
    start = Runs(min(runs.steps or 100, 100))
    episodes = {
        "compiled, steps until the stop test": fast(runs),
        "compiled, 450 steps": start.play(FAST, METHOD, tolerance=0.0),
        "compiled, 450 steps with analytic gradients": start.play(FAST, METHOD, tolerance=0.0, gradient="analytic"),
    }
    times = {label: 1e-6 * float(np.median(episode.time_ns)) for label, episode in episodes.items()}
    times["450 times a step interpreted with NumPy"] = 1e3 * _interpreted(runs) * 450
    late = float((fast(runs).time_ns > 1e6).mean())
    evidence = "; ".join(f"{label}: {ms:.2g} ms" for label, ms in times.items())
    return verdict_by_condition(
        {label: ms > 1.0 for label, ms in times.items()},
        f"median time of a control step {evidence}. Of the first, with {np.median(fast(runs).iterations):.0f} steps "
        f"in the median, {100 * late:.0f} % took longer than 1 ms",
        share_over_1_ms=late,
        **times,
    )


def _interpreted(runs: Runs) -> float:
    """Time of one step of the interpreted descent in [s]; all steps cost the same."""
    scenario = runs.scenario(FAST)
    q, nominal = np.zeros(scenario.joints), scenario.nominal()[1:3]  # the path starts at home
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        descend(scenario, q, nominal, _INTERPRETED_STEPS)
        times.append(time.perf_counter() - begin)
    return min(times) / _INTERPRETED_STEPS


def time_proportional(runs: Runs) -> Finding:
    """Time per gradient of the calls with the fewest and with the most steps; one more gradient than steps is made."""
    episode = fast(runs)
    gradients = episode.iterations + 1.0
    micros = 1e-3 * episode.time_ns / gradients
    few, many = np.percentile(gradients, (10, 90))
    a, b = (float(np.median(micros[part])) for part in (gradients <= few, gradients >= many))
    return verdict(
        max(a, b) < MORE * min(a, b),
        f"median time per gradient {a:.1f} µs in the tenth of the calls with the fewest, up to {few:.0f}, and "
        f"{b:.1f} µs in that with the most, from {many:.0f} on",
        few_us=a,
        many_us=b,
    )


def lagrange(runs: Runs) -> Finding:
    """Like with like: finite differences beside finite differences, analytic gradients beside analytic ones."""
    ratios = {}
    for gradient in ("finite_difference", "analytic"):
        plain = runs.play(FAST, METHOD, gradient=gradient)
        for states, label in ((True, "X kept as unknowns"), (False, "X eliminated")):
            reduced = runs.play(FAST, "rhc_lagrange", gradient=gradient, states=states)
            ratio = float(np.median(reduced.time_ns) / np.median(plain.time_ns))
            ratios[f"{label}, {gradient.replace('_', ' ')}"] = ratio
    evidence = "; ".join(f"{label}: {ratio:.2f}" for label, ratio in ratios.items())
    return verdict_by_condition(
        {label: ratio >= CONSIDERABLE for label, ratio in ratios.items()},
        f"median time with multipliers over that without: {evidence}. With X eliminated, the system of the multipliers "
        "is constant and tridiagonal, and a difference touches one grid point only",
        **ratios,
    )
