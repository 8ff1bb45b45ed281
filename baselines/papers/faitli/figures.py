"""Faitli and Tar 2018: figures 2 to 6."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from baselines.evaluation.plots import style
from baselines.papers.comparisons import sign_changes
from baselines.papers.drawing import Curve, Panel, compare_coordinates, picture
from baselines.papers.faitli.episodes import (
    SHOULDER,
    STRETCHED,
    jacobians,
    play_method,
    singular_values,
)
from baselines.papers.paper import PaperFigure
from baselines.papers.runs import Runs, nominal_joints, times
from ikgym.validation import FloatArray

LABELS = ("x", "y", "z")


def _path(runs: Runs) -> Figure:
    nominal = runs.scenario(STRETCHED).nominal()[1:]
    figure = style.figure(4.8)
    axes = figure.add_subplot(projection="3d")
    handles: list[Artist] = []
    looks = {"calculated": (play_method(runs).pose, "-", 1.2), "nominal": (nominal, (0, (4, 2)), 1.8)}
    for number, (points, line, width) in enumerate(looks.values()):
        handles += axes.plot(*points.T, color=style.looks(number)["color"], linestyle=line, lw=width)
    for label, name in zip(("xlabel", "ylabel", "zlabel"), LABELS, strict=True):
        axes.set(**{label: f"{name} [m]"})
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=style.SMALL, pad=1)
    axes.view_init(elev=24.0, azim=-38.0)
    axes.set_box_aspect(np.maximum(np.ptp(nominal, axis=0), 0.1), zoom=0.95)
    style.legend(figure, "Nominal and calculated path of the tool", handles, list(looks))
    return figure


def _error(runs: Runs) -> Figure:
    scenario, episode = runs.scenario(STRETCHED), play_method(runs)
    time, error = times(scenario), scenario.nominal()[1:] - episode.pose
    components = [Curve(label, time, 1e3 * error[:, i]) for i, label in enumerate(LABELS)]
    length = [Curve("length", time, 1e3 * episode.position_error)]
    panels = [Panel("error [mm]", components), Panel("error [mm]", length, log=True)]
    return picture("Tracking error, nominal less calculated", panels, height=2.6)


def _joint(runs: Runs, joint: int) -> Figure:
    scenario, one = runs.scenario(STRETCHED), slice(joint, joint + 1)
    q, nominal = play_method(runs).q[:, one], nominal_joints(scenario)[:, one]
    panels = compare_coordinates([f"$q_{joint + 1}$ [rad]"], times(scenario), q, nominal, ("calculated", "nominal"))
    return picture(f"$q_{joint + 1}$, nominal and calculated", panels, height=3.2)


def _eigenvalues(runs: Runs) -> Figure:
    """Two trajectories side by side: the paper's arm passes singular points, which not every calculated path does."""
    rows: list[list[Panel]] = []
    for name in (STRETCHED, SHOULDER):
        scenario = runs.scenario(name)
        time, paths = times(scenario), {"calculated": play_method(runs, name).q, "nominal": nominal_joints(scenario)}
        panels, singular = [], []
        for label, q in paths.items():
            jacobian = jacobians(scenario, q)
            title = f"{name}, {label} joint path"
            panels.append(Panel("real part of the\neigenvalues [m]", _real_parts(time, jacobian), title=title))
            smallest = singular_values(jacobian)[:, -1]
            singular.append(Curve(f"{label} joint path", time, smallest, dashed=label == "nominal"))
        panels.append(Panel("smallest singular\nvalue [m]", singular, title="0 where the arm is singular"))
        rows.append(panels)
    panels = [panel for row in zip(*rows, strict=True) for panel in row]
    return picture("Real parts of the eigenvalues of the position Jacobian", panels, columns=2, height=2.2)


def _real_parts(time: FloatArray, jacobian: FloatArray) -> list[Curve]:
    """The real parts by size, and the singular points; the dashed line is the last, as pairs coincide."""
    real, passes = np.sort(np.linalg.eigvals(jacobian).real, axis=1), sign_changes(np.linalg.det(jacobian))
    order = {"smallest": 0, "largest": 2, "middle": 1}
    curves = [Curve(name, time, real[:, i], dashed=i == 1) for name, i in order.items()]
    return [*curves, Curve("singular point: an eigenvalue is 0", time[passes], np.zeros(len(passes)), dots=True)]


FIGURES = (
    PaperFigure(2, "Nominal and calculated path of the tool", _path),
    PaperFigure(3, "Tracking error", _error),
    PaperFigure(4, "q2, nominal and calculated", lambda runs: _joint(runs, 1)),
    PaperFigure(5, "q3, nominal and calculated", lambda runs: _joint(runs, 2)),
    PaperFigure(6, "Real parts of the eigenvalues of the position Jacobian", _eigenvalues),
)
