"""Khan and Tar 2020, section 2: what is claimed of inversion, damping and the earlier fixed-point iterations."""

from __future__ import annotations

import numpy as np

from baselines.papers.faitli.episodes import (
    STRETCHED,
    TRAJECTORIES,
    YANK,
    jacobians,
    nominal_joints,
    singular_places,
)
from baselines.papers.paper import Claim, Finding, rms, verdict
from baselines.papers.runs import Runs

#: Damping in [m²].
MUS = 10.0 ** np.arange(-8, -2)


def _stagnates(runs: Runs) -> Finding:
    """The critical coordinate is that joint which inversion moves fastest, in the steps in which it yanks."""
    numbers = {}
    for scenario in singular_places(runs):
        method, inversion = (np.abs(runs.play(scenario, p).qdot) for p in ("fixed_point", "moore_penrose"))
        joint = int(inversion.max(axis=0).argmax())
        yanked = inversion[:, joint] > YANK * np.median(inversion.max(axis=1))
        if yanked.any():
            numbers[scenario.name] = {
                "joint": joint + 1,
                "inversion_rad_per_s": float(inversion[yanked, joint].mean()),
                "method_rad_per_s": float(method[yanked, joint].mean()),
            }
    parts = [
        f"`{n}` q{v['joint']:.0f} {v['inversion_rad_per_s']:.3g} rad/s with inversion, "
        f"{v['method_rad_per_s']:.2g} rad/s without"
        for n, v in numbers.items()
    ]
    stretched = {p: float(np.abs(runs.play(STRETCHED, p).qdot).max()) for p in ("fixed_point", "moore_penrose")}
    return verdict(
        bool(numbers) and all(YANK * v["method_rad_per_s"] < v["inversion_rad_per_s"] for v in numbers.values()),
        f"mean speed of the critical joint while inversion yanks: {'; '.join(parts) or 'it does nowhere'}; at "
        f"the stretched elbow, which the path crosses without need of great velocities, inversion has "
        f"{stretched['moore_penrose']:.1f} rad/s at most, the iteration {stretched['fixed_point']:.1f} rad/s",
        places=numbers,
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


def _distortion(runs: Runs) -> Finding:
    """‖q̇ with μ - q̇ without‖ / ‖q̇ without‖ for the nominal velocities, where μ is below a tenth of λ_min."""
    rows = []
    for name in TRAJECTORIES:
        scenario = runs.scenario(name)
        jacobian = jacobians(scenario, nominal_joints(scenario))[:-1]
        qdot = np.diff(nominal_joints(scenario), axis=0) / scenario.dt
        gram, twist = jacobian @ np.swapaxes(jacobian, 1, 2), np.einsum("kij,kj->ki", jacobian, qdot)
        least = np.linalg.eigvalsh(gram)[:, 0]
        for mu in MUS:
            kept = least > 10.0 * mu
            damped = np.linalg.solve(gram[kept] + mu * np.eye(3), twist[kept, :, None])
            apart = np.einsum("kji,kj->ki", jacobian[kept], damped[..., 0]) - qdot[kept]
            relative = np.linalg.norm(apart, axis=1) / np.linalg.norm(qdot[kept], axis=1)
            rows.append(np.stack([np.full(len(relative), mu), least[kept], relative]))
    mu, least, relative = np.concatenate(rows, axis=1)
    design = np.stack([np.ones_like(mu), np.log(mu), np.log(least)], axis=1)
    _, of_mu, of_least = np.linalg.lstsq(design, np.log(relative), rcond=None)[0]
    low, high = np.quantile(relative * least / mu, (0.05, 0.95))
    return verdict(
        abs(of_mu - 1.0) < 0.2 and abs(of_least + 1.0) < 0.2,
        f"the relative distortion of q̇ goes with μ^{of_mu:.2f} λ_min^{of_least:.2f}; in nine of ten cases it is "
        f"between {low:.2g} and {high:.2g} · μ/λ_min",
        exponent_of_mu=float(of_mu),
        exponent_of_least=float(of_least),
    )


CLAIMS = (
    Claim(
        "stagnation",
        "Near singularities inversion gives huge velocities; the iteration shows a pleasant stagnation instead.",
        "section 2",
        "the runs of Faitli's row on yanks: in the steps in which the fastest joint of `moore_penrose` is above 10 "
        "times the median over time, the same joint of `fixed_point` is below a tenth of that",
        _stagnates,
    ),
    Claim(
        "damping distorts",
        "The damped inverse may degrade the precision in the nonsingular points.",
        "abstract; section 2",
        "`dls` and `moore_penrose` on a path without singular points: the root mean square of the error is larger",
        _damping_distorts,
    ),
    Claim(
        "distortion",
        "The distortions by damping depend, roughly, on the ratio of μ and the smallest positive eigenvalue of JJᵀ.",
        "section 2",
        "relative distortion of the nominal q̇ along the three trajectories with 3 joints, μ from 1e-8 to 1e-3 m² and "
        "below a tenth of λ_min: fitted exponents of μ and λ_min within a fifth of 1 and -1",
        _distortion,
    ),
)
