"""Zhang 2020, section III: what is claimed of MFAC, its poles and its static error."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.episodes import rollout
from baselines.papers.paper import Claim, Finding, verdict
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import HELIX, constant, jacobians_used, listed, predictive, settled_from
from baselines.registry import make
from ikgym.trajectories import StraightLine
from ikgym.validation import FloatArray


def _poles(runs: Runs) -> Finding:
    """Eigenvalues of (9), and of (29) for n = 5, with the Jacobians that example 1 passes."""
    episode = predictive(runs)
    jacobians = jacobians_used(runs.scenario(HELIX), episode)[settled_from(episode) :]
    transposed = jacobians.transpose(0, 2, 1)
    largest = {}
    for damping in (0.0, 0.2, 2.0, 20.0):
        gains = [transposed @ np.linalg.inv(jacobians @ transposed + damping * np.eye(3)), np.empty(0)]
        whole = np.kron(np.tril(np.ones((5, 5))), np.ones((3, 3))) * np.tile(jacobians, (1, 5, 5))
        back = whole.transpose(0, 2, 1)
        gains[1] = np.linalg.solve(back @ whole + damping * np.eye(15), back @ np.tile(np.eye(3), (5, 1)))[:, :3]
        for name, gain in zip(("MFAC", "MFAPC"), gains, strict=True):
            poles = np.linalg.eigvals(np.eye(3) - jacobians @ gain)
            largest[f"{name} at λ = {damping:g}"] = float(np.abs(poles).max())
    return verdict(max(largest.values()) < 1.0, "largest pole, any λ will do: " + listed(largest, ".2f"), **largest)


def _error_grows(runs: Runs) -> Finding:
    errors = {}
    for damping in (0.0, 0.2, 2.0, 20.0, 200.0):
        episode = constant(runs, HELIX, damping)
        errors[f"λ = {damping:g}"] = float(episode.position_error[settled_from(episode) :].max())
    rising = np.diff(list(errors.values())) > 0.0
    return verdict(rising.all(), f"largest error after the transient: {listed(errors, unit=' m')}", **errors)


def _large_lambda(runs: Runs) -> Finding:
    small, large = (constant(runs, HELIX, damping).position_error[-1] for damping in (2.0, 200.0))
    return verdict(
        large > small,
        f"the error at the last sample is {large:.2g} m with λ = 200, {small:.2g} m with λ = 2",
        large_lambda_m=float(large),
        small_lambda_m=float(small),
    )


def _ramp(runs: Runs, velocity: float, damping: float, horizon: int = 1) -> tuple[FloatArray, FloatArray]:
    """The error that is left on a straight ramp of example 1's arm, and what (10) says of it.

    Args:
        runs: Says how long a run may be.
        velocity: Way in one period, in [m].
        damping: λ in [m²].
        horizon: n.
    """
    scenario, q = runs.scenario(HELIX), np.array([0.3, 0.6, 1.0])
    steps = min(scenario.steps, 400)
    direction = np.array([1.0, 2.0, -2.0]) / 3.0
    start = np.concatenate([np.eye(3).ravel(), scenario.arm.forward(q)[1]])
    # The blends last 20 periods; the ramp ends after the episode.
    end = start + np.concatenate([np.zeros(9), (steps + 30) * velocity * direction])
    line = StraightLine(start, end, duration=float(steps + 50), blend=20.0)
    ramp = scenario.replace(trajectory=line, start=q, initial_pose=None, steps=steps)
    numbers: dict[str, Any] = {"one_step": True, "rule": "constant", "damping": damping}
    policy = make("mfac", ramp, **numbers) if horizon == 1 else make("mfapc", ramp, horizon=horizon, **numbers)
    episode = rollout(ramp, policy, 0)
    u, sigma, _ = np.linalg.svd(jacobians_used(ramp, episode)[-1])
    static = u @ np.diag(damping / sigma**2) @ u.T @ (velocity * direction)
    return ramp.nominal()[-1] - episode.pose[-1], static


def _static_error(runs: Runs) -> Finding:
    apart, errors = {}, []
    for damping in (0.2, 2.0, 20.0):
        error, static = _ramp(runs, 1e-3, damping)
        apart[f"λ = {damping:g}"] = float(np.linalg.norm(error - static) / np.linalg.norm(static))
        errors.append(f"{1e6 * np.linalg.norm(error):.3g} µm")
    return verdict(
        max(apart.values()) < 0.01,
        f"a ramp of 1 mm a sample leaves {', '.join(errors)}; apart from the formula by {listed(apart, '.2%')}",
        **apart,
    )


def _no_static_error(runs: Runs) -> Finding:
    """The curvature of the kinematics leaves an error of the second order in the velocity, and no more than that."""
    orders, evidence = [], []
    for name, horizon in (("MFAC", 1), ("MFAPC, n = 5", 5)):
        fast, slow = (float(np.linalg.norm(_ramp(runs, v, 0.0, horizon)[0])) for v in (1e-2, 1e-3))
        orders.append(float(np.log10(fast / slow)))
        evidence.append(f"{name}: {1e6 * fast:.3g} µm at 10 mm a sample, {1e6 * slow:.2g} µm at 1 mm")
    return verdict(
        min(orders) > 1.9,
        f"{'; '.join(evidence)}: of order {min(orders):.2f} in the velocity, from the curvature of the kinematics",
        order=min(orders),
    )


CLAIMS = (
    Claim(
        "poles",
        "With λ sufficiently large all poles of the closed loop lie in the unit circle.",
        "section III B, eq. 9; section IV B, eq. 30",
        "eigenvalues of (9), and of (29) for n = 5, with the Jacobians along example 1",
        _poles,
    ),
    Claim(
        "error grows with λ",
        "The static error and λ are positively correlated; λ = 0 is the optimum.",
        "section III B, eq. 10; remark 1",
        "`zhang3-helix`, `mfac` with `one_step` and constant λ from 0 to 200 m²",
        _error_grows,
    ),
    Claim(
        "large λ",
        "That the tracking error of MFAC converges to zero if λ is large enough, as others showed, is wrong.",
        "section I; section III B",
        "`zhang3-helix`, `mfac` with `one_step`, λ = 2 and 200 m²",
        _large_lambda,
    ),
    Claim(
        "static error",
        "A ramp of velocity v a period leaves the error U diag(λ/σ²) Uᵀ v.",
        "section III B, eq. 10 with p = 1",
        "a straight ramp of 1 mm a sample for the arm of example 1, beside the formula with J of the last sample",
        _static_error,
    ),
    Claim(
        "no static error",
        "λ = 0 eliminates the static error of MFAC and of MFAPC away from singular points.",
        "section III B, eq. 10; section IV B, eq. 33",
        "the same ramp at two velocities: an error of the first order in the velocity would be the static error",
        _no_static_error,
    ),
)
