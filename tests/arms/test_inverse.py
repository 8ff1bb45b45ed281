import numpy as np
import pytest

from ikgym import arms
from ikgym.arms import Arm
from ikgym.arms.inverse import LENGTH_OF_RADIAN
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.inverse_kinematics import Ranges, Work, _step
from ikgym.kernels.rotations import geodesic_angle
from tests.arms.drawing import postures

EVERY = arms.names()
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


@pytest.mark.parametrize("name", EVERY)
def test_reachable_poses_are_met_within_the_limits(name):
    arm = arms.get(name)
    rotation, position = arm.forward(postures(arm, 200, seed=1))
    q, converged = arm.inverse(rotation, position)
    check(arm, rotation, position, q, converged)
    assert converged.mean() >= 0.99


@pytest.mark.parametrize("name", ["zhang3", "faitli3", "panda", "fetch"])
def test_positions_alone_are_met(name):
    arm = arms.get(name)
    position = arm.forward(postures(arm, 200, seed=2))[1]
    q, converged = arm.inverse(None, position)
    check(arm, None, position, q, converged)
    assert converged.all()


def test_an_arm_of_three_joints_meets_a_pose_only_where_it_happens_to_reach_it():
    arm = arms.get("zhang3")
    rotation, position = arm.forward([0.3, 0.5, -0.4])
    assert arm.inverse(rotation, position)[1]
    tilted = rotation @ arms.get("zhang3").forward([0.0, 0.1, 0.0])[0]
    q, converged = arm.inverse(tilted, position, restarts=5)
    assert not converged
    assert np.isfinite(q).all()


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


def test_a_joint_at_its_limit_stays_there_and_the_others_go_on():
    q = PANDA.home.copy()
    q[3] = PANDA.upper[3]
    rotation, position = PANDA.forward(q)
    found, converged = PANDA.inverse(rotation, position)
    assert converged
    check(PANDA, rotation[None], position[None], found[None], np.array([converged]))


def test_what_a_joint_at_its_limit_lacks_is_made_up_for_by_the_others():
    posture = postures(PANDA, 1, seed=10)[0]
    jacobian = PANDA.jacobian(posture)
    error = jacobian @ np.full(7, 0.01)
    free, upper = np.full(7, np.inf), np.where(np.arange(7) == 3, posture + 1e-4, np.inf)
    steps = []
    for ranges in (Ranges(-free, free, -free, free), Ranges(-free, upper, -free, free)):
        arrays = np.empty((3, 3)), np.empty(3), jacobian.copy(), error.copy(), np.empty((6, 6)), np.empty(6)
        work = Work(posture.copy(), np.empty(7), *arrays)
        _step(ranges, 1e-12, work)
        steps.append(work.q - posture)
        np.testing.assert_allclose(jacobian @ steps[-1], error, atol=1e-8)
    assert steps[0][3] > 1e-3
    assert steps[1][3] == pytest.approx(1e-4, abs=1e-12)


def test_more_restarts_never_lead_farther_away():
    arm = arms.get("iiwa14")
    rotation, position = arm.forward(postures(arm, 40, seed=9))
    length = LENGTH_OF_RADIAN * arm.reach(np.zeros(7))
    squares = []
    for restarts in (0, 4, 8):
        q, converged = arm.inverse(rotation, 2.5 * position, restarts=restarts)
        turned, there = arm.forward(q)
        angles = np.array([geodesic_angle(*pair) for pair in zip(turned, rotation, strict=True)])
        squares.append(np.sum((there - 2.5 * position) ** 2, axis=1) + (length * angles) ** 2)
        assert not converged.all()
    assert (squares[1] <= squares[0] + 1e-12).all()
    assert (squares[2] <= squares[1] + 1e-12).all()
    assert (squares[2] < squares[0] - 1e-3).any()


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


def test_shapes_are_broadcast():
    rotation, position = PANDA.forward(postures(PANDA, 6, seed=8).reshape(2, 3, 7))
    q, converged = PANDA.inverse(rotation[0, 0], position, start=PANDA.home)
    assert q.shape == (2, 3, 7)
    assert converged.shape == (2, 3)
    assert PANDA.inverse(np.empty((0, 3, 3)), np.empty((0, 3)))[0].shape == (0, 7)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"rotation": np.eye(4)}, r"rotation: expected shape \(\.\.\., 3, 3\), got \(4, 4\)"),
        ({"rotation": 2 * np.eye(3)}, r"rotation: expected a rotation matrix .* got \[\[2\.0, 0\.0"),
        ({"rotation": np.diag([1.0, 1, -1])}, "rotation: expected a rotation matrix"),
        ({"rotation": np.full((3, 3), np.nan)}, "rotation: expected finite numbers"),
        ({"rotation": "up"}, "rotation: expected an array of real numbers, got 'up'"),
        ({"position": [0.1, 0.2]}, r"position: expected shape \(\.\.\., 3\), got \(2,\)"),
        ({"position": [0.1, 0.2, np.inf]}, "position: expected finite numbers"),
        ({"start": np.zeros(6)}, r"start: expected shape \(\.\.\., 7\), got \(6,\)"),
        (
            {"start": np.zeros(7)},
            r"start: expected joint 3 of arm 'panda' within its limits, from -3\.0718 to -0\.0698",
        ),
        (
            {"position": np.zeros((2, 3)), "start": np.tile(PANDA.home, (3, 1))},
            r"fit together, .* \(2, 3\) and \(3, 7\)",
        ),
        ({"tolerance": 0.0}, "tolerance: expected a finite number above 0"),
        ({"restarts": -1}, "restarts: expected a whole number of at least 0"),
        ({"seed": 0.5}, "seed: expected a whole number of at least 0"),
    ],
)
def test_bad_input_is_refused(changes, message):
    given = {"rotation": np.eye(3), "position": np.array([0.4, 0, 0.4])} | changes
    with pytest.raises(InvalidInputError, match=message):
        PANDA.inverse(**given)
