"""Varga 2021: figures 2 to 14."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from matplotlib.figure import Figure
from numpy.lib.stride_tricks import sliding_window_view

from baselines.episodes import Episode
from baselines.papers.drawing import Curve, Panel, compare_coordinates, picture
from baselines.papers.paper import PaperFigure
from baselines.papers.runs import Runs, nominal_joints, times
from baselines.papers.varga.episodes import FAST, METHOD, SLOW, fast, slow, smooth
from ikgym.validation import FloatArray

WINDOW = 150  # steps of a close-up
FLUCTUATES = "zoomed in to a domain where considerable fluctuations occur"


def _coordinates(title: str, runs: Runs, name: str, episode: Episode, coordinates: dict[str, int], unit: str) -> Figure:
    """Some task coordinates, nominal and actual, above their errors."""
    time, nominal = times(runs.scenario(name)), runs.scenario(name).nominal()[1:]
    tracks, errors = [], []
    for label, i in coordinates.items():
        tracks += [
            Curve(f"{label} actual", time, episode.pose[:, i]),
            Curve(f"{label} nominal", time, nominal[:, i], dashed=True),
        ]
        errors.append(Curve(f"{label} actual", time, nominal[:, i] - episode.pose[:, i]))
    return picture(title, [Panel(f"coordinates {unit}", tracks), Panel(f"tracking error {unit}", errors)], height=2.6)


def _cartesian(title: str, runs: Runs, name: str, episode: Episode) -> Figure:
    return _coordinates(title, runs, name, episode, {"x": 3, "y": 4, "z": 5}, "[m]")


def _orientation(title: str, runs: Runs, name: str, episode: Episode) -> Figure:
    labels = {f"$O^A_{{{elements}}}$": i for i, elements in enumerate((12, 13, 23))}
    return _coordinates(title, runs, name, episode, labels, "[1]")


def _joints(title: str, runs: Runs, name: str, episode: Episode) -> Figure:
    prismatic = runs.scenario(name).arm.prismatic
    labels = [f"$q_{i + 1}$ [{'m' if p else 'rad'}]" for i, p in enumerate(prismatic)]
    panels = compare_coordinates(labels, times(runs.scenario(name)), episode.q, nominal_joints(runs.scenario(name)))
    return picture(title, panels, columns=2, height=1.6)


def busiest(qdot: FloatArray) -> slice:
    """The steps of a close-up: those in which the velocities fluctuate most, without the jump at the start."""
    width, skipped = min(WINDOW, len(qdot) // 2), len(qdot) // 20
    second_differences = np.square(np.diff(qdot[skipped:], 2, axis=0)).sum(axis=1)
    start = skipped + int(sliding_window_view(second_differences, width).sum(axis=1).argmax())
    return slice(start, start + width)


def _velocities(
    title: str, runs: Runs, name: str, episode: Episode, part: slice | None = None, caption: str = FLUCTUATES
) -> Figure:
    """Joint velocities of a whole episode and of a part, the busiest if left out, with the paper's caption."""
    time, part = times(runs.scenario(name)), part or busiest(episode.qdot)
    names = [f"$\\dot q_{i + 1}$" + (" [m/s]" if p else "") for i, p in enumerate(runs.scenario(name).arm.prismatic)]
    curves = [Curve(n, time, episode.qdot[:, i]) for i, n in enumerate(names)]
    close = [Curve(c.name, time[part], c.y[part]) for c in curves]
    label = "joint velocity\n[rad/s] or [m/s]"
    return picture(title, [Panel(label, curves), Panel(label, close, title=f"the paper: “{caption}”")], height=2.5)


def _smoothed_velocities(title: str, runs: Runs, name: str, episode: Episode) -> Figure:
    return _velocities(title, runs, name, episode, busiest(fast(runs).qdot), "zoomed in to the domain as in Fig. 5")


def _effort(runs: Runs) -> Figure:
    """With α restarted, as in the other figures, and kept, both with the printed bounds of α."""
    time, kept = times(runs.scenario(FAST)), runs.play(FAST, METHOD, alpha_start="kept")
    episodes = {"α restarted in each control step": fast(runs), "α kept": kept}
    values = {
        "time [ms]": {name: 1e-6 * episode.time_ns.astype(np.float64) for name, episode in episodes.items()},
        "steps [1]": {name: episode.iterations.astype(np.float64) for name, episode in episodes.items()},
        "last α [1]": {name: episode.diagnostics["alpha"] for name, episode in episodes.items()},
    }
    panels = [
        Panel(label, [Curve(name, time, y, dots=True) for name, y in of.items()], log=label != "steps [1]")
        for label, of in values.items()
    ]
    return picture("Time of each control step, steps of the descent, and α", panels)


def _figure(
    number: int,
    title: str,
    draw: Callable[[str, Runs, str, Episode], Figure],
    name: str,
    episode: Callable[[Runs], Episode],
) -> PaperFigure:
    return PaperFigure(number, title, lambda runs: draw(title, runs, name, episode(runs)))


FIGURES = (
    _figure(2, "Cartesian tracking, fast", _cartesian, FAST, fast),
    _figure(3, "Orientation tracking, fast", _orientation, FAST, fast),
    _figure(4, "Joint paths, fast", _joints, FAST, fast),
    _figure(5, "Joint velocities, fast", _velocities, FAST, fast),
    PaperFigure(6, "Time, steps and α of the descent, fast", _effort),
    _figure(7, "Cartesian tracking, slow", _cartesian, SLOW, slow),
    _figure(8, "Orientation tracking, slow", _orientation, SLOW, slow),
    _figure(9, "Joint paths, slow", _joints, SLOW, slow),
    _figure(10, "Joint velocities, slow", _velocities, SLOW, slow),
    _figure(11, "Smoothed joint velocities", _smoothed_velocities, FAST, smooth),
    _figure(12, "Joint paths, smoothed", _joints, FAST, smooth),
    _figure(13, "Cartesian tracking, smoothed", _cartesian, FAST, smooth),
    _figure(14, "Orientation tracking, smoothed", _orientation, FAST, smooth),
)
