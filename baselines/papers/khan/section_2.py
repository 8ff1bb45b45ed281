"""Khan and Tar 2020, section 2: iterations without the Jacobian (eq. 2.5 to 2.8), and the damped inverse."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from baselines.papers.comparisons import SAME, extent
from baselines.papers.faitli.episodes import REGULAR, TRAJECTORIES, jacobians, nominal_joints
from baselines.papers.runs import Runs
from baselines.status import Status
from ikgym.scenarios import Scenario
from ikgym.trajectories import Sinusoid
from ikgym.validation import FloatArray

PLANAR = "planar2-bent"
#: Both readings of σ, as transformations of `fixed_point`.
SIGNS = ("sign", "sign_by_growth")
VALUES = (-1.0, -0.1, -0.02, 0.1, 1.0)


class Best(NamedTuple):
    """The best of several runs.

    Attributes:
        error: The largest error at the nominal points, in [m].
        a: A.
        success: Whether no step diverged, and the error is below 1 % of the path's extent.
    """

    error: float
    a: float
    success: bool


def best(runs: Runs, scenario: Scenario, transformation: str, values: Sequence[float] = VALUES) -> Best:
    """The best run of `fixed_point` over A: with one iteration a step where points are held, else with ten.

    Args:
        runs: Plays the episodes.
        scenario: The scenario.
        transformation: That of `fixed_point`.
        values: Values of A.
    """
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
        tried.append(Best(error, a, not diverged and error < visible))
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
