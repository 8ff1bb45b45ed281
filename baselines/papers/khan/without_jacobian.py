"""Khan and Tar 2020, section 2: claims on iterations without the Jacobian (eq. 2.5 to 2.8), and the damped inverse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.papers.comparisons import SAME, YANK, extent, rms
from baselines.papers.faitli.episodes import REGULAR, TRAJECTORIES, jacobians, short, singular_places
from baselines.papers.paper import Finding, in_unit
from baselines.papers.runs import Runs, nominal_joints
from baselines.status import Status
from ikgym.scenarios import Scenario
from ikgym.trajectories import Sinusoid
from ikgym.validation import FloatArray

PLANAR = "planar2-bent"
#: Both readings of σ, as transformations of `fixed_point`.
SIGNS = ("sign", "sign_by_growth")
VALUES = (-1.0, -0.1, -0.02, 0.1, 1.0)


class Best(NamedTuple):
    """The largest error at the nominal points of the best of several runs in [m].

    It is a success if no step diverged and the error is below 1 % of the path's extent.
    """

    error: float
    success: bool


def best(runs: Runs, scenario: Scenario, transformation: str, values: Sequence[float] = VALUES) -> Best:
    """The best run of `fixed_point` over A: with one iteration a step where points are held, else with ten."""
    counted = scenario.counted()[1:]
    given: dict[str, Any] = {"transformation": transformation, "iterations": 10 if counted.all() else 1}
    if scenario.arm.joints == 2:
        given["components"] = (0, 1)
    visible = SAME * extent(scenario.nominal())
    tried = []
    for a in values:
        episode = runs.play(scenario, "fixed_point", a=a, **given)
        error = float(episode.position_error[counted].max())
        diverged = bool((episode.status == int(Status.DIVERGED)).any())
        tried.append(Best(error, not diverged and error < visible))
    return min(tried, key=lambda one: (not one.success, one.error))


def turning(runs: Runs) -> Scenario:
    """The planar arm on a path with the elbow bent, along which the real parts of the eigenvalues change their sign."""
    path = Sinusoid(np.array([2.0, 0.5]), np.pi * np.array([1.0, 2.0]), offset=np.array([0.0, 1.2]))
    return runs.scenario(PLANAR).replace(name="planar2, turning once round", trajectory=path)


def one_sign(runs: Runs) -> Scenario:
    """Faitli's arm on a path along which all eigenvalues of J keep positive real parts."""
    path = Sinusoid(
        np.full(3, 0.3), np.array([1.0, 2.0, 3.0]), phase=np.array([0.0, 0.0, 0.5]), offset=np.array([1.5, -1.6, -1.7])
    )
    return runs.scenario(REGULAR).replace(name="faitli3-one sign", trajectory=path)


def planar_signs(runs: Runs) -> tuple[float, float]:
    """Shares of the planar arm's configurations with both real parts positive, and with both negative."""
    grid = np.linspace(-np.pi, np.pi, 121)
    q = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    real = np.linalg.eigvals(runs.scenario(PLANAR).arm.jacobian(q)[:, :2]).real
    return float((real > 0.0).all(axis=1).mean()), float((real < 0.0).all(axis=1).mean())


def distortions(runs: Runs) -> FloatArray:
    """μ in [m²], λ_min of JJᵀ in [m²], and ‖q̇ with μ − q̇ without‖ / ‖q̇ without‖ of the nominal velocities.

    Along the three trajectories with 3 joints, where μ is below a tenth of λ_min. Shape (3, rows).
    """
    rows = []
    for name in TRAJECTORIES:
        scenario = runs.scenario(name)
        jacobian = jacobians(scenario, nominal_joints(scenario))[:-1]
        qdot = np.diff(nominal_joints(scenario), axis=0) / scenario.dt
        gram, twist = jacobian @ np.swapaxes(jacobian, 1, 2), np.einsum("kij,kj->ki", jacobian, qdot)
        least = np.linalg.eigvalsh(gram)[:, 0]
        for mu in 10.0 ** np.arange(-8, -2):
            kept = least > 10.0 * mu
            damped = np.linalg.solve(gram[kept] + mu * np.eye(3), twist[kept, :, None])
            apart = np.einsum("kji,kj->ki", jacobian[kept], damped[..., 0]) - qdot[kept]
            relative = np.linalg.norm(apart, axis=1) / np.linalg.norm(qdot[kept], axis=1)
            rows.append(np.stack([np.full(len(relative), mu), least[kept], relative]))
    return np.concatenate(rows, axis=1)


def stagnation(runs: Runs) -> Finding:
    """Mean speed of the joint that inversion moves fastest, in the steps in which inversion yanks."""
    figures = {}
    for scenario in singular_places(runs):
        method, inversion = (np.abs(runs.play(scenario, p).qdot) for p in ("fixed_point", "moore_penrose"))
        joint = int(inversion.max(axis=0).argmax())
        yanked = inversion[:, joint] > YANK * np.median(inversion.max(axis=1))
        if yanked.any():
            speeds = [float(qdot[yanked, joint].mean()) for qdot in (inversion, method)]
            figures[f"{short(scenario.name)}, q{joint + 1}"] = speeds
    holds = bool(figures) and all(YANK * method < inversion for inversion, method in figures.values())
    return Finding(holds, in_unit(figures, "rad/s"))


def damping_distorts(runs: Runs) -> Finding:
    """Errors away from singular points."""
    policies = ("moore_penrose", "dls", "fixed_point")
    errors = {policy: rms(runs.play(TRAJECTORIES[1], policy).position_error) for policy in policies}
    return Finding(errors["dls"] > errors["moore_penrose"], in_unit(errors, "µm"))


def distortion(runs: Runs) -> Finding:
    """Exponents of μ and λ_min in the relative distortion of the nominal velocities."""
    mu, least, relative = distortions(runs)
    design = np.stack([np.ones_like(mu), np.log(mu), np.log(least)], axis=1)
    _, of_mu, of_least = np.linalg.lstsq(design, np.log(relative), rcond=None)[0]
    holds = bool(abs(of_mu - 1.0) < 0.2 and abs(of_least + 1.0) < 0.2)
    return Finding(holds, {"μ": float(of_mu), "λ_min": float(of_least)})


def two_joints(runs: Runs) -> Finding:
    """Share of all configurations with the real parts of both eigenvalues of one sign."""
    positive, negative = planar_signs(runs)
    return Finding(max(positive, negative) < 1.0, in_unit({"positive": positive, "negative": negative}, "%"))


def sign_works_for_two_joints(runs: Runs) -> Finding:
    """The best run over A of both readings of σ, and without σ, on two paths of the planar arm."""
    bent = {t: best(runs, runs.scenario(PLANAR), t) for t in (*SIGNS, "none")}
    wide = {t: best(runs, turning(runs), t) for t in (*SIGNS, "none")}
    figures: dict[str, Any] = {"bent [mm]": [1e3 * one.error for one in bent.values()]}
    figures["turning [mm]"] = [1e3 * one.error for one in wide.values()]
    return Finding({reading: bent[reading].success for reading in SIGNS}, figures)


def sign_variant(runs: Runs) -> Finding:
    """The best run over A of both readings of σ, with 3 joints."""
    holds, figures = {}, {}
    for scenario in (*map(runs.scenario, TRAJECTORIES), one_sign(runs)):
        tried = [best(runs, scenario, t) for t in SIGNS]
        holds[short(scenario.name)] = not any(one.success for one in tried)
        figures[short(scenario.name)] = [one.error for one in tried]
    return Finding(holds, in_unit(figures, "mm"))
