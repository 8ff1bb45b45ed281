"""The tables of speed measure what they say; times are not tested."""

import numpy as np
import pinocchio as pin
import pytest

import ikgym
from docs import calls, environments, inverse, kinematics
from docs.timing import medians

PANDA = ikgym.arms.get("panda")


@pytest.mark.parametrize("measured", [lambda: environments.measure((3,), rounds=1, seconds=0.0), kinematics.measure])
def test_tables_of_medians(measured):
    table = measured()
    assert len(table) >= 4
    assert all(list(line.values())[-1] > 0.0 for line in table)


def test_calls_of_a_library_are_parts_of_predict():
    table = calls.measure(steps=3, turns=1)
    assert [line["policy"] for line in table] == [policy for policy, *_ in calls.CASES]
    for line in table:
        assert (line["library_us"] is not None) == (line["policy"] in ("pink", "mink"))
        assert line["predict_us"] > 0.0
        assert line["step_us"] > 0.0


@pytest.mark.parametrize(("seconds", "least"), [(0.0, 1 + 1 + 3), (1e-5, 6)])
def test_medians_are_of_the_calls(seconds, least):
    """One before anything is timed, one that is, and a turn is at least one call."""
    made = []
    times = medians({name: lambda name=name: made.append(name) for name in "ab"}, rounds=3, seconds=seconds)
    assert all(times[name] > 0 and made.count(name) >= least for name in "ab")


def test_both_kinematics_are_of_one_arm():
    arm = ikgym.arms.get("varga7")
    model, frame = kinematics.pinocchio_model(arm)
    q, data = np.random.default_rng(0).uniform(-1, 1, 7), model.createData()
    pin.framesForwardKinematics(model, data, q)
    np.testing.assert_allclose(data.oMf[frame].translation, arm.forward(q)[1], atol=1e-12)


def test_postures_that_miss_their_poses_do_not_count():
    poses = inverse.random_poses(PANDA, 4)
    q = PANDA.inverse(poses[:, :3, :3], poses[:, :3, 3])[0]
    np.testing.assert_array_equal(inverse.meet(PANDA, poses, q), [True] * 4)
    q[0, 0] += 1e-3
    q[1] = np.nan
    q[2, 3] += 2 * np.pi  # the same pose, outside the limits
    np.testing.assert_array_equal(inverse.meet(PANDA, poses, q), [False, False, False, True])
    solve = inverse.batch(PANDA)
    half = lambda given: np.where(given[:, :1, 3] > np.median(poses[:, 0, 3]), solve(given), np.nan)  # noqa: E731
    table = inverse.compare(PANDA, {"half": half, "all": solve}, poses)
    assert [line["met_percent"] for line in table] == [50.0, 100.0]
    assert all(line["met_pose_us"] > 0.0 for line in table)


@pytest.mark.parametrize("label", inverse.SOLVERS)
@pytest.mark.parametrize("name", inverse.ARMS)
def test_every_solver_meets_poses_of_the_very_arm(name, label):
    arm = ikgym.arms.get(name)
    try:
        solve = inverse.SOLVERS[label](arm)
    except ImportError:
        pytest.skip("pip install ikgym[rivals]")
    poses = inverse.random_poses(arm, 5)
    assert inverse.meet(arm, poses, solve(poses)).mean() >= 0.8
