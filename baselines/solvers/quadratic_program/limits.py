"""The limits of a problem, as kernels take them."""

from __future__ import annotations

import numpy as np

from baselines.policy import Problem
from ikgym.validation import FloatArray, read_only

# Actions in float32 miss a velocity by up to this share of the one that an action of 1 means.
ROUNDING = 2.0**-24


def limits_with_braking(problem: Problem) -> FloatArray:
    """The limits of a problem as :func:`velocity_box` takes them.

    Braking reckons with a little less than the acceleration limit: a joint that brakes as hard as it can cannot make up
    for the rounding of its actions, and would touch its stop.

    Returns:
        Least and largest joint coordinates in [rad] or [m], then in [rad/s] or [m/s] the largest velocities, their
        largest changes in one step, and those that braking reckons with. Shape (5, n).
    """
    model = problem.model
    change = problem.dt * model.acceleration_limit
    braking = np.maximum(change - 2.0 * ROUNDING * problem.velocity_limit, 0.5 * change)
    return read_only(np.array([model.lower, model.upper, problem.largest_qdot, change, braking]))
