"""The map as pictures: one a policy, and one with the best policy of each cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure

from baselines.evaluation.pages.robustness.measured import Cell
from baselines.evaluation.plots import style
from baselines.evaluation.report import number

#: The largest cost ratio with a colour of its own.
CUT = 100.0
SIZE = 4.2  # [in]


def one(policy: str, cells: Sequence[Cell]) -> Figure:
    """The map of a policy: cost ratios as colours and numbers, and below them the share of lost episodes."""
    drawn, axes = _axes(policy)
    knowledge, drives = _severities(cells)
    ratios = np.full((len(drives), len(knowledge)), np.nan)
    for cell in cells:
        x, y = knowledge.index(cell.knowledge), drives.index(cell.drives)
        ratios[y, x] = cell.cost_ratio
        lost = f"\n{100.0 * cell.lost:.0f} % lost" if cell.lost else ""
        dark = cell.cost_ratio > np.sqrt(CUT)
        axes.text(
            x, y, number(cell.cost_ratio) + lost, ha="center", va="center", fontsize=style.SMALL,
            color="white" if dark else style.INK,
        )  # fmt: skip
    shade = axes.imshow(np.clip(ratios, 1.0, CUT), norm=LogNorm(1.0, CUT), cmap="viridis_r", origin="lower")
    bar = drawn.colorbar(shade, ax=axes, shrink=0.8, extend="max")
    bar.set_label("cost ratio", fontsize=style.SMALL)
    bar.ax.tick_params(labelsize=style.SMALL)
    return _labelled(drawn, axes, knowledge, drives)


def best(cells: Sequence[Cell]) -> Figure:
    """The best policy of each cell, with its cost ratio."""
    drawn, axes = _axes("best policy")
    knowledge, drives = _severities(cells)
    policies = list(dict.fromkeys(cell.policy for cell in cells))
    winners = np.zeros((len(drives), len(knowledge)))
    for y, x in np.ndindex(*winners.shape):
        first = min(here(cells, knowledge[x], drives[y]), key=lambda cell: (cell.lost, cell.cost_ratio))
        winners[y, x] = policies.index(first.policy)
        text = f"{first.policy}\n{number(first.cost_ratio)}"
        axes.text(x, y, text, ha="center", va="center", fontsize=style.SMALL - 2.0, color=style.INK)
    colours = ListedColormap([(*_rgb(style.COLOURS[i % len(style.COLOURS)]), 0.45) for i in range(len(policies))])
    axes.imshow(winners, cmap=colours, vmin=-0.5, vmax=len(policies) - 0.5, origin="lower")
    return _labelled(drawn, axes, knowledge, drives)


def here(cells: Sequence[Cell], knowledge: float, drives: float) -> list[Cell]:
    """The policies at a place of the map."""
    return [cell for cell in cells if (cell.knowledge, cell.drives) == (knowledge, drives)]


def _axes(title: str) -> tuple[Figure, Axes]:
    drawn = style.figure(SIZE, SIZE + 1.6)
    axes = drawn.subplots()
    axes.set_title(title, fontsize=style.MEDIUM, loc="left")
    return drawn, axes


def _severities(cells: Sequence[Cell]) -> tuple[list[float], list[float]]:
    return sorted({cell.knowledge for cell in cells}), sorted({cell.drives for cell in cells})


def _labelled(drawn: Figure, axes: Axes, knowledge: Sequence[float], drives: Sequence[float]) -> Figure:
    axes.set_xticks(range(len(knowledge)), [f"{one:g}" for one in knowledge], fontsize=style.SMALL)
    axes.set_yticks(range(len(drives)), [f"{one:g}" for one in drives], fontsize=style.SMALL)
    axes.set_xlabel("severity of calibration and camera", fontsize=style.MEDIUM)
    axes.set_ylabel("severity of lag and delay", fontsize=style.MEDIUM)
    return drawn


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[first : first + 2], 16) / 255.0 for first in (1, 3, 5))
    return red, green, blue
