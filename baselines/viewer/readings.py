"""Readings of a posture: manipulability, distances from the joint limits, and colours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ikgym.arms import Arm
from ikgym.tasks import Task
from ikgym.validation import FloatArray

Colour = tuple[int, int, int]

#: Colours (red, green, blue) of joints that are free, near a limit, and at one.
FREE, NEAR, AT = (150, 150, 150), (230, 159, 0), (213, 94, 0)

# A joint is near a limit within this share of its range, or this distance in [rad] or [m] where that is less.
NEAR_SHARE, NEAR_MOST = 0.05, 0.1
# Distance in [rad] or [m] below which a joint is at its limit.
TOUCHING = 1e-9
# Random postures whose largest manipulability is the scale.
POSTURES = 512


class Reading(NamedTuple):
    """The readings of a posture."""

    manipulability: float  # Yoshikawa's w = √det(J Jᵀ), of the linear rows where the task has no orientation
    share: float  # the same as a share of the largest among random postures, between 0 and 1
    # distances of the joints from their nearest limit in [rad] or [m], inf without limits. Shape (n,)
    margins: FloatArray
    joints: list[Colour]  # colours of the n joints: ``FREE``, ``NEAR`` or ``AT``
    tool: Colour  # colour of the tool: from vermilion in a singular posture to bluish green in the best one


class Reader:
    """Computes the readings of one arm; the task selects rows of the Jacobian."""

    def __init__(self, arm: Arm, task: Task) -> None:
        self._arm, self._rows = arm, 6 if task.has_orientation and arm.joints >= 6 else 3
        self._near = np.minimum(NEAR_SHARE * (arm.upper - arm.lower), NEAR_MOST)
        postures = np.random.default_rng(0).uniform(*slider_range(arm), (POSTURES, arm.joints))
        self.largest = float(self._manipulability(postures).max())

    def read(self, q: FloatArray) -> Reading:
        """The readings of a posture of shape (n,) in [rad] or [m]."""
        margins = np.minimum(q - self._arm.lower, self._arm.upper - q)
        joints = np.where(margins <= TOUCHING, 2, np.where(margins <= self._near, 1, 0)).tolist()
        found = float(self._manipulability(q))
        share = min(found / self.largest, 1.0) if self.largest else 0.0
        red, green, blue = (
            round((1.0 - share) * bad + share * good) for bad, good in zip(AT, (0, 158, 115), strict=True)
        )
        return Reading(found, share, margins, [(FREE, NEAR, AT)[k] for k in joints], (red, green, blue))

    def _manipulability(self, q: FloatArray) -> FloatArray:
        jacobian = self._arm.jacobian(q)[..., : self._rows, :]
        # The product of the singular values: the root of a determinant would lose half of the digits.
        values: FloatArray = np.linalg.svd(jacobian, compute_uv=False).prod(axis=-1)
        return values


def slider_range(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Lowest and highest joint coordinates of the sliders, each of shape (n,): the joint limits.

    Without limits half a turn either way, or half the reach.
    """
    usual = np.where(arm.prismatic, 0.5 * (arm.reach(np.zeros(arm.joints)) or 1.0), np.pi)
    return (
        np.where(np.isfinite(arm.lower), arm.lower, np.minimum(-usual, arm.upper - usual)),
        np.where(np.isfinite(arm.upper), arm.upper, np.maximum(usual, arm.lower + usual)),
    )
