"""The benchmark of inverse kinematics counts poses that are met; its times are not tested."""

import numpy as np
import pytest

import ikgym
from benchmarks import pose_solvers, poses

PANDA = ikgym.arms.get("panda")


def test_poses_are_reachable_and_postures_that_miss_do_not_count():
    drawn = poses.random_poses(PANDA, 4)
    q = PANDA.inverse(drawn[:, :3, :3], drawn[:, :3, 3])[0]
    np.testing.assert_array_equal(poses.met(PANDA, drawn, q), [True] * 4)
    q[0, 0] += 1e-3
    q[1] = np.nan
    q[2, 3] += 2 * np.pi  # the same pose, outside the limits
    np.testing.assert_array_equal(poses.met(PANDA, drawn, q), [False, False, False, True])


def test_time_is_shared_by_the_poses_that_are_met():
    drawn = poses.random_poses(PANDA, 20)

    def half(given):
        q = PANDA.inverse(given[:, :3, :3], given[:, :3, 3])[0]
        q[::2] = np.nan
        return q

    (share, seconds), (whole, _) = poses.measured(
        PANDA, {"half": half, "all": pose_solvers.together(PANDA)}, drawn
    ).values()
    assert share == 0.5
    assert whole == 1.0
    assert seconds > 0.0


@pytest.mark.parametrize("label", [*pose_solvers.OURS, *pose_solvers.RIVALS])
@pytest.mark.parametrize("name", poses.ARMS)
def test_every_solver_meets_poses_of_the_very_arm(name, label):
    arm = ikgym.arms.get(name)
    try:
        solve = {**pose_solvers.OURS, **pose_solvers.RIVALS}[label](arm)
    except ImportError:
        pytest.skip("pip install ikgym[rivals]")
    drawn = poses.random_poses(arm, 5)
    assert poses.met(arm, drawn, solve(drawn)).mean() >= 0.8
