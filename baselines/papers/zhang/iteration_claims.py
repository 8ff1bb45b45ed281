"""Zhang 2020, sections I and III C: what is claimed of the iteration (11)-(17) as inverse kinematics."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

from baselines.papers.paper import Claim, Finding, verdict, verdict_by_condition
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import HELIX, LINE, constant, listed, settled_from
from baselines.papers.zhang.targets import TARGETS, Targets, drawn
from baselines.registry import make
from baselines.solvers.levenberg_marquardt.damping_parameters import typical_link
from ikgym.validation import FloatArray

ITERATIONS = 10
#: Rank correlation above which two figures count as positively correlated; less is negligible.
CORRELATED = 0.1


class Iterate(NamedTuple):
    """The states of all rows at one iteration.

    Attributes:
        q: Joint coordinates in [rad]. Shape (rows, n).
        error: Norm of the error. Shape (rows,).
        jacobian: Of the task. Shape (rows, e, n).
    """

    q: FloatArray
    error: FloatArray
    jacobian: FloatArray


def _task_jacobian(targets: Targets, q: FloatArray) -> FloatArray:
    return np.asarray(targets.scenario.model.jacobian(q)[:, : targets.scenario.task.error_size])


def _at(targets: Targets, q: FloatArray) -> Iterate:
    error = np.linalg.norm(targets.error(q), axis=1)
    return Iterate(q, error, _task_jacobian(targets, q))


def _iterates(targets: Targets, **parameters: object) -> list[Iterate]:
    """What `mfac` makes of the starts in 0, 1, … iterations."""
    found = [_at(targets, targets.q)]
    for i in range(1, ITERATIONS + 1):
        policy = make("mfac", targets.scenario, iterations=i, tolerance=0.0, **parameters)
        found.append(_at(targets, targets.solved(policy)[0]))
    return found


def _sugihara(targets: Targets, weight: float, damping: float) -> list[FloatArray]:
    """Levenberg and Marquardt as [1] has them, in the space of the joints: (Jᵀ J + λ I) Δq = Jᵀ e."""
    path, eye = [targets.q], np.eye(targets.q.shape[1])
    for _ in range(ITERATIONS):
        q, error = path[-1], targets.error(path[-1])
        jacobian = _task_jacobian(targets, q)
        back = jacobian.transpose(0, 2, 1)
        lambdas = 0.5 * weight * (error**2).sum(axis=1) + damping
        whole = back @ jacobian + lambdas[:, None, None] * eye
        path.append(q + np.linalg.solve(whole, back @ error[:, :, None])[:, :, 0])
    return path


def _is_marquardt(runs: Runs) -> Finding:
    apart, rose = {}, {}
    for name in TARGETS:
        targets = drawn(runs, name)
        damping = 1e-3 * typical_link(targets.scenario.arm) ** 2
        ours = _iterates(targets, rule="sugihara", weight=1.0, damping=damping)
        theirs = _sugihara(targets, 1.0, damping)
        apart[name] = max(float(np.abs(a.q - b).max()) for a, b in zip(ours, theirs, strict=True))
        rose[name] = float((np.diff([i.error for i in ours], axis=0) > 0.0).any(axis=0).mean())
    return verdict(
        max(apart.values()) < 1e-6,
        f"largest distance of the joint coordinates {max(apart.values()):.1g} rad; Marquardt's own step control, which "
        "[1] and (11)–(17) lack, would take back a step, since the error rises, in "
        + "; ".join(f"{name} {100 * share:.0f} %" for name, share in rose.items()),
        apart_rad=apart,
        share_with_a_rise=rose,
    )


def _rank_correlation(a: FloatArray, b: FloatArray) -> float:
    """Spearman's ρ."""
    first, second = (values.argsort(kind="stable").argsort(kind="stable") for values in (a, b))
    return float(np.corrcoef(first, second)[0, 1])


def _correlations(iterates: list[Iterate]) -> tuple[float, float]:
    """Of the error with the change of J that follows, and with cond(J), until the error is rounding."""
    pairs = list(itertools.pairwise(iterates))
    error = np.concatenate([a.error for a, _ in pairs])
    change = np.concatenate([np.linalg.norm(b.jacobian - a.jacobian, axis=(1, 2)) for a, b in pairs])
    condition = np.concatenate([np.linalg.cond(a.jacobian) for a, _ in pairs])
    kept = error > 1e-9
    return _rank_correlation(error[kept], change[kept]), _rank_correlation(error[kept], condition[kept])


def _iterated(runs: Runs) -> dict[str, tuple[float, float]]:
    return {name: _correlations(_iterates(drawn(runs, name))) for name in TARGETS}


def _follows_change(runs: Runs) -> Finding:
    found = {name: change for name, (change, _) in _iterated(runs).items()}
    return verdict(min(found.values()) > CORRELATED, f"rank correlation {listed(found, '.2f')}", **found)


def _along(runs: Runs, name: str) -> float:
    """Of the tracking error with cond(J) along a path."""
    scenario = runs.scenario(name)
    episode = constant(runs, name, 1e-3 * typical_link(scenario.arm) ** 2)
    jacobians = scenario.model.jacobian(episode.q)[settled_from(episode) :, : scenario.task.error_size]
    error = np.hypot(episode.position_error, np.nan_to_num(episode.orientation_error))
    return _rank_correlation(error[settled_from(episode) :], np.linalg.cond(jacobians))


def _follows_condition(runs: Runs) -> Finding:
    iterated = {name: condition for name, (_, condition) in _iterated(runs).items()}
    along = {f"`{name}`": _along(runs, name) for name in (HELIX, LINE, "faitli3-stretched", "faitli3-shoulder")}
    return verdict_by_condition(
        {name: value > CORRELATED for name, value in {**iterated, **along}.items()},
        f"rank correlation from iteration to iteration {listed(iterated, '.2f')}; along a path {listed(along, '.2f')}",
        **iterated,
        **along,
    )


CLAIMS = (
    Claim(
        "Levenberg–Marquardt",
        "The corrected MFAC is exactly the numerical method of Sugihara 2011, Levenberg–Marquardt.",
        "section I; section III C",
        "ten iterations from poses of both arms, at random and at singular points, `mfac` with rule `sugihara` beside "
        "the normal equations (Jᵀ J + λ I) Δq = Jᵀ e with λ = ½ ‖e‖² + 0.001 l², solved apart: exactly is 1e-6 rad",
        _is_marquardt,
    ),
    Claim(
        "error and change of J",
        "The tracking error correlates positively with the change from J(k)₍ᵢ₎ to J(k)₍ᵢ₊₁₎.",
        "remark 3",
        "the same poses, ten iterations of `mfac` with rule (14): rank correlation of ‖e‖ and the change, above 0.1",
        _follows_change,
    ),
    Claim(
        "error and cond(J)",
        "The tracking error correlates positively with cond(J).",
        "remark 3, if its clause extends to cond(J)",
        "the same from iteration to iteration; and from sample to sample along four paths, `mfac` with `one_step` and "
        "λ = 0.001 l², after 60 samples",
        _follows_condition,
    ),
)
