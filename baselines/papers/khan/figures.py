"""Khan and Tar 2020: figures 3 to 19."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure

from baselines.papers.drawing import Curve, Panel, compare_coordinates, picture
from baselines.papers.khan.episodes import (
    BLOCKED,
    LOOSE,
    Q1,
    Q7Q8,
    Points,
    Variant,
    at_points,
    rotation_vectors,
    spectra,
)
from baselines.papers.paper import PaperFigure
from baselines.papers.runs import Runs
from ikgym.validation import FloatArray

START = 0.3  # [s] of the path in which the initial error relaxes
WEIGHTED = {"task_weights": "; F = 0.5 for the orientation", "joint_weights": "; W = 0.01 for joints 7 and 8"}


def _tracking(title: str, points: Points, _other: Points, _nominal: FloatArray) -> Figure:
    actual, nominal = (
        np.column_stack([pose[:, 9:], np.linalg.norm(rotation_vectors(pose), axis=1)])
        for pose in (points.pose, points.nominal)
    )
    labels = ("$X_1$ [m]", "$X_2$ [m]", "$X_3$ [m]", "rotation from\nhome [rad]")
    return picture(title, compare_coordinates(labels, points.time, actual, nominal), columns=2, height=2.3)


def _errors(title: str, points: Points, _other: Points, _nominal: FloatArray) -> Figure:
    """The start by itself, since its error would flatten all that follows."""
    start = points.time <= START
    rest = ~start if not start.all() else start
    error = points.nominal[:, 9:] - points.pose[:, 9:]
    panels = []
    for label, curves in {
        "end-point error [m]": {f"$X_{i + 1}$": error[:, i] for i in range(3)},
        "orientation error [rad]": {"angle": points.orientation_error},
    }.items():
        for part, subtitle in ((start, f"the first {START} s"), (rest, "after that")):
            drawn = [Curve(name, points.time[part], values[part]) for name, values in curves.items()]
            panels.append(Panel(label, drawn, title=subtitle))
    return picture(title, panels, columns=2, height=2.4)


def _joints(title: str, points: Points, other: Points, nominal: FloatArray) -> Figure:
    """The path of each joint; with weights and without."""
    labels = [f"$q_{i + 1}$ [rad]" for i in range(points.q.shape[1])]
    panels = compare_coordinates(labels, points.time, points.q, nominal, ("solution", "generated the nominal path"))
    if other is not points:
        panels = [
            panel._replace(curves=[*panel.curves, Curve("solution without weights", points.time, other.q[:, i])])
            for i, panel in enumerate(panels)
        ]
    return picture(title, panels, columns=2, height=1.6)


def _generator(title: str, points: Points, _other: Points, nominal: FloatArray) -> Figure:
    curves = [Curve(f"$q_{i + 1}$", points.time, nominal[:, i]) for i in (6, 7)]
    curves.append(Curve("$q_1$ … $q_6$", points.time, nominal[:, 0]))
    return picture(title, [Panel("joint coordinate [rad]", curves)], height=3)


def _angles(title: str, points: Points, _other: Points, _nominal: FloatArray) -> Figure:
    panels = [
        Panel(
            f"angle of the\n{name} rotation [rad]",
            [Curve("after each grid point", points.time, points.diagnostics[f"angle_{name}_rotation"])],
            log=True,
        )
        for name in ("counter", "abstract")
    ]
    return picture(title, panels, height=2.3)


def _spectrum(runs: Runs) -> Figure:
    real, time = spectra(runs, Q7Q8, **BLOCKED), at_points(runs, Q7Q8, **BLOCKED).time
    panels = [
        Panel("smallest [m²]", [Curve("smallest real part", time, real[:, 0], dots=True)]),
        Panel("largest [m²]", [Curve("largest real part", time, real[:, -1])]),
        Panel("third smallest [m²]", [Curve("third smallest real part", time, real[:, 2])], log=True),
    ]
    return picture("Real parts of the eigenvalues of $\\tilde J^T J$; W = 0.01 for joints 7 and 8", panels)


def _figure(
    number: int,
    subject: str,
    draw: Callable[[str, Points, Points, FloatArray], Figure],
    name: str,
    weights: Variant | None = None,
) -> PaperFigure:
    """A figure of one of the runs, drawn from its title, points with and without ℱ or 𝒲, and the nominal joint path."""
    given = weights or {}
    path = "joint 1" if name == Q1 else "joints 7 and 8"
    title = f"{subject}, nominal path by {path}" + "".join(text for key, text in WEIGHTED.items() if key in given)
    title = title if draw is not _generator else subject

    def draw_runs(runs: Runs) -> Figure:
        scenario, points, other = runs.scenario(name), at_points(runs, name, **given), at_points(runs, name)
        joint_path = scenario.nominal_joint_path()
        nominal = np.zeros_like(points.q) if joint_path is None else joint_path[1:][scenario.counted()[1:]]
        return draw(title, points, other if given else points, nominal)

    return PaperFigure(number, title, draw_runs)


TRACKING, ERRORS, JOINTS, ANGLES = "Tracking", "Tracking errors", "Joint coordinates", "Angles of both rotations"

FIGURES = (
    _figure(3, TRACKING, _tracking, Q1),
    _figure(4, ERRORS, _errors, Q1),
    _figure(5, JOINTS, _joints, Q1),
    _figure(6, ANGLES, _angles, Q1),
    _figure(7, ERRORS, _errors, Q1, LOOSE),
    _figure(8, JOINTS, _joints, Q1, LOOSE),
    _figure(9, ERRORS, _errors, Q1, BLOCKED),
    _figure(10, JOINTS, _joints, Q1, BLOCKED),
    _figure(11, "Joint coordinates that generate the nominal path", _generator, Q7Q8),
    _figure(12, TRACKING, _tracking, Q7Q8),
    _figure(13, ERRORS, _errors, Q7Q8),
    _figure(14, JOINTS, _joints, Q7Q8),
    _figure(15, ANGLES, _angles, Q7Q8),
    _figure(16, TRACKING, _tracking, Q7Q8, BLOCKED),
    _figure(17, JOINTS, _joints, Q7Q8, BLOCKED),
    _figure(18, ANGLES, _angles, Q7Q8, BLOCKED),
    PaperFigure(19, "Smallest and largest real part of the eigenvalues of J̃ᵀJ", _spectrum),
)
