"""Khan and Tar 2020, eq. 2.5 to 2.8: what is claimed of iterations that do without the Jacobian."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from baselines.papers.faitli.episodes import REGULAR, TRAJECTORIES, VISIBLE
from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.status import Status
from ikgym.scenarios import Scenario
from ikgym.trajectories import Sinusoid

PLANAR = "planar2-bent"
#: Both readings of σ, as transformations.
READINGS = ("sign", "sign_by_growth")
VALUES = (-1.0, -0.1, -0.02, 0.1, 1.0)


class Best(NamedTuple):
    """The best of several values of A.

    Attributes:
        error: The largest error at the nominal points, in [m].
        a: A.
        success: Whether no step diverged, and the error is below 1 % of the path's extent.
    """

    error: float
    a: float
    success: bool


def _best(runs: Runs, scenario: Scenario, transformation: str) -> Best:
    """The best run over A. Where points are held an iteration is a step, as with Khan; else ten are, as with Faitli."""
    counted = scenario.counted()[1:]
    given: dict[str, Any] = {"transformation": transformation, "iterations": 10 if counted.all() else 1}
    if scenario.arm.joints == 2:
        given["components"] = (0, 1)
    extent = float(np.linalg.norm(np.ptp(scenario.nominal(), axis=0)))
    tried = []
    for a in VALUES:
        episode = runs.play(scenario, "fixed_point", a=a, **given)
        error = float(episode.position_error[counted].max())
        diverged = bool((episode.status == int(Status.DIVERGED)).any())
        tried.append(Best(error, a, not diverged and error < VISIBLE * extent))
    return min(tried, key=lambda one: (not one.success, one.error))


def _wide(runs: Runs) -> Scenario:
    """The planar arm on a path with the elbow bent, along which the real parts of the eigenvalues change their sign."""
    path = Sinusoid(np.array([2.0, 0.5]), np.pi * np.array([1.0, 2.0]), offset=np.array([0.0, 1.2]))
    return runs.scenario(PLANAR).replace(name="planar2, turning once round", trajectory=path)


def _one_sign(runs: Runs) -> Scenario:
    """Faitli's arm on a path along which all eigenvalues of J keep positive real parts."""
    path = Sinusoid(
        np.full(3, 0.3), np.array([1.0, 2.0, 3.0]), phase=np.array([0.0, 0.0, 0.5]), offset=np.array([1.5, -1.6, -1.7])
    )
    return runs.scenario(REGULAR).replace(name="faitli3, eigenvalues of one sign", trajectory=path)


def _shares_of_one_sign(scenario: Scenario) -> tuple[float, float]:
    """The shares of the path on which the real parts of all eigenvalues of J are positive, and are negative."""
    path = scenario.nominal_joint_path()
    q = np.zeros((1, scenario.joints)) if path is None else path[1:]
    real = np.linalg.eigvals(scenario.arm.jacobian(q)[:, : scenario.joints]).real
    return float((real > 0.0).all(axis=1).mean()), float((real < 0.0).all(axis=1).mean())


def _two_joints(runs: Runs) -> Finding:
    """The real parts of both eigenvalues must have one sign."""
    arm = runs.scenario(PLANAR).arm
    grid = np.linspace(-np.pi, np.pi, 121)
    q = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    real = np.linalg.eigvals(arm.jacobian(q)[:, :2]).real
    positive, negative = float((real > 0.0).all(axis=1).mean()), float((real < 0.0).all(axis=1).mean())
    return verdict(
        max(positive, negative) < 1.0,
        f"both positive in {positive:.0%} of all configurations, both negative in {negative:.0%}",
        both_positive=positive,
        both_negative=negative,
    )


def _words(scenario: Scenario, tried: dict[str, Best]) -> str:
    parts = ", ".join(f"{1e3 * one.error:.3g} mm with {what} (A = {one.a:g})" for what, one in tried.items())
    positive, negative = _shares_of_one_sign(scenario)
    return f"`{scenario.name}`, all eigenvalues positive on {positive:.0%} and negative on {negative:.0%}: {parts}"


def _sign_works(runs: Runs) -> Finding:
    """The paper says that it was able to work, not that it does everywhere."""
    bent, wide = runs.scenario(PLANAR), _wide(runs)
    found = {s.name: {t: _best(runs, s, t) for t in (*READINGS, "none")} for s in (bent, wide)}
    words = "; ".join(_words(s, found[s.name]) for s in (bent, wide))
    wrong = _best_with(runs, bent, -1.0)
    return verdict_by_condition(
        {reading: found[bent.name][reading].success for reading in READINGS},
        f"largest error at the points, with the best A: {words}; on the first with the wrong sign of A, -1: {wrong}",
        **{name: {t: one._asdict() for t, one in tried.items()} for name, tried in found.items()},
    )


def _best_with(runs: Runs, scenario: Scenario, a: float) -> str:
    """The largest errors of both readings with one A, in words."""
    counted = scenario.counted()[1:]
    errors = {
        t: runs.play(scenario, "fixed_point", a=a, transformation=t, iterations=1, components=(0, 1)).position_error
        for t in READINGS
    }
    return ", ".join(f"{1e3 * float(error[counted].max()):.3g} mm with {t}" for t, error in errors.items())


def _sign_fails(runs: Runs) -> Finding:
    """No success is what the paper reports; where all eigenvalues have one sign σ has nothing to do."""
    cases = (*map(runs.scenario, TRAJECTORIES), _one_sign(runs))
    found = {s.name: {t: _best(runs, s, t) for t in READINGS} for s in cases}
    return verdict_by_condition(
        {name: not any(one.success for one in tried.values()) for name, tried in found.items()},
        f"largest error with the best A: {'; '.join(_words(s, found[s.name]) for s in cases)}",
        **{name: {t: one._asdict() for t, one in tried.items()} for name, tried in found.items()},
    )


CLAIMS = (
    Claim(
        "two joints",
        "Without Jᵀ the condition of convergence fails for the simplest arm with 2 joints.",
        "section 2, after eq. 2.6",
        "signs of the real parts of the eigenvalues of ∂(x, y)/∂q over all configurations of `planar2`",
        _two_joints,
    ),
    Claim(
        "sign works for two joints",
        "σ = ±1 instead of the Jacobian was able to work for simple systems with 2 joints.",
        "section 2, eq. 2.8, after [20]",
        f"`fixed_point` with both readings of σ on `{PLANAR}`, A = ±1, ±0.1, -0.02: it works if no step diverges and "
        "the largest error at the points is below 1 % of the path's extent with one of them",
        _sign_works,
    ),
    Claim(
        "sign variant",
        "σ = ±1 instead of the Jacobian had no success beyond 2 joints.",
        "section 2, eq. 2.8",
        "the same on the three trajectories with 3 joints, and on one along which the eigenvalues of J have one sign",
        _sign_fails,
    ),
)
