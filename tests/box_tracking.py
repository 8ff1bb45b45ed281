"""A policy of the tests' own that keeps limits of position and velocity: bounded least squares in each step."""

from __future__ import annotations

import numpy as np
from scipy.optimize import lsq_linear

import ikgym

# By how much joint motion counts beside the error, and how fast joints tend to the middle of their range.
REGULARISATION, CENTRING = 1e-4, 0.05


def track(scenario):
    """The largest errors of position in [m] and of orientation in [rad], in an episode in which no limit acts."""
    env, arm, dt = ikgym.RedundantIKEnv(scenario), scenario.arm, scenario.dt
    observation, worst = env.reset(seed=0)[0], np.zeros(2)
    nominal, weight = scenario.nominal(), np.diag(REGULARISATION / arm.velocity_limit)
    for k in range(scenario.steps):
        q, pose = observation["q"], observation["pose"]
        error = scenario.task.error(nominal[k + 1], pose)
        # d error / d q; joints keep 20 steps away from their stops.
        rotation, _, geometric = arm.forward_and_jacobian(q)
        jacobian = -scenario.task.error_jacobian(nominal[k + 1], pose, scenario.task.jacobian(rotation, geometric))
        upper = 0.999 * np.minimum(arm.velocity_limit, (arm.upper - q) / (20 * dt))
        lower = -0.999 * np.minimum(arm.velocity_limit, (q - arm.lower) / (20 * dt))
        wish = CENTRING * (0.5 * (arm.lower + arm.upper) - q)
        solved = lsq_linear(
            np.vstack([jacobian, weight]), np.concatenate([error / dt, weight @ wish]), (lower, upper), method="bvls"
        )
        observation, *_, info = env.step(solved.x / scenario.velocity_limit)
        assert not np.any(info["at_limit"])
        worst = np.maximum(worst, [info["position_error"], info["orientation_error"]])
    return worst
