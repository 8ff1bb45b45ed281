"""Axes of joints as words: the arms of makers point along an axis of the base at q = 0."""

from __future__ import annotations

import numpy as np

from ikgym.validation import FloatArray


def directions(words: str) -> FloatArray:
    """Unit vectors of a text such as ``"z y -z"``, one word a joint. Shape (n, 3)."""
    return np.array([(-1.0 if word[0] == "-" else 1.0) * np.eye(3)["xyz".index(word[-1])] for word in words.split()])
