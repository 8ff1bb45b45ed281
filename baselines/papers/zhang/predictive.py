"""Zhang 2020, sections IV and V: claims on predictive control (MFAPC) and MFAC, on both examples, and on times."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable

import numpy as np
from threadpoolctl import threadpool_limits

from baselines.episodes import Episode
from baselines.papers.comparisons import SAME, below, extent, falls, larger, roughness
from baselines.papers.paper import Finding, in_unit
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import (
    HELIX,
    LINE,
    SINGULAR,
    adaptive,
    along_the_helix,
    constant,
    iterative,
    jacobians_used,
    lambdas_used,
    of_link,
    predictive,
    settled_error,
    settled_from,
    unmet_of_the_way,
)
from baselines.solvers.levenberg_marquardt.damping import typical_link
from baselines.status import Status
from ikgym.kernels.rotations import rodrigues
from ikgym.validation import FloatArray

Pairs = dict[str, tuple[float, float]]


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
    return Finding(below(apart, SAME), in_unit({"": list(apart.values())}, "%"))


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
    return Finding(below(apart, SAME), in_unit({"": list(apart.values())}, "%"))


def closer_tracking(runs: Runs) -> Finding:
    """Largest error after the transient with MFAC and with MFAPC."""
    pairs = {
        "(44)": (settled_error(adaptive(runs)), settled_error(predictive(runs))),
        "λ = 2": (settled_error(constant(runs, HELIX, 2.0)), settled_error(constant(runs, HELIX, 2.0, 5))),
    }
    return Finding(falls(pairs), in_unit({f"{name}:": pair for name, pair in pairs.items()}, "mm"))


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
    figures = dict(sorted(in_unit({f"{name}:": share for name, share in shares.items()}, "%").items()))
    return Finding(holds, {**figures, f"of {len(pairs)} compared, unchanged": len(pairs) - len(holds)})


def _smoothness(runs: Runs, values: Callable[[Episode], FloatArray]) -> Finding:
    """Roughness after the transient, and in example 1 as printed with the transient as well."""

    def rough(_path: str, episode: Episode) -> float:
        return roughness(values(episode)[settled_from(episode) :])

    example = adaptive(runs), predictive(runs)
    pairs = {
        "example 1, whole": (roughness(values(example[0])), roughness(values(example[1]))),
        "example 1, settled": (rough(HELIX, example[0]), rough(HELIX, example[1])),
    }
    return _changes({**pairs, **_by_path_and_lambda(runs, rough, (HELIX, LINE, *SINGULAR))})


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
    first, later = float(error[: min(8, len(error) // 2)].max()), settled_error(predictive(runs))
    return Finding(first > later, {"start [m]": first, "later [m]": later})


def falling_lambda(runs: Runs) -> Finding:
    """Largest error after the transient with λ held at its peak, and falling."""
    peak = float(lambdas_used(predictive(runs)).max())
    held, free = settled_error(constant(runs, HELIX, round(peak, 4), 5)), settled_error(predictive(runs))
    return Finding(larger(held, free), in_unit({"held": held, "falling": free}, "mm"))


def excellent(runs: Runs) -> Finding:
    """Largest errors as shares of the path's extent and, on the line, of the whole turn."""
    line, nominal = iterative(runs), runs.scenario(LINE).nominal()
    ways = runs.scenario(LINE).task.error(nominal[-1], nominal[0])
    shares = {
        "helix": settled_error(predictive(runs)) / extent(runs.scenario(HELIX).nominal()),
        "line": float(line.position_error.max() / np.linalg.norm(ways[:3])),
        "turn": float(line.orientation_error.max() / np.linalg.norm(ways[3:])),
    }
    return Finding(max(shares.values()) < SAME, in_unit(shares, "%"))


def ten_iterations(runs: Runs) -> Finding:
    """Points met, and the most iterations of a period."""
    episode = iterative(runs, stop="first_point")
    share, most = float((episode.status == Status.CONVERGED).mean()), int(episode.iterations.max())
    return Finding(share == 1.0 and most <= 10, {"met [%]": 100.0 * share, "iterations": most})


def whole_horizon(runs: Runs) -> Finding:
    """Samples at which (40) is unmet after 10 and 100 iterations, and the error that is left."""
    unmet = [float((iterative(runs, iterations=n).status == Status.ITERATION_LIMIT).mean()) for n in (10, 100)]
    left = unmet_of_the_way(runs)
    figures = in_unit({"unmet": unmet, "left": left}, "%")
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
    for angle in (1e-2, 1e-4, 1e-6, 1e-8):
        d = rodrigues(axis, 1.0 + angle) @ rodrigues(axis, 1.0).T
        error = float(np.linalg.norm(_printed_vector(d) - angle * axis) / angle)
        printed[f"{angle:.0e} rad:"] = error if np.isfinite(error) else 1.0
    return Finding(below(printed, SAME), printed)


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
