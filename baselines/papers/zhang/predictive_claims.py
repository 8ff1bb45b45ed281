"""Zhang 2020, remark 4 and section IV: what is claimed of MFAPC, beside steps of MFAC."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.zhang.comparing import SAME, falls
from baselines.papers.zhang.episodes import HELIX, adaptive, constant, jacobians_used, listed, predictive, settled_from
from baselines.policy import Batch, Solution
from baselines.registry import make


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
    return _same("the sums of three steps", apart)


def _same(what: str, apart: Mapping[str, float]) -> Finding:
    """Whether results are the same, by λ; given are relative differences."""
    shares = {name: 100.0 * share for name, share in apart.items()}
    return verdict_by_condition(
        {name: share < SAME for name, share in apart.items()},
        f"{what} are apart by {listed(shares, '.2g', ' %')}",
        **apart,
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
    apart = {}
    for damping in (0.0, 0.2, 2.0, 20.0):
        one = _along_the_helix(runs, "mfac", 1, damping=damping).qdot
        other = _along_the_helix(runs, "mfapc", 5, hold=True, horizon=5, damping=damping).qdot
        difference = np.linalg.norm(other - one, axis=1) / np.linalg.norm(one, axis=1)
        apart[f"λ = {damping:g}"] = float(np.median(difference))
    return _same("with n = 5 the inputs (median)", apart)


def _closer_tracking(runs: Runs) -> Finding:
    cases = {
        "under (44)": (adaptive(runs), predictive(runs)),
        "with λ = 2": (constant(runs, HELIX, 2.0), constant(runs, HELIX, 2.0, 5)),
    }
    pairs = {}
    for name, both in cases.items():
        before, after = (float(e.position_error[settled_from(e) :].max()) for e in both)
        pairs[name] = before, after
    text = "; ".join(f"{1e3 * a:.0f} mm MFAC, {1e3 * b:.0f} mm MFAPC {name}" for name, (a, b) in pairs.items())
    return falls(pairs, f"largest error after the transient: {text}")


CLAIMS = (
    Claim(
        "one formula",
        "What the iteration (11)–(16) calculates can be organised into the one formula (21).",
        "remark 4",
        "three steps with a constant J and y*, summed, beside the sum of (21), by λ in m²: less than 1 % apart",
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
        "the same with n = 5 and the first point repeated, by λ in m²: the same effect is less than 1 % apart",
        _held_points,
    ),
    Claim(
        "closer tracking",
        "MFAPC uses more of the desired trajectory, and minimises the predicted tracking error.",
        "section I; section IV A",
        "`zhang3-helix`: largest error after the transient with n = 1 and n = 5, 10 % smaller",
        _closer_tracking,
    ),
)
