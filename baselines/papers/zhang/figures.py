"""Zhang 2020: the figures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from baselines.papers.comparisons import rms
from baselines.papers.drawing import Curve, Panel, picture
from baselines.papers.paper import Drawn, PaperFigure
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import (
    HELIX,
    LINE,
    iterative,
    jacobians_used,
    lambdas_used,
    outputs,
    predictive,
    settled_from,
)
from ikgym.validation import FloatArray

AXES, TURNS = ("x", "y", "z"), ("α", "β", "γ")
BEGINNING = 25  # samples of a close-up


def _samples(count: int) -> FloatArray:
    return np.arange(1.0, count + 1.0)


def _stack(title: str, rows: Sequence[tuple[str, Sequence[Curve]]], *, columns: int = 1, height: float = 1.9) -> Figure:
    """Panels over the sample k, which stands below the lowest."""
    last = len(rows) - columns
    panels = [Panel(label, curves, "sample k" if i >= last else "") for i, (label, curves) in enumerate(rows)]
    return picture(title, panels, columns=columns, height=height)


def _with_start(title: str, rows: Sequence[tuple[str, Sequence[Curve]]], *, height: float = 1.9) -> Figure:
    """Panels over the whole run on the left, over its first samples on the right."""
    both = []
    for label, curves in rows:
        both += [(label, curves), (label, [c._replace(x=c.x[:BEGINNING], y=c.y[:BEGINNING]) for c in curves])]
    return _stack(f"{title}: whole run, left, and the first samples, right", both, columns=2, height=height)


def _tracking(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(HELIX), predictive(runs)
    real, nominal = outputs(scenario, episode), scenario.nominal()
    k = _samples(len(real))
    rows = [
        (f"{name} [m]", [Curve("actual", k, real[:, i]), Curve("desired", k, nominal[:, i], dashed=True)])
        for i, name in enumerate(AXES)
    ]
    start = settled_from(episode)
    return Drawn(
        _with_start("Example 1, tracking of the helix", rows),
        {
            "largest_error_m": float(episode.position_error.max()),
            f"largest_error_after_k_{start}_m": float(episode.position_error[start:].max()),
            "rms_error_m": rms(episode.position_error),
        },
    )


def _inputs(runs: Runs) -> Drawn:
    episode = predictive(runs)
    k, lambdas = _samples(len(episode.q)), lambdas_used(episode)
    rows = [(f"$q_{i + 1}$ [rad]", [Curve("MFAPC", k, episode.q[:, i])]) for i in range(3)]
    rows.append(("λ [m²]", [Curve("MFAPC", k, lambdas)]))
    return Drawn(
        _with_start("Example 1, control inputs and λ", rows, height=1.6),
        {
            "largest_lambda_m2": float(lambdas.max()),
            "sample_of_the_largest_lambda": int(lambdas.argmax()) + 1,
            "last_lambda_m2": float(lambdas[-1]),
            "largest_shift_rad": float(np.abs(episode.qdot).max()),
        },
    )


def _elements(runs: Runs) -> Drawn:
    episode = predictive(runs)
    jacobians = jacobians_used(runs.scenario(HELIX), episode)
    k = _samples(len(jacobians))
    names = [f"$\\phi_{{i{j + 1}}}$" for j in range(3)]
    rows = [
        (f"row i = {i + 1} [m/rad]", [Curve(name, k, jacobians[:, i, j]) for j, name in enumerate(names)])
        for i in range(3)
    ]
    sigma = np.linalg.svd(jacobians, compute_uv=False)
    return Drawn(
        _with_start("Example 1, elements $\\phi_{ij}$ of J(k)", rows),
        {
            "largest_element_m_per_rad": float(np.abs(jacobians).max()),
            "smallest_singular_value_m_per_rad": float(sigma.min()),
            "smallest_singular_value_settled_m_per_rad": float(sigma[settled_from(episode) :].min()),
        },
    )


def _line_tracking(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(LINE), iterative(runs)
    real, nominal = outputs(scenario, episode), scenario.nominal()
    k = _samples(len(real))
    turns = [scenario.task.error(poses, nominal[0])[:, 3:] for poses in (real, nominal)]
    names = [f"{axis}, {turn}" for axis, turn in zip(AXES, TURNS, strict=True)]
    rows = []
    for label, ours, wanted in (
        ("position [m]", real[:, 9:], nominal[:, 9:]),
        ("rotation from the start [rad]", turns[0], turns[1]),
    ):
        curves = [Curve(f"{name} actual", k, ours[:, i]) for i, name in enumerate(names)]
        curves += [Curve(f"{name} desired", k, wanted[:, i], dashed=True) for i, name in enumerate(names)]
        rows.append((label, curves))
    return Drawn(
        _stack("Example 2: tracking of (a) position, above, and (b) orientation, below", rows, height=2.6),
        {
            "way_m": float(np.linalg.norm(nominal[-1, 9:] - nominal[0, 9:])),
            "turn_rad": float(np.linalg.norm(turns[1][-1])),
        },
    )


def _line_errors(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(LINE), iterative(runs)
    real, nominal = outputs(scenario, episode), scenario.nominal()
    same = scenario.task.error(nominal, real)
    printed = scenario.task.error(nominal[1:], real[:-1])
    names = [f"{axis}, {turn}" for axis, turn in zip(AXES, TURNS, strict=True)]
    rows: list[tuple[str, list[Curve]]] = []
    for first, unit in ((0, "[m]"), (3, "[rad]")):
        for label, error in (("y*(k+1) − y(k)", printed), ("y*(k) − y(k)", same)):
            k = _samples(len(error))
            rows.append((f"{label} {unit}", [Curve(name, k, error[:, first + i]) for i, name in enumerate(names)]))
    return Drawn(
        _stack("Example 2: tracking error of (a) position, above, and (b) orientation, below", rows, columns=2),
        {
            "largest_position_error_m": float(episode.position_error.max()),
            "largest_orientation_error_rad": float(episode.orientation_error.max()),
            "largest_position_error_as_printed_m": float(np.linalg.norm(printed[:, :3], axis=1).max()),
            "largest_orientation_error_as_printed_rad": float(np.linalg.norm(printed[:, 3:], axis=1).max()),
        },
    )


def _line_joints(runs: Runs) -> Drawn:
    episode = iterative(runs)
    k = _samples(len(episode.q))
    rows = [(f"$q_{i + 1}$ [rad]", [Curve("measured", k, episode.q[:, i])]) for i in range(episode.q.shape[1])]
    goal = np.array([np.pi / 4, np.pi / 6, 0.0, 0.0, -np.pi / 4, 0.0])
    return Drawn(
        _stack("Example 2: measured joint angles", rows, columns=2, height=1.6),
        {
            "largest_velocity_rad_per_s": float(np.abs(episode.qdot).max()),
            "distance_from_the_joint_angles_of_B_rad": float(np.abs(episode.q[-1] - goal).max()),
        },
    )


def _iterations(runs: Runs) -> Drawn:
    counts = {
        "until all n = 2 points are met (40)": iterative(runs).iterations,
        "until the first point is met (16)": iterative(runs, stop="first_point").iterations,
    }
    rows = [("iterations [1]", [Curve(n, _samples(len(c)), c.astype(float), dots=True) for n, c in counts.items()])]
    numbers = {n: {"mean": float(c.mean()), "largest": int(c.max())} for n, c in counts.items()}
    return Drawn(_stack("Example 2: iteration count", rows, height=2.8), numbers)


FIGURES = (
    PaperFigure(2, "Tracking performance, example 1", _tracking),
    PaperFigure(3, "Control inputs and λ, example 1", _inputs),
    PaperFigure(4, "Elements of J(k), example 1", _elements),
    PaperFigure(6, "Tracking performance, example 2", _line_tracking),
    PaperFigure(7, "Tracking error, example 2", _line_errors),
    PaperFigure(8, "Measured joint angles, example 2", _line_joints),
    PaperFigure(9, "Iteration count, example 2", _iterations),
)
