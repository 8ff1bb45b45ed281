"""Varga 2021: the figures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from baselines.episodes import Episode
from baselines.papers.comparisons import rms, roughness
from baselines.papers.drawing import Curve, Panel, picture
from baselines.papers.paper import Drawn, PaperFigure
from baselines.papers.runs import Runs
from baselines.papers.varga.episodes import (
    FAST,
    METHOD,
    SLOW,
    at_limit,
    diverged,
    fast,
    fluctuation,
    largest_jump,
    nominal_path,
    slow,
    smooth,
    variation,
)
from ikgym.validation import FloatArray

WINDOW = 150  # steps of a close-up


def _times(runs: Runs, name: str) -> FloatArray:
    scenario = runs.scenario(name)
    return scenario.times(scenario.steps + 1)[1:]


def _coordinates(title: str, runs: Runs, name: str, episode: Episode, columns: list[int], labels: list[str]) -> Drawn:
    """Some task coordinates, nominal and actual, above their errors."""
    scenario, time = runs.scenario(name), _times(runs, name)
    nominal = scenario.nominal()[1:]
    error = nominal - episode.pose
    unit = "[m]" if columns[0] >= 3 else "[1]"
    tracks, errors = [], []
    for column, label in zip(columns, labels, strict=True):
        tracks += [
            Curve(f"{label} actual", time, episode.pose[:, column]),
            Curve(f"{label} nominal", time, nominal[:, column], dashed=True),
        ]
        errors.append(Curve(f"{label} actual", time, error[:, column]))
    figure = picture(title, [Panel(f"coordinates {unit}", tracks), Panel(f"tracking error {unit}", errors)], height=2.6)
    angle = episode.orientation_error
    return Drawn(
        figure,
        {
            "largest_component_error": float(np.abs(error[:, columns]).max()),
            "rms_component_error": rms(error[:, columns]),
            "largest_position_error_m": float(episode.position_error.max()),
            "largest_orientation_error_rad": float(angle.max()),
        },
    )


def _cartesian(title: str, runs: Runs, name: str, episode: Episode) -> Drawn:
    return _coordinates(title, runs, name, episode, [3, 4, 5], ["x", "y", "z"])


def _orientation(title: str, runs: Runs, name: str, episode: Episode) -> Drawn:
    labels = [f"$O^A_{{{i}}}$" for i in (12, 13, 23)]
    return _coordinates(title, runs, name, episode, [0, 1, 2], labels)


def _joints(title: str, runs: Runs, name: str, episode: Episode) -> Drawn:
    scenario, time = runs.scenario(name), _times(runs, name)
    nominal = nominal_path(runs, name)[1:]
    panels = [
        Panel(
            f"$q_{i + 1}$ [{'m' if prismatic else 'rad'}]",
            [Curve("actual", time, episode.q[:, i]), Curve("nominal", time, nominal[:, i], dashed=True)],
        )
        for i, prismatic in enumerate(scenario.arm.prismatic)
    ]
    apart = np.abs(episode.q - nominal).max(axis=0)
    return Drawn(picture(title, panels, columns=2, height=1.6), {"largest_separation_rad_or_m": apart.tolist()})


def busiest(qdot: FloatArray) -> slice:
    """The steps of a close-up: where the velocities fluctuate most, the jump from rest at the start apart."""
    width, skipped = min(WINDOW, len(qdot) // 2), len(qdot) // 20
    second_differences = np.square(np.diff(qdot[skipped:], 2, axis=0)).sum(axis=1)
    start = skipped + int(sliding_window_view(second_differences, width).sum(axis=1).argmax())
    return slice(start, start + width)


def _velocities(title: str, runs: Runs, name: str, episode: Episode, part: slice, caption: str) -> Drawn:
    """Joint velocities of a whole episode and of a part, which the paper's caption describes."""
    time = _times(runs, name)
    names = [f"$\\dot q_{i + 1}$" + (" [m/s]" if s else "") for i, s in enumerate(runs.scenario(name).arm.prismatic)]
    curves = [Curve(n, time, episode.qdot[:, i]) for i, n in enumerate(names)]
    close = [Curve(c.name, time[part], c.y[part]) for c in curves]
    label = "joint velocity\n[rad/s] or [m/s]"
    return Drawn(
        picture(title, [Panel(label, curves), Panel(label, close, title=f"the paper: “{caption}”")], height=2.5),
        {
            "caption": caption,
            "peak": float(np.abs(episode.qdot).max()),
            "rms": rms(episode.qdot),
            "rms_of_second_differences": fluctuation(episode.qdot),
            "largest_change_in_a_step_over_the_peak": largest_jump(episode.qdot),
            "total_variation": variation(episode.qdot),
            "close_up_s": [float(time[part][0]), float(time[part][-1])],
            "close_up_rms_of_second_differences": roughness(episode.qdot[part]),
        },
    )


def _effort(runs: Runs) -> Drawn:
    """With α restarted, as the other figures, and kept, both with the printed bounds of α."""
    time = _times(runs, FAST)
    panels, numbers = [], {}
    kept = runs.play(FAST, METHOD, alpha_start="kept")
    for label, episode in {"α restarted in each control step": fast(runs), "α kept": kept}.items():
        millis = 1e-6 * episode.time_ns.astype(np.float64)
        panels.append(
            (
                Curve(label, time, millis, dots=True),
                Curve(label, time, episode.iterations.astype(np.float64), dots=True),
                Curve(label, time, episode.diagnostics["alpha"], dots=True),
            )
        )
        numbers[label] = {
            "median_time_ms": float(np.median(millis)),
            "p99_time_ms": float(np.percentile(millis, 99)),
            "mean_iterations": float(episode.iterations.mean()),
            "share_at_limit": at_limit(episode),
            "share_diverged": diverged(episode),
        }
    times, steps, alphas = zip(*panels, strict=True)
    return Drawn(
        picture(
            "Time of each control step, steps of the descent, and α",
            [Panel("time [ms]", times, log=True), Panel("steps [1]", steps), Panel("last α [1]", alphas, log=True)],
        ),
        numbers,
    )


FLUCTUATES = "zoomed in to a domain where considerable fluctuations occur"


def _velocities_at_their_worst(title: str, runs: Runs, name: str, episode: Episode) -> Drawn:
    return _velocities(title, runs, name, episode, busiest(episode.qdot), FLUCTUATES)


def _smoothed_velocities(title: str, runs: Runs, name: str, episode: Episode) -> Drawn:
    part = busiest(fast(runs).qdot)
    return _velocities(title, runs, name, episode, part, "zoomed in to the domain as in Fig. 5")


def _figure(
    number: int,
    title: str,
    draw: Callable[[str, Runs, str, Episode], Drawn],
    name: str,
    episode: Callable[[Runs], Episode],
) -> PaperFigure:
    return PaperFigure(number, title, lambda runs: draw(title, runs, name, episode(runs)))


FIGURES = (
    _figure(2, "Cartesian tracking, fast", _cartesian, FAST, fast),
    _figure(3, "Orientation tracking, fast", _orientation, FAST, fast),
    _figure(4, "Joint paths, fast", _joints, FAST, fast),
    _figure(5, "Joint velocities, fast", _velocities_at_their_worst, FAST, fast),
    PaperFigure(6, "Time, steps and α of the descent, fast", _effort),
    _figure(7, "Cartesian tracking, slow", _cartesian, SLOW, slow),
    _figure(8, "Orientation tracking, slow", _orientation, SLOW, slow),
    _figure(9, "Joint paths, slow", _joints, SLOW, slow),
    _figure(10, "Joint velocities, slow", _velocities_at_their_worst, SLOW, slow),
    _figure(11, "Smoothed joint velocities", _smoothed_velocities, FAST, smooth),
    _figure(12, "Joint paths, smoothed", _joints, FAST, smooth),
    _figure(13, "Cartesian tracking, smoothed", _cartesian, FAST, smooth),
    _figure(14, "Orientation tracking, smoothed", _orientation, FAST, smooth),
)
