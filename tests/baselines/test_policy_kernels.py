"""What the steps of all policies share: every number is looked at, and nothing that is returned is used again."""

from __future__ import annotations

import gc

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import baselines
import ikgym
from baselines.policy_kernels import all_finite
from ikgym.exceptions import InvalidInputError

COMPILED = ["dls", "moore_penrose", "null_space", "gram_schmidt", "jacobian_transpose", "broyden", "rhc"]


def shown(preview, rows=None):
    env = ikgym.RedundantIKEnv("varga7-fast", preview=preview)
    observation, _ = env.reset(seed=0)
    return observation if rows is None else {key: np.stack([value] * rows) for key, value in observation.items()}


@pytest.mark.parametrize("value", [np.nan, -np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("key", ["q", "qdot", "pose", "nominal", "remaining"])
def test_any_number_that_is_not_finite_is_found(key, value):
    parts = {key: part.copy() for key, part in shown(40, rows=2).items()}
    assert all_finite(*parts.values())
    parts[key].flat[-1] = value
    assert not all_finite(*parts.values())
    parts[key].flat[-1] = np.copysign(np.finfo(float).max, value)
    assert all_finite(*parts.values())


@pytest.mark.parametrize("rows", [None, 3])
@pytest.mark.parametrize("name", ["dls", "rhc"])
@pytest.mark.parametrize("key", ["q", "qdot", "pose", "nominal", "remaining"])
def test_compiled_solvers_refuse_it(name, key, rows):
    policy = baselines.make(name, "varga7-fast")
    observation = shown(policy.preview, rows)
    _, state = policy.predict(observation)
    kept = [array.copy() for array in state]
    observation[key] = observation[key].copy()
    observation[key].flat[-1] = np.nan
    with pytest.raises(InvalidInputError, match="observation: expected finite numbers, got NaN or infinity"):
        policy.predict(observation, state)
    assert all((a == b).all() for a, b in zip(kept, state, strict=True))


@pytest.mark.parametrize("name", COMPILED)
def test_what_is_returned_is_fresh(name):
    policy = baselines.make(name, "varga7-fast")
    observation = shown(policy.preview)
    first, state = policy.predict(observation)
    second, after = policy.predict(observation, state)
    returned = [first, *state[2:], second, *after[2:]]
    for k, array in enumerate(returned):
        assert all(not np.shares_memory(array, other) for other in (*returned[k + 1 :], *observation.values()))
        assert array.flags.writeable


@pytest.mark.parametrize("name", COMPILED)
def test_no_rows_are_a_batch(name):
    policy = baselines.make(name, "varga7-fast")
    nothing = {key: value[:0] for key, value in shown(policy.preview, rows=1).items()}
    action, state = policy.predict(nothing)
    assert action.shape == (0, 7)
    assert all(len(array) == 0 for array in policy.predict(nothing, state)[1])


@pytest.fixture
def blocks_held():
    """How many blocks of memory compiled code has allocated and not freed; counted in this test."""
    _nrt_python.memsys_enable_stats()
    yield lambda: rtsys.get_allocation_stats().mi_alloc - rtsys.get_allocation_stats().mi_free
    _nrt_python.memsys_disable_stats()


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("rhc", {"horizon": 3, "rate_weight": 1e-3}),
        ("rhc", {"horizon": 4, "starts": 2, "restart_steps": 3, "iterations": 1, "recovery_steps": 2}),
        ("rhc_foresight", {"horizon": 41}),
    ],
)
def test_nothing_is_left_behind(blocks_held, name, parameters):
    """Kernels that do not count references would lose those of arrays that others give them."""
    policy = baselines.make(name, "varga7-fast", **parameters)
    observation = shown(policy.preview)
    state = policy.predict(observation)[1]
    before = blocks_held()
    for _ in range(12):
        state = policy.predict(observation, state)[1]
    gc.collect()
    assert blocks_held() <= before
