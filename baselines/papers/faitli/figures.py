"""Faitli and Tar 2018: figures 2 to 6."""

from __future__ import annotations

import numpy as np
from matplotlib.artist import Artist
from matplotlib.ticker import MaxNLocator

from baselines.evaluation.plots import style
from baselines.papers.comparisons import rms, sign_changes
from baselines.papers.drawing import Curve, Panel, picture
from baselines.papers.faitli.episodes import (
    SHOULDER,
    STRETCHED,
    jacobians,
    nominal_joints,
    real_zeros,
    singular_values,
    solved,
    times,
)
from baselines.papers.paper import Drawn, PaperFigure
from baselines.papers.runs import Runs
from ikgym.validation import FloatArray

LABELS = ("x", "y", "z")


def _path(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    nominal = scenario.nominal()[1:]
    figure = style.figure(4.8)
    axes = figure.add_subplot(projection="3d")
    handles: list[Artist] = []
    looks = {"calculated": (episode.pose, "-", 1.2), "nominal": (nominal, (0, (4, 2)), 1.8)}
    for number, (points, line, width) in enumerate(looks.values()):
        handles += axes.plot(*points.T, color=style.looks(number)["color"], linestyle=line, lw=width)
    for label, name in zip(("xlabel", "ylabel", "zlabel"), LABELS, strict=True):
        axes.set(**{label: f"{name} [m]"})
        getattr(axes, f"{name}axis").set_major_locator(MaxNLocator(4))
    axes.tick_params(labelsize=style.SMALL, pad=1)
    axes.view_init(elev=24.0, azim=-38.0)
    axes.set_box_aspect(np.maximum(np.ptp(nominal, axis=0), 0.1), zoom=0.95)
    style.legend(figure, "Nominal and calculated path of the tool", handles, list(looks))
    return Drawn(
        figure,
        {
            "largest_error_m": float(episode.position_error.max()),
            "extent_m": np.ptp(nominal, axis=0).tolist(),
        },
    )


def _error(runs: Runs) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    time, error = times(scenario), scenario.nominal()[1:] - episode.pose
    components = [Curve(label, time, 1e3 * error[:, i]) for i, label in enumerate(LABELS)]
    length = [Curve("length", time, 1e3 * episode.position_error)]
    return Drawn(
        picture(
            "Tracking error, nominal less calculated",
            [Panel("error [mm]", components), Panel("error [mm]", length, log=True)],
            height=2.6,
        ),
        {
            "largest_error_m": float(episode.position_error.max()),
            "rms_error_m": rms(episode.position_error),
            "largest_component_error_m": np.abs(error).max(axis=0).tolist(),
        },
    )


def _joint(runs: Runs, joint: int) -> Drawn:
    scenario, episode = runs.scenario(STRETCHED), solved(runs)
    time, nominal = times(scenario), nominal_joints(scenario)[:, joint]
    curves = [
        Curve("calculated", time, episode.q[:, joint]),
        Curve("nominal", time, nominal, dashed=True),
    ]
    title = f"$q_{joint + 1}$, nominal and calculated"
    return Drawn(
        picture(title, [Panel(f"$q_{joint + 1}$ [rad]", curves)], height=3.2),
        {"largest_separation_rad": float(np.abs(episode.q[:, joint] - nominal).max())},
    )


def _eigenvalues(runs: Runs) -> Drawn:
    """Two trajectories side by side: the paper's arm passes singular points, which not every calculated path does."""
    rows: list[list[Panel]] = []
    numbers = {}
    for name in (STRETCHED, SHOULDER):
        scenario = runs.scenario(name)
        time, paths = times(scenario), {"calculated": solved(runs, name).q, "nominal": nominal_joints(scenario)}
        panels, singular = [], []
        for label, q in paths.items():
            jacobian = jacobians(scenario, q)
            smallest, passes = singular_values(jacobian)[:, -1], sign_changes(np.linalg.det(jacobian))
            title = f"{name}, {label} joint path"
            panels.append(Panel("real part of the\neigenvalues [m]", _parts(time, jacobian, passes), title=title))
            singular.append(Curve(f"{label} joint path", time, smallest, dashed=label == "nominal"))
            numbers[f"{name}, {label}"] = {
                "singular_points": len(passes),
                "zeros_of_a_real_part": len(real_zeros(jacobian)),
                "smallest_singular_value_m": float(smallest.min()),
            }
        panels.append(Panel("smallest singular\nvalue [m]", singular, title="0 where the arm is singular"))
        rows.append(panels)
    panels = [panel for row in zip(*rows, strict=True) for panel in row]
    return Drawn(
        picture("Real parts of the eigenvalues of the position Jacobian", panels, columns=2, height=2.2), numbers
    )


def _parts(time: FloatArray, jacobian: FloatArray, passes: list[int]) -> list[Curve]:
    """The real parts by size, and the singular points; the dashed line is the last, as pairs lie upon each other."""
    real = np.sort(np.linalg.eigvals(jacobian).real, axis=1)
    order = {"smallest": 0, "largest": 2, "middle": 1}
    curves = [Curve(name, time, real[:, i], dashed=i == 1) for name, i in order.items()]
    return [*curves, Curve("singular point: an eigenvalue is 0", time[passes], np.zeros(len(passes)), dots=True)]


FIGURES = (
    PaperFigure(2, "Nominal and calculated path of the tool", _path),
    PaperFigure(3, "Tracking error", _error),
    PaperFigure(4, "q2, nominal and calculated", lambda r: _joint(r, 1)),
    PaperFigure(5, "q3, nominal and calculated", lambda r: _joint(r, 2)),
    PaperFigure(6, "Real parts of the eigenvalues of the position Jacobian", _eigenvalues),
)
