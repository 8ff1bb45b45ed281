"""Zhang 2020, remark 4 and section IV: what is claimed of MFAPC, beside steps of MFAC."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.evaluation.rollout import Episode
from baselines.papers.paper import Claim, Finding, roughness, verdict
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import HELIX, adaptive, constant, jacobians_used, listed, predictive, settled_from
from baselines.policy import Batch, Solution
from baselines.registry import make
from ikgym.validation import FloatArray


def _one_formula(runs: Runs) -> Finding:
    """With the same J and y* all along, which is the kindest case."""
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
    return verdict(
        max(apart.values()) < 1e-9, f"the sums of three steps are apart by {listed(apart, '.2g')} of them", **apart
    )


def _along_the_helix(runs: Runs, policy: str, ahead: int, *, hold: bool = False, **numbers: Any) -> Solution:
    """Single steps from all states of example 1, the first, singular one left out."""
    scenario, episode = runs.scenario(HELIX), predictive(runs)
    nominal, steps = scenario.nominal(preview=ahead), len(episode.q)
    points = [np.arange(1, steps) + (1 if hold else 1 + j) for j in range(ahead)]
    q = episode.q[:-1]
    batch = Batch(
        q, np.zeros_like(q), episode.pose[:-1], np.stack([nominal[p] for p in points], 1), np.ones((len(q), 1))
    )
    solver = make(policy, scenario, one_step=True, rule="constant", **numbers)
    return solver.solve(batch, solver.memory(len(q)))


def _apart(one: npt.NDArray[Any], other: npt.NDArray[Any]) -> float:
    return float(np.abs(one - other).max())


def _one_point(runs: Runs) -> Finding:
    one = _along_the_helix(runs, "mfac", 1, damping=2.0).qdot
    worst = _apart(one, _along_the_helix(runs, "mfapc", 1, horizon=1, damping=2.0).qdot)
    return verdict(worst < 1e-12, f"largest difference of an input {worst:.1g} rad", difference_rad=worst)


def _undamped_equal(runs: Runs) -> Finding:
    one = _along_the_helix(runs, "mfac", 1, damping=0.0).qdot
    apart = {
        f"n = {n}": _apart(one, _along_the_helix(runs, "mfapc", n, horizon=n, damping=0.0).qdot) for n in (2, 3, 5)
    }
    return verdict(
        max(apart.values()) < 1e-9, f"largest difference of an input: {listed(apart, '.1g', ' rad')}", **apart
    )


def _held_points(runs: Runs) -> Finding:
    one = _along_the_helix(runs, "mfac", 1, damping=2.0).qdot
    other = _along_the_helix(runs, "mfapc", 5, hold=True, horizon=5, damping=2.0).qdot
    size = np.linalg.norm(one, axis=1)
    share = float(np.median(np.linalg.norm(other - one, axis=1) / size))
    return verdict(
        share < 1e-9,
        f"with λ = 2 and n = 5 the inputs differ by {share:.1%} (median); only the point of rest is the same",
        median_relative_difference=share,
    )


def _smoothness(runs: Runs, values: Callable[[Episode], FloatArray], unit: str) -> Finding:
    start = settled_from(predictive(runs))
    cases = {
        "whole run, rule (44)": (adaptive(runs), predictive(runs), 0),
        f"from k = {start} on, rule (44)": (adaptive(runs), predictive(runs), start),
        f"from k = {start} on, λ = 2": (constant(runs, HELIX, 2.0), constant(runs, HELIX, 2.0, 5), start),
    }
    rough = {label: tuple(roughness(values(e)[k:]) for e in (a, b)) for label, (a, b, k) in cases.items()}
    evidence = "; ".join(f"{label}: {a:.3g} {unit} MFAC, {b:.3g} {unit} MFAPC" for label, (a, b) in rough.items())
    return verdict(
        all(b < a for a, b in rough.values()),
        evidence,
        **{f"{label}, {name}": v for label, of in rough.items() for name, v in zip(("MFAC", "MFAPC"), of, strict=True)},
    )


def _closer_tracking(runs: Runs) -> Finding:
    a, b = (float(e.position_error[settled_from(e) :].max()) for e in (adaptive(runs), predictive(runs)))
    c, d = (float(e.position_error[settled_from(e) :].max()) for e in (constant(runs, HELIX, 2.0, n) for n in (1, 5)))
    return verdict(
        b < a and d < c,
        f"largest error after the transient: {1e3 * a:.0f} mm MFAC, {1e3 * b:.0f} mm MFAPC under (44); "
        f"{1e3 * c:.0f} and {1e3 * d:.0f} mm with λ = 2",
        mfac_m=a,
        mfapc_m=b,
        mfac_constant_m=c,
        mfapc_constant_m=d,
    )


def _singular_points(runs: Runs) -> Finding:
    nearest, holds = {}, True
    for scenario in ("faitli3-stretched", "faitli3-shoulder"):
        pair = []
        for name, n in (("MFAC", 1), ("MFAPC", 5)):
            q = constant(runs, scenario, 1e-2, n).q
            sigma = np.linalg.svd(runs.scenario(scenario).arm.jacobian(q)[:, :3], compute_uv=False)
            pair.append(float(sigma.min()))
            nearest[f"{scenario}, {name}"] = 1e3 * pair[-1]
        holds &= pair[1] > pair[0]
    return verdict(holds, f"smallest singular value on the way: {listed(nearest, '.3g', ' mm/rad')}", **nearest)


CLAIMS = (
    Claim(
        "one formula",
        "What the iteration (11)–(16) calculates can be organised into the one formula (21).",
        "remark 4",
        "three steps with a constant J and y*, summed, beside the sum of (21)",
        _one_formula,
    ),
    Claim(
        "one point",
        "With n = 1 MFAPC degenerates into MFAC.",
        "remark 5",
        "single steps of both from all states of example 1, λ = 2 m²",
        _one_point,
    ),
    Claim(
        "undamped",
        "With λ = 0 the first input of MFAPC is that of MFAC.",
        "section IV C, eq. 38",
        "the same with λ = 0 and n = 2, 3, 5",
        _undamped_equal,
    ),
    Claim(
        "held points",
        "With Y* = E y*(k+1) MFAPC has the same control effect as MFAC.",
        "remark 5",
        "the same with λ = 2 m², n = 5 and the first point repeated",
        _held_points,
    ),
    Claim(
        "smoother inputs",
        "The inputs of MFAPC are smoother than those of MFAC.",
        "section I",
        "root mean square of the second differences of q on `zhang3-helix`; MFAPC should be below in all comparisons",
        lambda runs: _smoothness(runs, lambda e: e.q, "rad"),
    ),
    Claim(
        "smoother outputs",
        "The outputs with MFAPC are smoother than with MFAC.",
        "section I",
        "the same of the position",
        lambda runs: _smoothness(runs, lambda e: e.pose, "m"),
    ),
    Claim(
        "closer tracking",
        "MFAPC uses more of the desired trajectory, and minimises the predicted tracking error.",
        "section I; section IV A",
        "`zhang3-helix`: largest error after the transient with n = 1 and n = 5",
        _closer_tracking,
    ),
    Claim(
        "singular points",
        "MFAPC helps the robot to keep clear of isolated singular points on the path.",
        "section I",
        "two paths past singular points, λ = 0.01 m², n = 1 and n = 5: smallest singular value, which should be larger",
        _singular_points,
    ),
)
