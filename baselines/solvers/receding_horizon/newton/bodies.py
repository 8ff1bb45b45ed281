"""Bodies and obstacles that a joint path has to keep apart, and the arrays in which that is looked at."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.terms import BARRIER_SIZE
from ikgym.kernels.bodies import PLACED, Shapes
from ikgym.kernels.jit import inner

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]

# Pairs of a knot that count, the nearest ones.
MOST_PAIRS = 16
# Distance in [m] above the margin from which on a pair counts.
INFLUENCE = 0.05


class Clearance(NamedTuple):
    """Bodies and obstacles that must not touch.

    Attributes:
        shapes: The bodies.
        boxes: The obstacles after 0, 1, … steps from now; the last row holds for all later ones, see
            :class:`ikgym.kernels.bodies.Surroundings`. Shape (at least 1, o, 16).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        sweep: How far a joint moves a body at most, in [m] per unit of joint coordinate. Shape (k, n).
        margin: Least distance of a pair at the knots, in [m].
        influence: Distance in [m] from which on a pair counts, above the margin.
    """

    shapes: Shapes
    boxes: Floats
    checked: npt.NDArray[np.bool_]
    sweep: Floats
    margin: float
    influence: float


class ClearanceWorkspace(NamedTuple):
    """Arrays that the clearance of a path of up to K knots is computed in; c pairs count.

    Attributes:
        joints: Axes and points of the joints. Shape (n, 6).
        placed: Starts, ends and middles of the bodies. Shape (k, 9).
        core: Scratch. Shape (6,).
        distances: Of the near pairs of a knot, in [m]. Shape (c,).
        found: The near pairs of a knot. Shape (c, 2).
        vectors: Their unit vectors and nearest points. Shape (c, 6).
        gradient: Of a distance. Shape (n,).
        counts: How many pairs are near at each knot. Shape (K,).
        pairs: Which. Shape (K, c, 2).
        barriers: Their barriers, see :mod:`interior_point`. Shape (K, c, 1, 4).
        before: Likewise of one knot, before the last step. Shape (c, 4).
        between: Joint coordinates within a motion. Shape (n,).
    """

    joints: Floats
    placed: Floats
    core: Floats
    distances: Floats
    found: Integers
    vectors: Floats
    gradient: Floats
    counts: Integers
    pairs: Integers
    barriers: Floats
    before: Floats
    between: Floats


@inner
def clearance_workspace(clearance, knots, n):
    """The workspace for paths of up to ``knots`` knots and ``n`` joints; None where there is no :class:`Clearance`."""
    if clearance is None:
        return None
    c = MOST_PAIRS
    return ClearanceWorkspace(
        np.empty((n, 6)),
        np.empty((clearance.shapes.links.shape[0], PLACED)),
        np.empty(6),
        np.empty(c),
        np.empty((c, 2), np.int64),
        np.empty((c, 6)),
        np.empty(n),
        np.zeros(knots, np.int64),
        np.empty((knots, c, 2), np.int64),
        np.empty((knots, c, 1, BARRIER_SIZE)),
        np.empty((c, BARRIER_SIZE)),
        np.empty(n),
    )
