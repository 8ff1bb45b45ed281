"""What parameters say arrives in the kernels."""

from __future__ import annotations

import numpy as np
from numba import njit

from baselines.solvers.receding_horizon.newton.settings import PlanSettings, plain_settings, settings_of
from ikgym.kernels.cost import CostParameters


@njit
def arrived(numbers, integers):
    return settings_of(numbers, integers)


def test_settings_arrive_as_they_were():
    cost = CostParameters(1e-3, 3.0, 0.8, 4.0, 2.0)
    settings = PlanSettings(
        np.array([1, 2, 5]), 0.5, True, -1, 1e-7, 28, 20, 3, 2**31 - 1, 10, 4, 1e-4, np.array([0.1, np.inf])
    )
    blocks = plain_settings(cost, settings)
    assert not any(block.flags.writeable for block in blocks)
    found_cost, (at, *found, change_limit) = arrived(*blocks)
    assert found_cost == cost
    assert tuple(found) == settings[1:-1]
    np.testing.assert_array_equal(at, settings.at)
    np.testing.assert_array_equal(change_limit, settings.change_limit)
