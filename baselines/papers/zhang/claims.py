"""Zhang 2020: the tests of the claims in ``claims.toml``, each function named after its claim.

One short function a claim: 34 of them in one file, so that each is found by the name of its claim.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from baselines.episodes import Episode
from baselines.papers.comparisons import SAME, above, below, extent, falls, larger, rms, roughness
from baselines.papers.paper import Finding, scaled
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import (
    HELIX,
    LINE,
    adaptive,
    along_the_helix,
    constant,
    iterative,
    jacobians_used,
    lambdas_used,
    of_link,
    predictive,
    ramp_errors,
    settled_from,
    unmet_of_the_way,
)
from baselines.papers.zhang.targets import (
    SHARES,
    TARGETS,
    at_rest,
    drawn,
    iterates,
    met,
    rank_correlation,
    sugihara,
)
from baselines.solvers.levenberg_marquardt.damping import typical_link
from baselines.status import Status
from ikgym import Plant
from ikgym.arms import Arm
from ikgym.kernels.rotations import rodrigues, rotation_vector
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Pairs = dict[str, tuple[float, float]]

#: Paths past singular points.
SINGULAR = ("faitli3-stretched", "faitli3-shoulder")


def _settled_error(episode: Episode) -> float:
    """The largest position error after the transient, in [m]."""
    return float(episode.position_error[settled_from(episode) :].max())


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
    errors = [_settled_error(constant(runs, HELIX, damping)) for damping in (0.0, 0.2, 2.0, 20.0, 200.0)]
    return Finding(bool((np.diff(errors) > 0.0).all()), {"[m]": errors})


def large_lambda(runs: Runs) -> Finding:
    """Error at the last sample with λ = 2 and 200 m²."""
    small, large = (float(constant(runs, HELIX, damping).position_error[-1]) for damping in (2.0, 200.0))
    return Finding(large > small, {"[m]": (small, large)})


def static_error(runs: Runs) -> Finding:
    """Distance of the error on a ramp from eq. 10, as a share."""
    apart: dict[str, float] = {}
    more: dict[str, float] = {}
    for damping in (0.2, 2.0, 20.0):
        error, formula = ramp_errors(runs, 1e-3, damping)
        apart[f"λ = {damping:g}"] = float(np.linalg.norm(error - formula) / np.linalg.norm(formula))
        more[f"λ = {damping:g} [m]"] = float(np.linalg.norm(error))
    return Finding(max(apart.values()) < SAME, scaled({"": list(apart.values())}, "%"), more)


def no_static_error(runs: Runs) -> Finding:
    """Order of the error in the velocity; the curvature of the kinematics leaves an error of the second order."""
    orders: dict[str, float] = {}
    more: dict[str, float] = {}
    for name, horizon in (("MFAC", 1), ("MFAPC", 5)):
        fast, slow = (float(np.linalg.norm(ramp_errors(runs, v, 0.0, horizon)[0])) for v in (1e-2, 1e-3))
        orders[name] = float(np.log10(fast / slow))
        more |= {f"{name}, 10 mm a sample [m]": fast, f"{name}, 1 mm a sample [m]": slow}
    return Finding(min(orders.values()) > 1.9, orders, more)


def _each_step(values: Mapping[str, list[float]]) -> Pairs:
    """Each value beside the next, by condition."""
    return {f"{name}, {i}": pair for name, of in values.items() for i, pair in enumerate(itertools.pairwise(of))}


def robustness(runs: Runs) -> Finding:
    """Targets lost with a wrong model, and peak joint velocities near singular points, by λ."""

    def lost(share: float, links: float) -> float:
        return float((at_rest(runs, share, 0.1, links=links)[0][-1] >= SAME).mean())

    def peak(scenario: str, share: float) -> float:
        return float(np.abs(constant(runs, scenario, of_link(runs, scenario, share)).qdot).max())

    values = {f"lost, links of {100 * links:.0f} %": [lost(s, links) for s in SHARES] for links in (0.45, 0.3)}
    places = {"start": HELIX, "shoulder": "faitli3-shoulder", "elbow": "faitli3-stretched"}
    peaks = {name: [peak(scenario, s) for s in SHARES] for name, scenario in places.items()}
    return Finding(falls(_each_step({**values, **peaks})), {**scaled(values, "%"), **scaled(peaks, "rad/s")})


def fastest_without_damping(runs: Runs) -> Finding:
    """Samples until the error stays below 1 %, by λ, and overshoot of λ = 0, for three distances."""
    holds: dict[str, bool] = {}
    figures: dict[str, float | list[float]] = {}
    more: dict[str, list[float]] = {}
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
        more[f"{shift:g} rad"] = overshoots
    return Finding(holds, figures | {"overshoot [%]": [100.0 * of[0] for of in more.values()]}, more)


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
            errors[name] = [float(episode.position_error.max()) for episode in episodes]
        else:
            peaks[name] = [float(np.abs(episode.qdot).max()) for episode in episodes]
    return Finding(falls(_each_step({**errors, **peaks})), {**scaled(errors, "mm"), **scaled(peaks, "rad/s")})


def model_free(runs: Runs) -> Finding:
    """Error with the exact model and on the worst of three arms for each calibration, by example and controller."""
    calibrations = {"fine": (5e-4, 3e-4), "coarse": (1e-2, 1e-2)}
    controllers: dict[str, dict[str, Any]] = {
        "(5)": {"one_step": True, "rule": "constant", "damping": 0.0},
        "(11)–(17)": {},
    }
    holds: dict[str, bool] = {}
    figures: dict[str, list[float]] = {}
    more: dict[str, list[float]] = {}
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
            more[f"{name}, {which} [m]"] = wrong
    return Finding(holds, scaled(figures, "mm"), more)


def levenberg_marquardt(runs: Runs) -> Finding:
    """Largest distance of ten iterates from those of the normal equations."""
    apart, more = {}, {}
    for name in TARGETS:
        targets = drawn(runs, name)
        damping = 1e-3 * typical_link(targets.scenario.arm) ** 2
        ours, theirs = iterates(targets, rule="sugihara", weight=1.0, damping=damping), sugihara(targets, damping)
        apart[name] = max(float(np.abs(a.q - b).max()) for a, b in zip(ours, theirs, strict=True))
        rises = (np.diff([i.error for i in ours], axis=0) > 0.0).any(axis=0)
        more[f"{name}, share with a rise of the error"] = float(rises.mean())
    return Finding(max(apart.values()) < 1e-6, {"[rad]": max(apart.values())}, {**apart, **more})


def _correlations(runs: Runs, name: str) -> tuple[float, float]:
    """Rank correlation of the error with the following change of J and with cond(J), until the error is rounding."""
    pairs = list(itertools.pairwise(iterates(drawn(runs, name))))
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
    return {targets: [met(runs, targets, rule) for rule in with_none.values()] for targets in TARGETS}


def rule_14(runs: Runs) -> Finding:
    """Targets met with λ = 0 and two λ₀: not fewer by more than the standard error of 1000 targets, 0.5 %."""
    rules = {f"{share}": {"rule": "error_ratio", "damping": share} for share in (0.1, 0.001)}
    shares = _targets_met(runs, rules)
    return Finding(all(min(of) >= of[0] - 0.005 for of in shares.values()), scaled(shares, "%"))


def rule_18(runs: Runs) -> Finding:
    """Targets met with λ = 0 and three choices of a₁ and a₂: of (44), with faster decay, the default of (14)."""
    rules = {
        f"{a}, {b}": {"rule": "threshold", "growth": a, "decay": b, "damping": 1e-3}
        for a, b in ((1.1, 1.02), (1.1, 1.2), (2.0, 2.0))
    }
    return Finding(None, scaled(_targets_met(runs, rules), "%"))


def look_up(runs: Runs) -> Finding:
    """Targets met with λ = 0, with Table I and with (37), each also with milder values."""
    milder = ((0.0, 0.0, 0.0), (1e-8, 1e-6, 1e-4), (1e-6, 1e-4, 1e-3))
    rules: dict[str, dict[str, Any]] = {
        "Table I": {"rule": "table"},
        "Table I, milder": {"rule": "table", "dampings": milder},
        "(37)": {"rule": "condition"},
        "(37), milder": {"rule": "condition", "dampings": (0.0, 1e-12, 1e-11, 1e-10)},
    }
    return Finding(None, scaled(_targets_met(runs, rules), "%"))


def constant_lambda(runs: Runs) -> Finding:
    """Mean iterations with three constant λ; the line of example 2 stays away from singular points."""
    episodes = [runs.play(LINE, "mfac", rule="constant", damping=damping) for damping in (0.0, 1e-4, 1e-3)]
    means = [float(episode.iterations.mean()) for episode in episodes]
    shares = [float((episode.status == Status.CONVERGED).mean()) for episode in episodes]
    slower = bool((np.diff(means) > 0.0).all())
    return Finding(slower and min(shares) == 1.0, {"iterations": means, "met [%]": 100.0 * min(shares)})


def one_formula(runs: Runs) -> Finding:
    """Distance of the sums of three steps, with the same J and y* all along, which is the kindest case."""
    jacobian = jacobians_used(runs.scenario(HELIX), predictive(runs))[-1]
    error, n, apart = np.ones(3), 3, {}
    whole = np.kron(np.tril(np.ones((n, n))), jacobian)
    for damping in (0.0, 2.0, 20.0):
        left, made = error.copy(), np.zeros(3)
        for _ in range(n):  # (11)-(17)
            step = np.linalg.solve(jacobian.T @ jacobian + damping * np.eye(3), jacobian.T @ left)
            left, made = left - jacobian @ step, made + step
        stacked = np.linalg.solve(whole.T @ whole + damping * np.eye(3 * n), whole.T @ np.tile(error, n))  # (21)
        total = stacked.reshape(n, 3).sum(axis=0)
        apart[f"λ = {damping:g}"] = float(np.linalg.norm(total - made) / np.linalg.norm(made))
    return Finding(below(apart, SAME), scaled({"": list(apart.values())}, "%"))


def one_point(runs: Runs) -> Finding:
    """Largest difference of an input with n = 1."""
    one = along_the_helix(runs, "mfac", 1, damping=2.0)
    worst = float(np.abs(one - along_the_helix(runs, "mfapc", 1, horizon=1, damping=2.0)).max())
    return Finding(worst < 1e-12, {"[rad]": worst})


def undamped(runs: Runs) -> Finding:
    """Largest difference of an input with λ = 0."""
    one = along_the_helix(runs, "mfac", 1, damping=0.0)
    others = (along_the_helix(runs, "mfapc", n, horizon=n, damping=0.0) for n in (2, 3, 5))
    apart = [float(np.abs(one - other).max()) for other in others]
    return Finding(max(apart) < 1e-9, {"[rad]": apart})


def held_points(runs: Runs) -> Finding:
    """Distance of the inputs with n = 5 and the first point repeated, as a share, the median over the states."""
    apart = {}
    for damping in (0.0, 0.2, 2.0, 20.0):
        one = along_the_helix(runs, "mfac", 1, damping=damping)
        held = along_the_helix(runs, "mfapc", 5, hold=True, horizon=5, damping=damping)
        shares = np.linalg.norm(held - one, axis=1) / np.linalg.norm(one, axis=1)
        apart[f"λ = {damping:g}"] = float(np.median(shares))
    return Finding(below(apart, SAME), scaled({"": list(apart.values())}, "%"))


def closer_tracking(runs: Runs) -> Finding:
    """Largest error after the transient with MFAC and with MFAPC."""
    pairs = {
        "(44)": (_settled_error(adaptive(runs)), _settled_error(predictive(runs))),
        "λ = 2": (_settled_error(constant(runs, HELIX, 2.0)), _settled_error(constant(runs, HELIX, 2.0, 5))),
    }
    return Finding(falls(pairs), scaled({f"{name}:": pair for name, pair in pairs.items()}, "mm"))


def _by_path_and_lambda(runs: Runs, figure: Callable[[str, Episode], float], paths: tuple[str, ...]) -> Pairs:
    """A figure of MFAC, and of MFAPC with n = 5 and the same constant λ: the range of remark 2, and as much less."""
    pairs = {}
    for path, share in itertools.product(paths, (1e-5, 1e-3, 1e-1)):
        damping = of_link(runs, path, share)
        one, other = (figure(path, constant(runs, path, damping, horizon)) for horizon in (1, 5))
        pairs[f"{path.partition('-')[2]}, {share:g} l²"] = one, other
    return pairs


def _changes(pairs: Pairs) -> Finding:
    """Whether a figure falls, with the changes that count, as shares of the larger value."""
    holds = falls(pairs)
    shares = {name: (pairs[name][1] - pairs[name][0]) / max(pairs[name]) for name in holds}
    figures = dict(sorted(scaled({f"{name}:": share for name, share in shares.items()}, "%").items()))
    return Finding(holds, {**figures, f"of {len(pairs)} compared, unchanged": len(pairs) - len(holds)}, dict(pairs))


def _smoothness(runs: Runs, values: Callable[[Episode], FloatArray]) -> Finding:
    """Roughness after the transient, and in example 1 as printed with the transient as well."""

    def settled(_path: str, episode: Episode) -> float:
        return roughness(values(episode)[settled_from(episode) :])

    example = adaptive(runs), predictive(runs)
    pairs = {
        "example 1, whole": (roughness(values(example[0])), roughness(values(example[1]))),
        "example 1, settled": (settled(HELIX, example[0]), settled(HELIX, example[1])),
    }
    return _changes({**pairs, **_by_path_and_lambda(runs, settled, (HELIX, LINE, *SINGULAR))})


def smoother_inputs(runs: Runs) -> Finding:
    """Roughness of the joint coordinates."""
    return _smoothness(runs, lambda episode: episode.q)


def smoother_outputs(runs: Runs) -> Finding:
    """Roughness of the task coordinates."""
    return _smoothness(runs, lambda episode: episode.pose)


def singular_points(runs: Runs) -> Finding:
    """Closeness to singular points, and time near them."""

    def sigma(path: str, episode: Episode) -> FloatArray:
        return np.asarray(np.linalg.svd(runs.scenario(path).arm.jacobian(episode.q)[:, :3], compute_uv=False)[:, -1])

    def time_near(path: str, episode: Episode) -> float:
        return float((sigma(path, episode) < 0.05 * typical_link(runs.scenario(path).arm)).mean())

    def closeness(path: str, episode: Episode) -> float:
        return float(1.0 / sigma(path, episode).min())

    pairs: Pairs = {}
    for measure, figure in (("1/σ", closeness), ("time", time_near)):
        found = _by_path_and_lambda(runs, figure, SINGULAR)
        pairs |= {f"{measure}, {name}": pair for name, pair in found.items()}
    return _changes(pairs)


def switch_at_33(runs: Runs) -> Finding:
    """Sample of the largest λ."""
    lambdas = lambdas_used(predictive(runs))
    turn = int(lambdas.argmax()) + 1
    return Finding(turn == 33, {"k =": turn, "λ [m²]": float(lambdas.max())})


def up_then_down(runs: Runs) -> Finding:
    """Samples with rising and with falling λ."""
    change = np.diff(lambdas_used(predictive(runs)))
    turns = int((np.diff(np.sign(change)) != 0.0).sum())
    figures = {"up": int((change > 0.0).sum()), "down": int((change < 0.0).sum()), "turns": turns}
    return Finding(turns == 1 and change[0] > 0.0, figures)


def poor_start(runs: Runs) -> Finding:
    """Largest errors in the first 8 samples and after the transient."""
    error = predictive(runs).position_error
    first, later = float(error[: min(8, len(error) // 2)].max()), _settled_error(predictive(runs))
    return Finding(first > later, {"start [m]": first, "later [m]": later})


def falling_lambda(runs: Runs) -> Finding:
    """Largest error after the transient with λ held at its peak, and falling."""
    peak = float(lambdas_used(predictive(runs)).max())
    held, free = _settled_error(constant(runs, HELIX, round(peak, 4), 5)), _settled_error(predictive(runs))
    return Finding(larger(held, free), scaled({"held": held, "falling": free}, "mm"))


def excellent(runs: Runs) -> Finding:
    """Largest errors as shares of the path's extent and, on the line, of the whole turn."""
    line, nominal = iterative(runs), runs.scenario(LINE).nominal()
    ways = runs.scenario(LINE).task.error(nominal[-1], nominal[0])
    shares = {
        "helix": _settled_error(predictive(runs)) / extent(runs.scenario(HELIX).nominal()),
        "line": float(line.position_error.max() / np.linalg.norm(ways[:3])),
        "turn": float(line.orientation_error.max() / np.linalg.norm(ways[3:])),
    }
    return Finding(max(shares.values()) < SAME, scaled(shares, "%"))


def ten_iterations(runs: Runs) -> Finding:
    """Points met, and the most iterations of a period."""
    episode = iterative(runs, stop="first_point")
    share, most = float((episode.status == Status.CONVERGED).mean()), int(episode.iterations.max())
    return Finding(share == 1.0 and most <= 10, {"met [%]": 100.0 * share, "iterations": most})


def whole_horizon(runs: Runs) -> Finding:
    """Samples at which (40) is unmet after 10 and 100 iterations, and the error that is left."""
    unmet = [float((iterative(runs, iterations=n).status == Status.ITERATION_LIMIT).mean()) for n in (10, 100)]
    left = unmet_of_the_way(runs)
    figures = scaled({"unmet": unmet, "left": left}, "%")
    return Finding({"to δ": unmet[0] == 0.0, "to 1 %": left < SAME}, figures)


def _printed_vector(d: FloatArray) -> FloatArray:
    """(52)-(54) as printed; NaN where they are 0/0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        theta = np.arccos((np.trace(d) - 1.0) / 2.0)
        axis = np.array([d[2, 1] - d[1, 2], d[0, 2] - d[2, 0], d[1, 0] - d[0, 1]]) / (2.0 * np.sin(theta))
        return np.asarray(axis * theta)


def printed_angle(runs: Runs) -> Finding:
    """Relative error of the product of two rotations about one axis as in (51)-(54); 1 where there is no number."""
    del runs
    axis = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    printed: dict[str, float] = {}
    more: dict[str, float] = {}
    for angle in (1e-2, 1e-4, 1e-6, 1e-8):
        d = rodrigues(axis, 1.0 + angle) @ rodrigues(axis, 1.0).T
        for errors, vector in ((printed, _printed_vector(d)), (more, rotation_vector(d))):
            error = float(np.linalg.norm(vector - angle * axis) / angle)
            errors[f"{angle:.0e} rad:"] = error if np.isfinite(error) else 1.0
    return Finding(below(printed, SAME), printed, {f"atan2, {name}": error for name, error in more.items()})


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


def _median_micros(call: Callable[[], object], times: int) -> float:
    """The median time of a call in [µs], on one thread."""
    spent = []
    with threadpool_limits(limits=1):
        for _ in range(times):
            begin = time.perf_counter_ns()
            call()
            spent.append(1e-3 * (time.perf_counter_ns() - begin))
    return float(np.median(spent))


def inverse_of_18(runs: Runs) -> Finding:
    """Times of the inverse of Ψ̄ᵀ Ψ̄ + λ̄ for n = 3 at the start of example 2, compiled and interpreted."""
    scenario, iterations = runs.scenario(LINE), 10
    start = np.zeros(6) if scenario.start is None else scenario.start
    whole = np.kron(np.tril(np.ones((3, 3))), scenario.model.jacobian(start))
    matrix = whole.T @ whole + 1e-3 * np.eye(18)
    rows, many = matrix.tolist(), np.tile(matrix, (iterations, 1, 1))
    figures = {
        "compiled, one": _median_micros(lambda: np.linalg.inv(matrix), 1000),
        "ten": _median_micros(lambda: np.linalg.inv(many), 1000),
        "interpreted, one": _median_micros(lambda: interpreted_inverse(rows), 50),
        "by blocks, all": 1e-3 * float(np.median(_ten_iterations(runs, 3, 1e-3).time_ns)),
    }
    # A computer of 2020 may be ten times as slow as this one; interpreted it must not fit even here.
    holds = {
        "compiled": 10.0 * figures["compiled, one"] > 1e3,
        "interpreted": iterations * figures["interpreted, one"] > 1e3,
    }
    return Finding(holds, {f"{name} [µs]": micros for name, micros in figures.items()})


def _ten_iterations(runs: Runs, horizon: int, damping: float) -> Episode:
    """Example 2 with ten iterations at each sample."""
    return runs.play(LINE, "mfapc", horizon=horizon, damping=damping, iterations=10, tolerance=0.0, rule="constant")


def less_calculation(runs: Runs) -> Finding:
    """Times of 10 iterations with n = 3 and λ > 0, and with n = 2 and λ = 0."""
    a, b = (1e-3 * float(np.median(_ten_iterations(runs, n, d).time_ns)) for n, d in ((3, 1e-3), (2, 0.0)))
    return Finding(larger(a, b), {"n = 3: [µs]": a, "n = 2: [µs]": b})
