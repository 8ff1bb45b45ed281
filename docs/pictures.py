"""Draws the pictures of the README and of the results: ``python -m docs.pictures``."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

import baselines
import ikgym
from baselines.evaluation.plots import comparison, style
from baselines.files import write
from docs.keeping import PAGES, lines

IMAGES = PAGES / "images"
SCENARIO = "varga7-fast"
POLICIES = ("rhc_gradient", "rhc", "rhc_foresight")


def draw() -> Figure:
    """The paths of some policies, with the arm where the first is furthest from the reference, and their errors."""
    scenario = ikgym.scenarios.get(SCENARIO)
    reference = scenario.nominal(0)[1 : scenario.steps + 1, -3:]  # the position is last of the task coordinates
    tracks = {name: baselines.track(scenario, name) for name in POLICIES}
    first = tracks[POLICIES[0]]
    step = int(np.argmax(first.position_error))
    figure = style.figure(3.6, width=9.6)
    grid = figure.add_gridspec(1, 2, width_ratios=[1.0, 1.15])
    space: Any = figure.add_subplot(grid[0], projection="3d", proj_type="ortho")
    errors = figure.add_subplot(grid[1])
    # One way alone: the path comes back, and dashes would fill the gaps between dashes.
    once = slice(*sorted((int(reference[:, 2].argmin()), int(reference[:, 2].argmax()))))
    space.plot(*reference[once].T, color=style.INK, ls=(0, (3, 2)), lw=1.3, zorder=5)
    for number, track in enumerate(tracks.values()):
        path = scenario.arm.forward(track.q)[1]
        space.plot(*path.T, lw=1.6, **style.looks(number))
        errors.plot(track.times, 1e3 * track.position_error, lw=1.1, **style.looks(number))
    links = [np.zeros(3), *(end for _, end in scenario.arm.joint_points(first.q[step]))]
    links.append(scenario.arm.forward(first.q[step])[1])
    space.plot(*np.array(links).T, color=style.STEEL, lw=3.5, marker="o", ms=4, mfc="white", mec=style.INK)
    space.view_init(elev=24, azim=-58)
    space.set_aspect("equal")
    space.set_box_aspect(space._box_aspect, zoom=0.9)
    space.tick_params(labelsize=style.SMALL - 1, pad=-2)
    for axis, name in zip((space.xaxis, space.yaxis, space.zaxis), "xyz", strict=True):
        axis.set_label_text(f"{name} [m]", size=style.SMALL)
        axis.set_major_locator(MaxNLocator(3, steps=[1, 2, 5]))
    errors.set_yscale("log")
    errors.set_ylim(1e-2, 1e2)
    style.dress(errors, ylabel="position error [mm]", xlabel="time [s]")
    errors.margins(x=0.01)
    style.legend(figure, SCENARIO, space.get_lines()[:-1], ["reference", *(f"actual: {name}" for name in POLICIES)])
    return figure


def main() -> None:
    """Writes the pictures."""
    on_main = [line for line in lines("cost_time") if line["scenario"] == "varga7-pose-random"]
    cost_time = comparison.cost_time(on_main, "varga7-pose-random, 256 episodes")
    for name, figure in {"environment": draw(), "cost-time": cost_time}.items():
        write(IMAGES / f"{name}.png", style.small_png(figure))


if __name__ == "__main__":
    main()
