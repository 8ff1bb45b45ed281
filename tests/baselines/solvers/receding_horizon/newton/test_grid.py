"""The time grid: where its knots lie, what they count, and how a path slides along it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from baselines.solvers.receding_horizon.newton.grid import (
    evenly_growing_offsets,
    offsets,
    shift_multipliers,
    shift_path,
)
from tests.baselines.solvers.receding_horizon.newton.problems import grid_of

horizons = st.integers(1, 3000).flatmap(lambda steps: st.tuples(st.just(steps), st.integers(1, steps)))


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
        assert (np.diff(lengths[:-1]) >= -1).all()  # but for rounding, they grow


@pytest.mark.parametrize("blocks", [None, 7, 8, 100])
def test_offsets_of_a_knot_at_each_step(blocks):
    assert offsets(7, blocks).tolist() == [1, 2, 3, 4, 5, 6, 7]


def test_offsets_grow_geometrically():
    assert offsets(9, 1).tolist() == [9]
    assert offsets(9, 2).tolist() == [1, 9]
    assert offsets(2 + 2 + 4 + 8 + 16, 6).tolist() == [1, 2, 4, 8, 16, 32]
    lengths = np.diff(offsets(1500, 48)).astype(float)
    ratio = lengths[21:] / lengths[20:-1]
    assert np.ptp(ratio) < 0.15


@given(st.integers(1, 3000), st.floats(0.1, 5.0), st.floats(1.0, 400.0))
def test_evenly_growing_offsets(steps, growth, longest):
    at = evenly_growing_offsets(steps, growth, longest)
    assert at.dtype == np.int64
    assert at[-1] == steps
    lengths = np.diff(at, prepend=0)
    assert lengths[0] == 1
    assert (lengths >= 1).all()
    assert lengths.max() <= longest + 1.0  # by rounding
    growing = np.minimum(1.0 + growth * np.arange(len(at)), longest)
    assert np.allclose(lengths[1:-1], growing[: len(at) - 2], atol=1.0)


def test_evenly_growing_offsets_by_hand():
    assert evenly_growing_offsets(1, 2.0, 6.0).tolist() == [1]
    assert evenly_growing_offsets(30, 2.0, 6.0).tolist() == [1, 2, 5, 10, 16, 22, 28, 30]
    assert evenly_growing_offsets(5, 0.0, 6.0).tolist() == [1, 2, 3, 4, 5]


def by_hand(at):
    """The trapezoidal rule written out: the error of each step lies between those of the knots around it."""
    weights, before = np.zeros(len(at)), 0
    for k, here in enumerate(at):
        for step in range(before + 1, here + 1):
            share = (step - before) / (here - before)
            weights[k] += share
            if k > 0:
                weights[k - 1] += 1.0 - share
        before = here
    return weights


@given(horizons, st.integers(1, 4000), st.sampled_from([0.0, 1.0, 2.5]))
def test_cut(horizon, left, terminal):
    whole = offsets(*horizon)
    grid = grid_of(whole, left, terminal)
    end = min(horizon[0], left)
    assert grid.at.tolist() == [*whole[whole < end], end]
    np.testing.assert_array_equal(grid.length, np.diff(grid.at, prepend=0))
    np.testing.assert_array_equal(grid.velocity, grid.length)
    wanted = by_hand(grid.at)
    if left >= horizon[0]:  # the end of an episode is none of the horizon's
        wanted[-1] *= terminal
    np.testing.assert_allclose(grid.tracking, wanted, rtol=1e-9)


@given(horizons)
def test_weights_add_up_to_the_steps(horizon):
    grid = grid_of(offsets(*horizon))
    # Of the first block, the part that belongs to the present, which nothing can change, is left out.
    assert grid.tracking.sum() == pytest.approx(horizon[0] - (grid.length[0] - 1) / 2)
    assert grid.velocity.sum() == horizon[0]
    if grid.length[0] == 1.0:
        # A cost that is linear in time is summed exactly, step by step.
        steps = np.arange(1, horizon[0] + 1)
        assert grid.tracking @ (3.0 - 0.01 * grid.at) == pytest.approx(np.sum(3.0 - 0.01 * steps), abs=1e-8)


def test_blocks_of_one_step_weigh_one():
    grid = grid_of(range(1, 6))
    np.testing.assert_array_equal(grid.tracking, 1.0)
    np.testing.assert_array_equal(grid.velocity, 1.0)


def slid(old, path, new, passed=None):
    out = np.full((len(new.at), path.shape[1]), np.nan)
    shift_path(old, path, np.zeros(path.shape[1]) if passed is None else passed, new, out)
    return out


@given(horizons.filter(lambda h: h[1] > 1), st.booleans())
def test_a_path_linear_in_time_slides_exactly(horizon, ends):
    whole = offsets(*horizon)
    old = grid_of(whole)
    new = grid_of(whole, max(horizon[0] - 1, 1)) if ends else old
    start, slope = np.array([0.3, -2.0]), np.array([1e-3, 0.7])
    path = start + slope * old.at[:, None]
    np.testing.assert_allclose(slid(old, path, new), start + slope * (new.at[:, None] + 1), rtol=1e-12, atol=1e-12)


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
