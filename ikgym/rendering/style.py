"""Style of the pictures: colours, font sizes, and thinning of long curves."""

from __future__ import annotations

import numpy as np

from ikgym.validation import FloatArray

MOST_POINTS = 1000  # of a curve, more than its pixels resolve

# The colour-blind-safe palette of Okabe and Ito, and greys.
BLUE, ORANGE, VERMILION, GREEN = "#0072B2", "#E69F00", "#D55E00", "#009E73"
PALE_GREEN, PURPLE = "#97d8c4", "#CC79A7"
INK, STEEL, MIST, PALE = "#222222", "#808080", "#d9d9d9", "#f7f7f7"
SMALL, MEDIUM, LARGE = 8.5, 9.5, 11.0  # letters, in [pt]


def stride(points: int) -> int:
    """The number of points from one drawn point to the next."""
    return -(-points // MOST_POINTS)


def thin(points: FloatArray, step: int) -> FloatArray:
    """Each step-th point, and the last."""
    return np.concatenate([points[:-1:step], points[-1:]])
