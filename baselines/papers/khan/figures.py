"""Khan and Tar 2020: figures 3 to 19."""

from __future__ import annotations

from typing import Any

import numpy as np

from baselines.papers.drawing import Curve, Panel, picture
from baselines.papers.khan.episodes import BLOCKED, LOOSE, Q1, Q7Q8, Points, at_points, settled_errors, spectra, turned
from baselines.papers.paper import Drawn, PaperFigure
from baselines.papers.runs import Runs

START = 0.3  # [s] of the path in which the initial error relaxes
WEIGHTED = {"task_weights": "; F = 0.5 for the orientation", "joint_weights": "; W = 0.01 for joints 7 and 8"}
TRACKING, ERRORS, JOINTS, ANGLES = "Tracking", "Tracking errors", "Joint coordinates", "Angles of both rotations"


def _tracking(title: str, points: Points) -> Drawn:
    real, nominal = (
        [*pose[:, 9:].T, np.sqrt(np.square(turned(pose)).sum(axis=1))] for pose in (points.pose, points.nominal)
    )
    labels = ("$X_1$ [m]", "$X_2$ [m]", "$X_3$ [m]", "rotation from\nhome [rad]")
    panels = [
        Panel(label, [Curve("actual", points.time, a), Curve("nominal", points.time, b, dashed=True)])
        for label, a, b in zip(labels, real, nominal, strict=True)
    ]
    return Drawn(
        picture(title, panels, columns=2, height=2.3),
        {
            **settled_errors(points),
            "nominal_extent_m": np.ptp(points.nominal[:, 9:], axis=0).tolist(),
            "actual_extent_m": np.ptp(points.settled(points.pose[:, 9:]), axis=0).tolist(),
        },
    )


def _error_figure(title: str, points: Points) -> Drawn:
    """The start by itself, since its error would flatten all that follows."""
    start = points.time <= START
    rest = ~start if not start.all() else start
    error = points.nominal[:, 9:] - points.pose[:, 9:]
    panels = []
    for kind, curves in {
        "end-point error [m]": {f"$X_{i + 1}$": error[:, i] for i in range(3)},
        "orientation error [rad]": {"angle": points.orientation_error},
    }.items():
        for part, what in ((start, f"the first {START} s"), (rest, "after that")):
            drawn = [Curve(name, points.time[part], values[part]) for name, values in curves.items()]
            panels.append(Panel(kind, drawn, title=what))
    return Drawn(
        picture(title, panels, columns=2, height=2.4),
        {
            **settled_errors(points),
            "first_position_error_m": float(points.position_error[0]),
            "first_orientation_error_rad": float(points.orientation_error[0]),
            "peak_orientation_error_rad": float(points.orientation_error.max()),
        },
    )


def _joints(runs: Runs, title: str, points: Points, name: str, other: Points | None = None) -> Drawn:
    """Each joint's path; in the runs with weights beside that without."""
    path = runs.scenario(name).nominal_joint_path()
    nominal = np.zeros_like(points.q) if path is None else path[1:][runs.scenario(name).counted()[1:]]
    panels = []
    for i in range(points.q.shape[1]):
        curves = [
            Curve("solution", points.time, points.q[:, i]),
            Curve("generated the nominal path", points.time, nominal[:, i], dashed=True),
        ]
        if other is not None:
            curves.append(Curve("solution without weights", points.time, other.q[:, i]))
        panels.append(Panel(f"$q_{i + 1}$ [rad]", curves))
    numbers = {"range_rad": np.ptp(points.q, axis=0).tolist(), "range_nominal_rad": np.ptp(nominal, axis=0).tolist()}
    if other is not None:
        numbers["largest_difference_rad"] = np.abs(points.q - other.q).max(axis=0).tolist()
    return Drawn(picture(title, panels, columns=2, height=1.6), numbers)


def _generator(runs: Runs) -> Drawn:
    scenario = runs.scenario(Q7Q8)
    path, time = scenario.nominal_joint_path(), at_points(runs, Q7Q8).time
    nominal = np.zeros((len(time), 8)) if path is None else path[1:][scenario.counted()[1:]]
    curves = [Curve(f"$q_{i + 1}$", time, nominal[:, i]) for i in (6, 7)]
    curves.append(Curve("$q_1$ … $q_6$", time, nominal[:, 0]))
    return Drawn(
        picture(
            "Joint coordinates that generate the nominal path", [Panel("joint coordinate [rad]", curves)], height=3
        ),
        {"range_rad": np.ptp(nominal, axis=0).tolist()},
    )


def _angles(title: str, points: Points) -> Drawn:
    panels, numbers = [], {}
    for name in ("counter_rotation", "abstract_rotation"):
        label = f"angle of the\n{name.replace('_rotation', ' rotation')} [rad]"
        angle = points.diagnostics[f"angle_{name}"]
        panels.append(Panel(label, [Curve("after each grid point", points.time, angle)], log=True))
        late = points.settled(angle)
        numbers[name] = {"median_rad": float(np.nanmedian(late)), "largest_rad": float(np.nanmax(angle))}
    return Drawn(picture(title, panels, height=2.3), numbers)


def _spectrum(runs: Runs) -> Drawn:
    real, time = spectra(runs, Q7Q8, **BLOCKED), at_points(runs, Q7Q8, **BLOCKED).time
    panels = [
        Panel("smallest [m²]", [Curve("smallest real part", time, real[:, 0], dots=True)]),
        Panel("largest [m²]", [Curve("largest real part", time, real[:, -1])]),
        Panel("third smallest [m²]", [Curve("third smallest real part", time, real[:, 2])], log=True),
    ]
    return Drawn(
        picture("Real parts of the eigenvalues of $\\tilde J^T J$; W = 0.01 for joints 7 and 8", panels),
        {
            "smallest_m2": [float(real[:, 0].min()), float(real[:, 0].max())],
            "largest_m2": [float(real[:, -1].min()), float(real[:, -1].max())],
            "third_smallest_m2": [float(real[:, 2].min()), float(real[:, 2].max())],
        },
    )


def _figure(number: int, what: str, name: str, weights: dict[str, Any] | None = None) -> PaperFigure:
    """A figure of one of the runs.

    Args:
        number: Its number in the paper.
        what: What is drawn: tracking, tracking errors, joint coordinates or angles.
        name: The scenario.
        weights: ℱ or 𝒲, unless they are the identity.
    """
    given = weights or {}
    path = "joint 1" if name == Q1 else "joints 7 and 8"
    told = "".join(text for key, text in WEIGHTED.items() if key in given)
    title = f"{what}, nominal path by {path}{told}"

    def draw(runs: Runs) -> Drawn:
        points = at_points(runs, name, **given)
        if what == JOINTS:
            return _joints(runs, title, points, name, at_points(runs, name) if given else None)
        return {TRACKING: _tracking, ERRORS: _error_figure, ANGLES: _angles}[what](title, points)

    return PaperFigure(number, title, draw)


FIGURES = (
    _figure(3, TRACKING, Q1),
    _figure(4, ERRORS, Q1),
    _figure(5, JOINTS, Q1),
    _figure(6, ANGLES, Q1),
    _figure(7, ERRORS, Q1, LOOSE),
    _figure(8, JOINTS, Q1, LOOSE),
    _figure(9, ERRORS, Q1, BLOCKED),
    _figure(10, JOINTS, Q1, BLOCKED),
    PaperFigure(11, "Joint coordinates that generate the nominal path", _generator),
    _figure(12, TRACKING, Q7Q8),
    _figure(13, ERRORS, Q7Q8),
    _figure(14, JOINTS, Q7Q8),
    _figure(15, ANGLES, Q7Q8),
    _figure(16, TRACKING, Q7Q8, BLOCKED),
    _figure(17, JOINTS, Q7Q8, BLOCKED),
    _figure(18, ANGLES, Q7Q8, BLOCKED),
    PaperFigure(19, "Smallest and largest real part of the eigenvalues of J̃ᵀJ", _spectrum),
)
