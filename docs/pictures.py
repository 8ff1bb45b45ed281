"""Draws the pictures of the README and of the results: ``python -m docs.pictures``."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

import baselines
import ikgym
from baselines.episodes import rollout
from baselines.evaluation.plots import comparison, style
from baselines.files import write
from docs.keeping import PAGES, lines
from ikgym.validation import FloatArray

IMAGES = PAGES / "images"
SCENARIO = "varga7-fast"
#: Policies whose paths are drawn, the first one in space, too.
POLICIES = ("rhc_gradient", "rhc", "rhc_foresight")
#: Half the length of the path that is drawn closer, in [m], and the time around it that is looked at, in steps.
CLOSE, AROUND = 0.3, 100
REFERENCE = {"color": style.INK, "ls": (0, (3, 2))}


def draw() -> Figure:
    """The arm on its way, the place where its path leaves the reference furthest, and the errors."""
    scenario = ikgym.scenarios.get(SCENARIO)
    # The task coordinates end with the position.
    reference = scenario.nominal(0)[1 : scenario.steps + 1, -3:]
    policies = {name: baselines.make(name, scenario) for name in POLICIES}
    episodes = {name: rollout(scenario, policy, 0, preview=policy.preview) for name, policy in policies.items()}
    paths = {name: scenario.arm.forward(one.q)[1] for name, one in episodes.items()}
    first = paths[POLICIES[0]]
    # The step at which it is furthest from the whole of the reference.
    step = int(np.argmax([np.linalg.norm(reference - point, axis=1).min() for point in first]))
    joints = scenario.arm.joint_points(episodes[POLICIES[0]].q[step])
    figure = style.figure(3.6, width=9.6)
    grid = figure.add_gridspec(2, 2, width_ratios=[1.0, 1.15], height_ratios=[1.25, 1.0])
    _space(figure.add_subplot(grid[:, 0], projection="3d", proj_type="ortho"), joints, first, reference, step)
    close, errors = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    _close(close, paths, reference, step)
    times = scenario.dt * np.arange(1, scenario.steps + 1)
    for number, episode in enumerate(episodes.values()):
        errors.plot(times, 1e3 * episode.position_error, lw=1.1, **style.looks(number))
    errors.set_yscale("log")
    errors.set_ylim(1e-2, 1e2)
    style.dress(errors, ylabel="position error [mm]", xlabel="time [s]")
    errors.margins(x=0.01)
    style.legend(figure, SCENARIO, close.get_lines(), ["reference", *(f"actual: {name}" for name in POLICIES)])
    return figure


def _space(axes: Any, joints: Any, path: FloatArray, reference: FloatArray, step: int) -> None:
    """The arm in space where it is furthest from the reference, and its path so far."""
    links = [np.zeros(3), *(end for _, end in joints), path[step]]
    axes.plot(*path.T, lw=4.5, alpha=0.45, **style.looks(0))
    # The way there alone: it comes back the same way, and dashes would fill the gaps between dashes.
    once = slice(*sorted((int(reference[:, 2].argmin()), int(reference[:, 2].argmax()))))
    axes.plot(*reference[once].T, lw=1.3, zorder=5, **REFERENCE)
    axes.plot(*np.array(links).T, color=style.STEEL, lw=3.5, marker="o", ms=4, mfc="white", mec=style.INK)
    axes.plot(*path[step], ls="", marker="s", ms=13, mfc="none", mec=style.COLOURS[1], mew=1.6)
    axes.text(*path[step], "    closer:", fontsize=style.SMALL, color=style.COLOURS[1])
    axes.view_init(elev=24, azim=-58)
    axes.set_aspect("equal")
    axes.set_box_aspect(axes._box_aspect, zoom=0.9)
    axes.tick_params(labelsize=style.SMALL - 1, pad=-2)
    for axis, name in zip((axes.xaxis, axes.yaxis, axes.zaxis), "xyz", strict=True):
        axis.set_label_text(f"{name} [m]", size=style.SMALL)
        axis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5]))
        axis.pane.set(facecolor="white", edgecolor=style.MIST)
        axis._axinfo["grid"].update(color=style.MIST, linewidth=0.5)


def _close(axes: Any, paths: dict[str, FloatArray], reference: FloatArray, step: int) -> None:
    """The paths near a step: along the reference to the right, across it upwards."""
    # The reference comes by more than once: only the part near in time is shown.
    part = slice(max(step - AROUND, 0), step + AROUND)
    centre = min(reference[part], key=lambda point: float(np.linalg.norm(point - paths[POLICIES[0]][step])))
    along = reference[step + 1] - reference[step]
    along /= np.linalg.norm(along)
    across = paths[POLICIES[0]][step] - centre
    across -= (across @ along) * along
    across /= np.linalg.norm(across)

    def put(path: FloatArray, **look: Any) -> None:
        path = path[part]
        inside = np.where(np.linalg.norm(path - centre, axis=1, keepdims=True) < CLOSE, path - centre, np.nan)
        axes.plot(1e3 * inside @ along, 1e3 * inside @ across, **look)

    put(reference, lw=2.0, zorder=3, **REFERENCE)
    for number, path in enumerate(paths.values()):
        put(path, lw=1.4, **style.looks(number))
    style.dress(
        axes,
        ylabel="across [mm]",
        xlabel="along the reference [mm]",
        title="closer: where rhc_gradient is furthest from the reference",
    )


def drawn() -> dict[str, Figure]:
    """The pictures of the results, by the names of their files."""
    title = "rhc_foresight by horizon, geometric mean and 95 % interval"
    on_main = [line for line in lines("cost_time") if line["scenario"] == "varga7-pose-random"]
    return {
        "cost-time": comparison.cost_time(on_main, "varga7-pose-random, 256 episodes"),
        "foresight": comparison.foresight(lines("foresight"), title, "knows_end"),
        "robustness": comparison.severity_map(lines("robustness_map")),
    }


def main() -> None:
    """Writes the pictures."""
    for name, figure in {"environment": draw(), **drawn()}.items():
        write(IMAGES / f"{name}.png", style.small_png(figure))


if __name__ == "__main__":
    main()
