"""The time grid: where its knots lie, what they count, and how a path slides along it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from baselines.solvers.receding_horizon.newton.grid import (
    evenly_growing_offsets,
    offsets,
    shift_multipliers,
    shift_path,
)
from tests.baselines.solvers.receding_horizon.data import trapezoidal_weights
from tests.baselines.solvers.receding_horizon.newton.problems import grid_of

horizons = st.integers(1, 3000).flatmap(lambda steps: st.tuples(st.just(steps), st.integers(1, steps)))


@settings(max_examples=40)
@given(horizons)
def test_offsets_rise_to_the_end_by_growing_blocks(horizon):
    steps, blocks = horizon
    at = offsets(steps, blocks)
    assert at.dtype == np.int64
    assert len(at) == blocks
    lengths = np.diff(at, prepend=0)
    assert (lengths >= 1).all()
    assert at[-1] == steps
    if blocks > 2:
        assert lengths[:2].tolist() == [1, 1]
        assert (np.diff(lengths[:-1]) >= -1).all()  # up to rounding, they grow


def test_offsets_grow_geometrically():
    assert offsets(9, 1).tolist() == [9]
    assert offsets(9, 2).tolist() == [1, 9]
    assert offsets(2 + 2 + 4 + 8 + 16, 6).tolist() == [1, 2, 4, 8, 16, 32]
    lengths = np.diff(offsets(1500, 48)).astype(float)
    ratio = lengths[21:] / lengths[20:-1]
    assert np.ptp(ratio) < 0.15


def test_evenly_growing_offsets_by_hand():
    assert evenly_growing_offsets(1, 2.0, 6.0).tolist() == [1]
    assert evenly_growing_offsets(30, 2.0, 6.0).tolist() == [1, 2, 5, 10, 16, 22, 28, 30]
    assert evenly_growing_offsets(5, 0.0, 6.0).tolist() == [1, 2, 3, 4, 5]


@settings(max_examples=40)
@given(horizons, st.integers(1, 4000), st.sampled_from([0.0, 1.0, 2.5]))
def test_cut(horizon, left, terminal):
    whole = offsets(*horizon)
    grid = grid_of(whole, left, terminal)
    end = min(horizon[0], left)
    assert grid.at.tolist() == [*whole[whole < end], end]
    np.testing.assert_array_equal(grid.length, np.diff(grid.at, prepend=0))
    np.testing.assert_array_equal(grid.velocity, grid.length)
    wanted = trapezoidal_weights(grid.at)
    if left >= horizon[0]:  # the end of an episode is none of the horizon's
        wanted[-1] *= terminal
    np.testing.assert_allclose(grid.tracking, wanted, rtol=1e-9)


def slid(old, path, new, passed=None):
    out = np.full((len(new.at), path.shape[1]), np.nan)
    shift_path(old, path, np.zeros(path.shape[1]) if passed is None else passed, new, out)
    return out


@settings(max_examples=40)
@given(horizons.filter(lambda h: h[1] > 1), st.integers(0, 2**31))
def test_a_slid_path_is_the_old_one_a_step_later(horizon, seed):
    old = grid_of(offsets(*horizon))
    path = np.random.default_rng(seed).normal(size=(len(old.at), 2))
    out = slid(old, path, old)
    inside = old.at + 1 <= old.at[-1]
    for j in range(2):
        np.testing.assert_allclose(out[inside, j], np.interp(old.at[inside] + 1, old.at, path[:, j]), atol=1e-9)


def test_a_uniform_grid_shifts_and_goes_on_as_it_ended():
    grid = grid_of(range(1, 6))
    path = np.random.default_rng(0).normal(size=(5, 3))
    out = slid(grid, path, grid)
    np.testing.assert_array_equal(out[:4], path[1:])
    np.testing.assert_allclose(out[4], 2.0 * path[4] - path[3], rtol=1e-14)
    shorter = slid(grid, path, grid_of(range(1, 6), 4))
    np.testing.assert_array_equal(shorter, path[1:])


@pytest.mark.parametrize("length", [1, 4])
def test_a_single_knot_goes_on_with_the_velocity_that_passed(length):
    grid = grid_of([length])
    out = slid(grid, np.array([[1.0, 2.0]]), grid, passed=np.array([0.1, -0.2]))
    np.testing.assert_allclose(out, [[1.1, 1.8]])


def test_multipliers_go_to_the_knot_that_takes_over():
    grid = grid_of([1, 2, 4, 8])
    multipliers = np.arange(8.0).reshape(4, 2)
    shift_multipliers(grid, multipliers, grid)  # now 2, 3, 5 and 9 steps ahead of the old start
    np.testing.assert_array_equal(multipliers[:, 0], [2.0, 4.0, 6.0, 6.0])
    uniform, shifted = grid_of(range(1, 5)), np.arange(4.0)[:, None]
    shift_multipliers(uniform, shifted, grid_of(range(1, 5), 3))
    np.testing.assert_array_equal(shifted[:3, 0], [1.0, 2.0, 3.0])
