"""Scenarios whose arm has limits of all kinds, and runs into them within a few steps."""

import numpy as np

import ikgym

#: One joint without any limit, one with stops alone, one with a stop on one side.
LOWER = np.array([-0.8, -1.0, -1.2, -np.inf, -1.6, -np.inf, -2.0])
UPPER = np.array([0.8, 1.0, 1.2, np.inf, 1.6, 1.8, 2.0])
VELOCITY = np.array([5.0, np.inf, 8.0, np.inf, 30.0, 10.0, 10.0])
ACCELERATION = np.array([300.0, np.inf, 200.0, np.inf, 400.0, np.inf, 50.0])


def limited(steps=12, **changes):
    """`varga7-random` with limits and longer steps; every motion that it draws starts within them."""
    scenario = ikgym.scenarios.get("varga7-random")
    arm = scenario.arm.replace(
        name="limited7", lower=LOWER, upper=UPPER, velocity_limit=VELOCITY, acceleration_limit=ACCELERATION
    )
    return scenario.replace(**{"name": "limited7-random", "arm": arm, "steps": steps, "dt": 0.02, **changes})
