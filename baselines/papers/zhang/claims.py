"""Zhang 2020: the tests of the claims in ``claims.toml``, each function named after its claim.

Those of sections IV and V are in :mod:`baselines.papers.zhang.predictive`.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

import numpy as np

from baselines.papers.comparisons import SAME, above, falls, larger, largest_error, peak_speed, rms
from baselines.papers.paper import Finding, in_unit
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import (
    HELIX,
    LINE,
    SHARES,
    SINGULAR,
    TARGETS,
    at_rest,
    constant,
    draw_targets,
    iterates,
    jacobians_used,
    of_link,
    predictive,
    ramp_errors,
    rank_correlation,
    settled_error,
    settled_from,
    share_met,
    sugihara,
)
from baselines.solvers.levenberg_marquardt.damping import typical_link
from baselines.status import Status
from ikgym import Plant
from ikgym.arms import Arm
from ikgym.scenarios import Scenario


def poles(runs: Runs) -> Finding:
    """Largest eigenvalue of (9), and of (29) for n = 5, with the Jacobians along example 1."""
    episode = predictive(runs)
    jacobians = jacobians_used(runs.scenario(HELIX), episode)[settled_from(episode) :]
    transposed = jacobians.transpose(0, 2, 1)
    whole = np.kron(np.tril(np.ones((5, 5))), np.ones((3, 3))) * np.tile(jacobians, (1, 5, 5))
    back = whole.transpose(0, 2, 1)
    largest: dict[str, list[float]] = {"MFAC": [], "MFAPC": []}
    for damping in (0.0, 0.2, 2.0, 20.0):
        gain = transposed @ np.linalg.inv(jacobians @ transposed + damping * np.eye(3))
        predictive_gain = np.linalg.solve(back @ whole + damping * np.eye(15), back @ np.tile(np.eye(3), (5, 1)))
        for name, k in (("MFAC", gain), ("MFAPC", predictive_gain[:, :3])):
            largest[name].append(float(np.abs(np.linalg.eigvals(np.eye(3) - jacobians @ k)).max()))
    return Finding(max(map(max, largest.values())) < 1.0, largest)


def error_grows_with_lambda(runs: Runs) -> Finding:
    """Largest error after the transient with constant λ."""
    errors = [settled_error(constant(runs, HELIX, damping)) for damping in (0.0, 0.2, 2.0, 20.0, 200.0)]
    return Finding(bool((np.diff(errors) > 0.0).all()), {"[m]": errors})


def large_lambda(runs: Runs) -> Finding:
    """Error at the last sample with λ = 2 and 200 m²."""
    small, large = (float(constant(runs, HELIX, damping).position_error[-1]) for damping in (2.0, 200.0))
    return Finding(large > small, {"[m]": (small, large)})


def static_error(runs: Runs) -> Finding:
    """Distance of the error on a ramp from eq. 10, as a share."""
    apart: dict[str, float] = {}
    for damping in (0.2, 2.0, 20.0):
        error, formula = ramp_errors(runs, 1e-3, damping)
        apart[f"λ = {damping:g}"] = float(np.linalg.norm(error - formula) / np.linalg.norm(formula))
    return Finding(max(apart.values()) < SAME, in_unit({"": list(apart.values())}, "%"))


def no_static_error(runs: Runs) -> Finding:
    """Order of the error in the velocity; the curvature of the kinematics leaves an error of the second order."""
    orders: dict[str, float] = {}
    for name, horizon in (("MFAC", 1), ("MFAPC", 5)):
        fast, slow = (float(np.linalg.norm(ramp_errors(runs, v, 0.0, horizon)[0])) for v in (1e-2, 1e-3))
        orders[name] = float(np.log10(fast / slow))
    return Finding(min(orders.values()) > 1.9, orders)


def _falls_with_lambda(values: Mapping[str, list[float]], unit: str, peaks: Mapping[str, list[float]]) -> Finding:
    """Whether values in a unit, and peak joint velocities, fall from each λ to the next."""
    pairs = {
        f"{name}, {i}": pair
        for name, by_lambda in {**values, **peaks}.items()
        for i, pair in enumerate(itertools.pairwise(by_lambda))
    }
    return Finding(falls(pairs), {**in_unit(values, unit), **in_unit(peaks, "rad/s")})


def robustness(runs: Runs) -> Finding:
    """Targets lost with a wrong model, and peak joint velocities near singular points, by λ."""

    def lost(share: float, links: float) -> float:
        return float((at_rest(runs, share, 0.1, links=links)[0][-1] >= SAME).mean())

    def peak(scenario: str, share: float) -> float:
        return peak_speed(constant(runs, scenario, of_link(runs, scenario, share)))

    values = {f"lost, links of {100 * links:.0f} %": [lost(s, links) for s in SHARES] for links in (0.45, 0.3)}
    places = {"start": HELIX, "shoulder": "faitli3-shoulder", "elbow": "faitli3-stretched"}
    peaks = {name: [peak(scenario, s) for s in SHARES] for name, scenario in places.items()}
    return _falls_with_lambda(values, "%", peaks)


def fastest_without_damping(runs: Runs) -> Finding:
    """Samples until the error stays below 1 %, by λ, and overshoot of λ = 0, for three distances."""
    holds: dict[str, bool] = {}
    figures: dict[str, float | list[float]] = {}
    undamped: list[float] = []
    for shift in (0.01, 0.1, 0.3):
        samples, overshoots = [], []
        for share in SHARES:
            errors, beyond = at_rest(runs, share, shift)
            outside = errors >= SAME
            last = len(errors) - outside[::-1].argmax(axis=0)
            samples.append(float(np.where(outside.any(axis=0), last, 0).mean()))
            overshoots.append(float(np.percentile(beyond.max(axis=0), 95)))
        holds[f"{shift:g} rad"] = samples[0] == min(samples) and overshoots[0] < SAME
        figures[f"{shift:g} rad:"] = samples
        undamped.append(100.0 * overshoots[0])
    return Finding(holds, figures | {"overshoot [%]": undamped})


def robustness_on_plants(runs: Runs) -> Finding:
    """Largest error in a loop with a delay, peak joint velocity with noise, by λ."""
    errors: dict[str, list[float]] = {}
    peaks: dict[str, list[float]] = {}
    plants = {
        "1 late": Plant(command_delay=1),
        "3 late": Plant(command_delay=3),
        "noise": Plant(pose_noise=1e-3, pose_rotation_noise=1e-3),
    }
    for name, plant in plants.items():
        scenario = runs.scenario(LINE).replace(name=f"{LINE} on a plant", plant=plant)
        dampings = [of_link(runs, LINE, share) for share in (*SHARES, 10.0)]
        episodes = [runs.play(scenario, "mfac", one_step=True, rule="constant", damping=d) for d in dampings]
        if plant.command_delay:
            errors[name] = [largest_error(episode) for episode in episodes]
        else:
            peaks[name] = [peak_speed(episode) for episode in episodes]
    return _falls_with_lambda(errors, "mm", peaks)


def model_free(runs: Runs) -> Finding:
    """Error with the exact model and on the worst of three arms for each calibration, by example and controller."""
    calibrations = {"fine": (5e-4, 3e-4), "coarse": (1e-2, 1e-2)}
    controllers: dict[str, dict[str, Any]] = {
        "(5)": {"one_step": True, "rule": "constant", "damping": 0.0},
        "(11)–(17)": {},
    }
    holds: dict[str, bool] = {}
    figures: dict[str, list[float]] = {}
    for (place, path), (controller, options) in itertools.product(
        (("helix", HELIX), ("line", LINE)), controllers.items()
    ):
        scenario, name = runs.scenario(path), f"{place}, {controller}"

        def error(arm: Arm, scenario: Scenario = scenario, options: dict[str, Any] = options) -> float:
            episode = runs.play(scenario.replace(arm=arm, model=scenario.model), "mfac", **options)
            return rms(episode.position_error[settled_from(episode) :])

        exact = error(scenario.arm)
        figures[name] = [exact]
        for which, (zero, link) in calibrations.items():
            source = scenario.replace(plant=Plant(zero=zero, link=link, axis=zero))
            wrong = [error(source.drawn_plant(seed).arm) for seed in range(3)]
            holds[f"{name}, {which}"] = not larger(max(wrong), exact)
            figures[name].append(max(wrong))
    return Finding(holds, in_unit(figures, "mm"))


def levenberg_marquardt(runs: Runs) -> Finding:
    """Largest distance of ten iterates from those of the normal equations."""
    apart = {}
    for name in TARGETS:
        targets = draw_targets(runs, name)
        damping = 1e-3 * typical_link(targets.scenario.arm) ** 2
        ours, theirs = iterates(targets, rule="sugihara", weight=1.0, damping=damping), sugihara(targets, damping)
        apart[name] = max(float(np.abs(a.q - b).max()) for a, b in zip(ours, theirs, strict=True))
    return Finding(max(apart.values()) < 1e-6, {"[rad]": max(apart.values())})


def _correlations(runs: Runs, name: str) -> tuple[float, float]:
    """Rank correlation of the error with the following change of J and with cond(J), until the error is rounding."""
    pairs = list(itertools.pairwise(iterates(draw_targets(runs, name))))
    error = np.concatenate([a.error for a, _ in pairs])
    change = np.concatenate([np.linalg.norm(b.jacobian - a.jacobian, axis=(1, 2)) for a, b in pairs])
    condition = np.concatenate([np.linalg.cond(a.jacobian) for a, _ in pairs])
    kept = error > 1e-9
    return rank_correlation(error[kept], change[kept]), rank_correlation(error[kept], condition[kept])


def error_and_change_of_j(runs: Runs) -> Finding:
    """Rank correlation from iteration to iteration."""
    found = {name: _correlations(runs, name)[0] for name in TARGETS}
    return Finding(min(found.values()) > 0.1, found)


def error_and_condition(runs: Runs) -> Finding:
    """Rank correlation from iteration to iteration, and along four paths."""
    found = {name: _correlations(runs, name)[1] for name in TARGETS}
    for name in (HELIX, LINE, *SINGULAR):
        scenario, episode = runs.scenario(name), constant(runs, name, of_link(runs, name, 1e-3))
        jacobians = scenario.model.jacobian(episode.q)[settled_from(episode) :, : scenario.task.error_size]
        error = np.hypot(episode.position_error, np.nan_to_num(episode.orientation_error))
        found[f"`{name}`"] = rank_correlation(error[settled_from(episode) :], np.linalg.cond(jacobians))
    return Finding(above(found, 0.1), found)


def _targets_met(runs: Runs, rules: Mapping[str, Mapping[str, Any]]) -> dict[str, list[float]]:
    """Shares of the targets that are met with λ = 0, and with each rule, by set of targets."""
    with_none = {"λ = 0": {"rule": "constant", "damping": 0.0}, **rules}
    return {targets: [share_met(runs, targets, rule)[0] for rule in with_none.values()] for targets in TARGETS}


def rule_14(runs: Runs) -> Finding:
    """Targets met with λ = 0, and with three pairs a₁, a₂: that of (44), the default here, and Marquardt's.

    With both λ₀, a pair meets no fewer by more than the standard error of 1000 targets, 0.5 %.
    """
    holds: dict[str, bool] = {}
    left: list[float] = []
    figures: dict[str, list[float]] = {}
    for a, b in ((1.1, 1.02), (2.0, 2.0), (10.0, 10.0)):
        numbers = {"rule": "error_ratio", "growth": a, "decay": b}
        rules = {f"{share}": {**numbers, "damping": share} for share in (0.1, 0.001)}
        found = _targets_met(runs, rules)
        holds[f"{a:g}, {b:g}"] = all(min(shares) >= shares[0] - 0.005 for shares in found.values())
        for targets, (undamped, *shares) in found.items():
            figures.setdefault(targets, [undamped]).append(min(shares))
        left.append(max(share_met(runs, "stretched", rule)[1] for rule in rules.values()))
    return Finding(holds, {**in_unit(figures, "%"), **in_unit({"left": left}, "µm")})


def rule_18(runs: Runs) -> Finding:
    """Targets met with λ = 0 and three choices of a₁ and a₂: of (44), with faster decay, the default of (14)."""
    rules = {
        f"{a}, {b}": {"rule": "threshold", "growth": a, "decay": b, "damping": 1e-3}
        for a, b in ((1.1, 1.02), (1.1, 1.2), (2.0, 2.0))
    }
    return Finding(None, in_unit(_targets_met(runs, rules), "%"))


def look_up(runs: Runs) -> Finding:
    """Targets met with λ = 0, with Table I and with (37), each also with milder values."""
    milder = ((0.0, 0.0, 0.0), (1e-8, 1e-6, 1e-4), (1e-6, 1e-4, 1e-3))
    rules: dict[str, dict[str, Any]] = {
        "Table I": {"rule": "table"},
        "Table I, milder": {"rule": "table", "dampings": milder},
        "(37)": {"rule": "condition"},
        "(37), milder": {"rule": "condition", "dampings": (0.0, 1e-12, 1e-11, 1e-10)},
    }
    return Finding(None, in_unit(_targets_met(runs, rules), "%"))


def constant_lambda(runs: Runs) -> Finding:
    """Mean iterations with three constant λ; the line of example 2 stays away from singular points."""
    episodes = [runs.play(LINE, "mfac", rule="constant", damping=damping) for damping in (0.0, 1e-4, 1e-3)]
    means = [float(episode.iterations.mean()) for episode in episodes]
    shares = [float((episode.status == Status.CONVERGED).mean()) for episode in episodes]
    slower = bool((np.diff(means) > 0.0).all())
    return Finding(slower and min(shares) == 1.0, {"iterations": means, "met [%]": 100.0 * min(shares)})
