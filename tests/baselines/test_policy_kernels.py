"""What the steps of all policies share: every number is looked at, and nothing that is returned is used again."""

import gc

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import baselines
import ikgym
from baselines.policy_kernels import all_finite


def shown(preview, rows=None):
    env = ikgym.RedundantIKEnv("varga7-fast", preview=preview)
    observation, _ = env.reset(seed=0)
    return observation if rows is None else {key: np.stack([value] * rows) for key, value in observation.items()}


@pytest.mark.parametrize("key", ["q", "qdot", "pose", "nominal", "remaining"])
def test_any_number_that_is_not_finite_is_found(key):
    parts = {key: part.copy() for key, part in shown(40, rows=2).items()}
    for value in (np.nan, -np.nan, np.inf, -np.inf):
        parts[key].flat[-1] = value
        assert not all_finite(*parts.values())
        parts[key].flat[-1] = np.copysign(np.finfo(float).max, value)
        assert all_finite(*parts.values())


@pytest.fixture
def blocks_held():
    """How many blocks of memory compiled code has allocated and not freed; counted in this test."""
    _nrt_python.memsys_enable_stats()
    yield lambda: rtsys.get_allocation_stats().mi_alloc - rtsys.get_allocation_stats().mi_free
    _nrt_python.memsys_disable_stats()


@pytest.mark.parametrize(
    "parameters",
    [
        {"horizon": 3, "rate_weight": 1e-3},
        {"horizon": 4, "starts": 2, "restart_steps": 3, "iterations": 1, "recovery_steps": 2},
    ],
)
def test_nothing_is_left_behind(blocks_held, parameters):
    """Kernels that do not count references would lose those of arrays that others give them."""
    policy = baselines.make("rhc", "varga7-fast", **parameters)
    observation = shown(policy.preview)
    state = policy.predict(observation)[1]
    before = blocks_held()
    for _ in range(12):
        state = policy.predict(observation, state)[1]
    gc.collect()
    assert blocks_held() <= before
