import numpy as np
import pytest

from ikgym import arms
from ikgym.arms import Arm
from ikgym.kernels.rotations import geodesic_angle
from tests.arms.drawing import postures

POSITIONED = ("zhang3", "faitli3", "panda", "fetch")
PANDA = arms.get("panda")
TOLERANCE = 1e-9


def check(arm, rotation, position, q, converged):
    """Insists that what is said to be met is met, by forward kinematics, and that all is within the limits."""
    assert np.isfinite(q).all()
    assert (q >= arm.lower).all()
    assert (q <= arm.upper).all()
    turned, there = arm.forward(q)
    distances = np.linalg.norm(there - position, axis=-1)
    assert (distances[converged] <= TOLERANCE).all()
    if rotation is not None:
        angles = np.array([geodesic_angle(*pair) for pair in zip(turned, rotation, strict=True)])
        assert (angles[converged] <= TOLERANCE).all()


@pytest.mark.parametrize(
    ("name", "turned", "share"),
    [*((name, True, 0.99) for name in arms.names()), *((name, False, 1.0) for name in POSITIONED)],
)
def test_reachable_poses_and_positions_are_met_within_the_limits(name, turned, share):
    arm = arms.get(name)
    rotation, position = arm.forward(postures(arm, 200, seed=1))
    rotation = rotation if turned else None
    q, converged = arm.inverse(rotation, position)
    check(arm, rotation, position, q, converged)
    assert converged.mean() >= share


def test_poses_out_of_reach_are_said_not_to_be_met():
    rotation, position = PANDA.forward(PANDA.home)
    positions = position + np.array([[2.0, 0, 0], [0, 0, 0], [0, 0, -3.0]])
    q, converged = PANDA.inverse(rotation, positions, restarts=3)
    np.testing.assert_array_equal(converged, [False, True, False])
    check(PANDA, np.repeat(rotation[None], 3, axis=0), positions, q, converged)


def test_limits_make_poses_unreachable():
    free = Arm("two", [[0, 0, 1], [1, 0, 0]], [[0, 0, 1], [0, 0, 1]], tool=[1, 0, 0])
    held = free.replace(lower=[-0.1, -0.1], upper=[0.1, 0.1])
    position = free.forward([1.0, 0.5])[1]
    assert free.inverse(None, position)[1]
    q, converged = held.inverse(None, position)
    assert not converged
    # The nearest that it can do is to turn both joints as far as they go.
    np.testing.assert_allclose(q, [0.1, 0.1], atol=1e-6)


def test_a_near_start_gives_a_near_answer():
    q = postures(PANDA, 50, seed=4)
    start = np.clip(q + 1e-3, PANDA.lower, PANDA.upper)
    found, converged = PANDA.inverse(*PANDA.forward(q), start=start)
    assert converged.all()
    assert np.abs(found - start).max() < 0.05


@pytest.mark.parametrize("name", ["xarm7", "gen3", "varga7"])
def test_joints_end_within_half_a_turn_of_the_start_where_limits_allow(name):
    arm = arms.get(name)
    start = np.clip(np.full(arm.joints, 5.0), arm.lower, arm.upper)
    q, converged = arm.inverse(*arm.forward(postures(arm, 50, seed=5)), start=start)
    assert converged.all()
    turns = (q - start) / (2 * np.pi) * ~np.array(arm.prismatic)
    there = q - 2 * np.pi * np.round(turns)
    assert not ((np.abs(turns) > 0.5) & (there >= arm.lower) & (there <= arm.upper)).any()


def test_a_row_of_a_batch_is_the_single_call_bit_for_bit():
    rotation, position = PANDA.forward(postures(PANDA, 300, seed=6))
    q, converged = PANDA.inverse(rotation, position)
    for row in range(0, 300, 29):
        single, met = PANDA.inverse(rotation[row], position[row])
        np.testing.assert_array_equal(single, q[row])
        assert met == converged[row]
        assert single.shape == (7,)
        assert np.shape(met) == ()


def test_the_seed_alone_decides_the_restarts():
    rotation, position = PANDA.forward(postures(PANDA, 200, seed=7))
    one, again, other = (PANDA.inverse(rotation, position, seed=seed)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, again)
    assert (one != other).any()
    first = PANDA.inverse(rotation, position, restarts=0)
    assert 0.5 < first[1].mean() < 1.0
