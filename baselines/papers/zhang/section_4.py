"""Zhang 2020, section IV with remarks 4 and 5: claims on predictive control (MFAPC) beside MFAC."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np

from baselines.papers.comparisons import SAME, below, falls, roughness
from baselines.papers.paper import Finding, scaled
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import (
    HELIX,
    LINE,
    SINGULAR,
    adaptive,
    along_the_helix,
    constant,
    jacobians_used,
    of_link,
    predictive,
    settled_error,
    settled_from,
)
from baselines.recording import Episode
from baselines.solvers.levenberg_marquardt.damping import typical_link
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
        "(44)": (settled_error(adaptive(runs)), settled_error(predictive(runs))),
        "λ = 2": (settled_error(constant(runs, HELIX, 2.0)), settled_error(constant(runs, HELIX, 2.0, 5))),
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
    return Finding(holds, {**figures, f"of {len(pairs)} compared, unchanged": len(pairs) - len(holds)})


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
