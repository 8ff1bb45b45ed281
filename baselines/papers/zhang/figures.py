"""Zhang 2020: figures 2 to 4 of example 1, and 6 to 9 of example 2."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from baselines.papers.drawing import Curve, Panel, compare_coordinates, picture
from baselines.papers.paper import PaperFigure
from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import HELIX, LINE, iterative, jacobians_used, lambdas_used, outputs, predictive
from ikgym.validation import FloatArray

AXES = ("x", "y", "z")
NAMES = ("x, α", "y, β", "z, γ")
BEGINNING = 25  # samples of a close-up


def _samples(values: FloatArray) -> FloatArray:
    return np.arange(1.0, len(values) + 1.0)


def _stack(title: str, panels: Sequence[Panel], *, columns: int = 1, height: float = 1.9) -> Figure:
    """Panels over the sample k, which is below the lowest."""
    last = len(panels) - columns
    labelled = [panel._replace(xlabel="sample k" if i >= last else "") for i, panel in enumerate(panels)]
    return picture(title, labelled, columns=columns, height=height)


def _with_start(title: str, panels: Sequence[Panel], *, height: float = 1.9) -> Figure:
    """Panels over the whole run on the left, over its first samples on the right."""
    both = []
    for panel in panels:
        both += [panel, panel._replace(curves=[c._replace(x=c.x[:BEGINNING], y=c.y[:BEGINNING]) for c in panel.curves])]
    return _stack(f"{title}: whole run, left, and the first samples, right", both, columns=2, height=height)


def _tracking(runs: Runs) -> Figure:
    scenario, episode = runs.scenario(HELIX), predictive(runs)
    actual, nominal = outputs(scenario, episode), scenario.nominal()
    panels = compare_coordinates(
        [f"{name} [m]" for name in AXES], _samples(actual), actual, nominal, ("actual", "desired")
    )
    return _with_start("Example 1, tracking of the helix", panels)


def _inputs(runs: Runs) -> Figure:
    episode = predictive(runs)
    values = {f"$q_{i + 1}$ [rad]": episode.q[:, i] for i in range(3)} | {"λ [m²]": lambdas_used(episode)}
    panels = [Panel(label, [Curve("MFAPC", _samples(y), y)]) for label, y in values.items()]
    return _with_start("Example 1, control inputs and λ", panels, height=1.6)


def _elements(runs: Runs) -> Figure:
    jacobians = jacobians_used(runs.scenario(HELIX), predictive(runs))
    k, names = _samples(jacobians), [f"$\\phi_{{i{j + 1}}}$" for j in range(3)]
    panels = [
        Panel(f"row i = {i + 1} [m/rad]", [Curve(name, k, jacobians[:, i, j]) for j, name in enumerate(names)])
        for i in range(3)
    ]
    return _with_start("Example 1, elements $\\phi_{ij}$ of J(k)", panels)


def _line_tracking(runs: Runs) -> Figure:
    scenario, episode = runs.scenario(LINE), iterative(runs)
    actual, nominal = outputs(scenario, episode), scenario.nominal()
    turn, nominal_turn = (scenario.task.error(poses, nominal[0])[:, 3:] for poses in (actual, nominal))
    k, panels = _samples(actual), []
    for label, ours, desired in (
        ("position [m]", actual[:, 9:], nominal[:, 9:]),
        ("rotation from the start [rad]", turn, nominal_turn),
    ):
        curves = [Curve(f"{name} actual", k, ours[:, i]) for i, name in enumerate(NAMES)]
        curves += [Curve(f"{name} desired", k, desired[:, i], dashed=True) for i, name in enumerate(NAMES)]
        panels.append(Panel(label, curves))
    return _stack("Example 2: tracking of (a) position, above, and (b) orientation, below", panels, height=2.6)


def _line_errors(runs: Runs) -> Figure:
    scenario, episode = runs.scenario(LINE), iterative(runs)
    actual, nominal = outputs(scenario, episode), scenario.nominal()
    errors = {
        "y*(k+1) − y(k)": scenario.task.error(nominal[1:], actual[:-1]),
        "y*(k) − y(k)": scenario.task.error(nominal, actual),
    }
    panels = [
        Panel(f"{label} {unit}", [Curve(name, _samples(e), e[:, first + i]) for i, name in enumerate(NAMES)])
        for first, unit in ((0, "[m]"), (3, "[rad]"))
        for label, e in errors.items()
    ]
    return _stack("Example 2: tracking error of (a) position, above, and (b) orientation, below", panels, columns=2)


def _line_joints(runs: Runs) -> Figure:
    q = iterative(runs).q
    panels = [Panel(f"$q_{i + 1}$ [rad]", [Curve("measured", _samples(q), q[:, i])]) for i in range(q.shape[1])]
    return _stack("Example 2: measured joint angles", panels, columns=2, height=1.6)


def _iterations(runs: Runs) -> Figure:
    counts = {
        "until all n = 2 points are met (40)": iterative(runs).iterations.astype(np.float64),
        "until the first point is met (16)": iterative(runs, stop="first_point").iterations.astype(np.float64),
    }
    curves = [Curve(name, _samples(c), c, dots=True) for name, c in counts.items()]
    return _stack("Example 2: iteration count", [Panel("iterations [1]", curves)], height=2.8)


FIGURES = (
    PaperFigure(2, "Tracking performance, example 1", _tracking),
    PaperFigure(3, "Control inputs and λ, example 1", _inputs),
    PaperFigure(4, "Elements of J(k), example 1", _elements),
    PaperFigure(6, "Tracking performance, example 2", _line_tracking),
    PaperFigure(7, "Tracking error, example 2", _line_errors),
    PaperFigure(8, "Measured joint angles, example 2", _line_joints),
    PaperFigure(9, "Iteration count, example 2", _iterations),
)
