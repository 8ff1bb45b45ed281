"""Khan and Tar 2020, section 2: what is claimed of inversion, damping and the earlier fixed-point iterations."""

from __future__ import annotations

import numpy as np

from baselines.papers.faitli.episodes import STRETCHED, TRAJECTORIES
from baselines.papers.paper import Claim, Finding, rms, verdict
from baselines.papers.runs import Runs
from baselines.solvers.resolved_rate.dls import damped_rows
from baselines.status import Status


def _stagnates(runs: Runs) -> Finding:
    name = "faitli3-shoulder"
    scenario = runs.scenario(name)
    path = scenario.nominal_joint_path()
    nominal = np.zeros((scenario.steps, 3)) if path is None else path[1:]
    smallest = np.linalg.svd(scenario.arm.jacobian(nominal)[:, :3], compute_uv=False)[:, -1]
    near = smallest <= max(float(smallest.min()), 0.01)
    speeds = {
        policy: float(np.abs(runs.play(name, policy).qdot[near, 0]).mean())
        for policy in ("fixed_point", "moore_penrose")
    }
    speeds["nominal"] = float(np.abs(np.gradient(nominal[:, 0], scenario.dt)[near]).mean())
    stretched = {p: float(np.abs(runs.play(STRETCHED, p).qdot).max()) for p in ("fixed_point", "moore_penrose")}
    return verdict(
        speeds["fixed_point"] < 0.1 * speeds["moore_penrose"],
        f"mean speed of q1 within 10 mm of the shoulder axis {speeds['fixed_point']:.3f} rad/s, "
        f"{speeds['moore_penrose']:.2f} rad/s of the pseudoinverse, {speeds['nominal']:.2f} rad/s nominal; at the "
        f"stretched elbow the peaks are {stretched['fixed_point']:.1f} and {stretched['moore_penrose']:.1f} rad/s",
        **speeds,
    )


def _two_joints(runs: Runs) -> Finding:
    """Planar arm with the links of Faitli's; the real parts of both eigenvalues must have one sign."""
    del runs
    upper, lower = 0.8, 0.5
    grid = np.linspace(-np.pi, np.pi, 121)
    a, b = np.meshgrid(grid, grid)
    along, across = lower * np.cos(a + b), -lower * np.sin(a + b)
    jacobian = np.stack([across - upper * np.sin(a), across, along + upper * np.cos(a), along], axis=-1)
    real = np.linalg.eigvals(jacobian.reshape(-1, 2, 2)).real
    positive, negative = float((real > 0.0).all(axis=1).mean()), float((real < 0.0).all(axis=1).mean())
    return verdict(
        max(positive, negative) < 1.0,
        f"both positive in {positive:.0%} of all configurations, both negative in {negative:.0%}",
        both_positive=positive,
        both_negative=negative,
    )


def _sign_fails(runs: Runs) -> Finding:
    numbers = {}
    for name in TRAJECTORIES:
        tried = [runs.play(name, "fixed_point", transformation="sign", a=a) for a in (-1.0, -0.1, -0.02, 0.1, 1.0)]
        numbers[name] = {
            "best_m": min(float(e.position_error.max()) for e in tried),
            "transposed_m": float(runs.play(name, "fixed_point").position_error.max()),
            "successes": sum(bool((e.status != int(Status.DIVERGED)).all()) for e in tried),
        }
    parts = [f"`{n}` {v['best_m']:.2f} m at best, {1e3 * v['transposed_m']:.1f} mm with Jᵀ" for n, v in numbers.items()]
    return verdict(
        all(v["successes"] == 0 for v in numbers.values()),
        f"in each run, with A of -1, -0.1, -0.02, 0.1, 1, steps diverged; largest error {'; '.join(parts)}"
        if not any(v["successes"] for v in numbers.values())
        else f"runs in which no step diverged: {', '.join(str(v['successes']) for v in numbers.values())}",
        **numbers,
    )


def _damping_distorts(runs: Runs) -> Finding:
    name = TRAJECTORIES[1]
    errors = {policy: rms(runs.play(name, policy).position_error) for policy in ("moore_penrose", "dls", "fixed_point")}
    return verdict(
        errors["dls"] > errors["moore_penrose"],
        f"root mean square of the error on `{name}`: pseudoinverse {1e6 * errors['moore_penrose']:.1f} µm, damped "
        f"{1e6 * errors['dls']:.1f} µm, and the inversion-free fixed point {1e6 * errors['fixed_point']:.0f} µm",
        **errors,
    )


def _distortion_ratio(runs: Runs) -> Finding:
    """Solutions exist for all directions away from singular configurations, which random ones are."""
    scenario, rng = runs.scenario(TRAJECTORIES[1]), np.random.default_rng(0)
    rows = min(1000, runs.steps or 1000)
    jacobian = scenario.model.jacobian(rng.uniform(-np.pi, np.pi, (rows, 3)))[:, :3]
    shift = rng.normal(size=(rows, 3))
    exact = np.linalg.solve(jacobian, shift[:, :, None])[:, :, 0]
    smallest = np.linalg.svd(jacobian, compute_uv=False)[:, -1] ** 2
    ratios, distortions = [], []
    for mu in (1e-6, 1e-5, 1e-4, 1e-3, 1e-2):
        damped = np.empty_like(shift)
        damped_rows(jacobian, shift, mu, damped)
        ratios.append(mu / smallest)
        distortions.append(np.linalg.norm(damped - exact, axis=1) / np.linalg.norm(exact, axis=1))
    ratio, distortion = np.concatenate(ratios), np.concatenate(distortions)
    share = distortion / np.minimum(ratio, 1.0)
    inside = float(((share <= 1.0 + 1e-6) & (share >= 0.1)).mean())
    return verdict(
        inside >= 0.95,
        f"{100 * inside:.1f} % of {len(share)} solutions are; the distortion is {np.median(share):.2f} of μ / λ_min in "
        f"the median, {share.max():.2f} at most, with λ_min between {smallest.min():.1g} and {smallest.max():.1g} m²",
        share_within=inside,
        median_of_the_ratio=float(np.median(share)),
        largest_of_the_ratio=float(share.max()),
    )


CLAIMS = (
    Claim(
        "stagnation",
        "Near singularities inversion gives huge velocities; the iteration shows a pleasant stagnation instead.",
        "section 2",
        "q1 as `faitli3-shoulder` passes above the shoulder, `fixed_point` and `moore_penrose`: below a tenth",
        _stagnates,
    ),
    Claim(
        "two joints",
        "Without Jᵀ the condition of convergence fails for the simplest arm with 2 joints.",
        "section 2, after eq. 2.6",
        "signs of the real parts of the eigenvalues of J over all configurations of a planar arm, links 0.8 and 0.5 m",
        _two_joints,
    ),
    Claim(
        "sign variant",
        "σ = ±1 instead of the Jacobian had no success beyond 2 joints.",
        "section 2, eq. 2.8",
        "`fixed_point` with `transformation` `sign` on the three trajectories with 3 joints",
        _sign_fails,
    ),
    Claim(
        "damping distorts",
        "The damped inverse may degrade the precision in the nonsingular points.",
        "abstract; section 2",
        "`dls` and `moore_penrose` on a path without singular points",
        _damping_distorts,
    ),
    Claim(
        "distortion ratio",
        "The distortion by damping can be estimated roughly as the ratio of μ and the smallest eigenvalue of J Jᵀ.",
        "section 2, after eq. 2.3",
        "the inverse of `dls` with μ of 1e-6 to 1e-2 m² in 1000 random configurations of Faitli's arm, random "
        "directions: roughly is between a tenth of μ / λ_min, or of 1 if that is less, and all of it, in 95 % of the "
        "solutions",
        _distortion_ratio,
    ),
)
