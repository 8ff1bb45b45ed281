"""Random motions within limits: what is drawn is feasible, and the arm that follows it is never held back."""

import numpy as np
import pytest

import ikgym
from ikgym.trajectories import RandomJointSpline

DT = 0.002
ARM = ikgym.arms.get("varga7").replace(
    lower=np.linspace(-2.8, -0.1, 7),
    upper=np.linspace(0.5, 3.7, 7),
    velocity_limit=np.linspace(0.3, 2.5, 7),
    acceleration_limit=np.linspace(20.0, 5.0, 7),
)
RANDOM = RandomJointSpline.within(ARM, 2.0)


def drawn(count, random=RANDOM):
    return random.samples([np.random.default_rng(seed) for seed in range(count)])


def used(random, times):
    """Shares of the limits that 500 draws use: positions (0 to 1), velocities and accelerations. Shapes (500, …, 7)."""
    paths = np.array([motion.joint_path(times) for motion in drawn(500, random)])
    velocities = np.diff(paths, axis=1) / np.diff(times)[:, None]
    accelerations = np.diff(velocities, axis=1) / np.diff(times)[1:, None]
    positions = (paths - ARM.lower) / (ARM.upper - ARM.lower)
    return positions, np.abs(velocities) / ARM.velocity_limit, np.abs(accelerations) / ARM.acceleration_limit


@pytest.mark.parametrize(("margin", "spans"), [(0.0, 3), (0.0, 15), (0.1, 8), (0.5, 15)])
def test_all_limits_are_kept_by_the_margin_and_used(margin, spans):
    random = RANDOM.replace(margin=margin, spans=spans, scale=(1.0, 1.0))
    times = np.arange(-5, int(random.duration / DT) + 5) * DT
    positions, velocities, accelerations = used(random, times)
    assert positions.min() >= 0.5 * margin - 1e-12
    assert positions.max() <= 1.0 - 0.5 * margin + 1e-12
    assert velocities.max() <= 1.0 - margin + 1e-9
    assert accelerations.max() <= 1.0 - margin + 1e-6
    nearest = [1.0 - positions.max(), positions.min(), 1.0 - velocities.max(), 1.0 - accelerations.max()]
    assert min(nearest) < 0.5 * margin + 0.15, "no limit is ever approached"


def test_from_rest_to_rest():
    times = np.array([-1.0, 0.0, 1e-3, 2e-3, 1.998, 1.999, 2.0, 9.0])
    for motion in drawn(20):
        path = motion.joint_path(times)
        np.testing.assert_allclose(path[0], path[1], atol=0)
        np.testing.assert_allclose(path[-1], path[-2], atol=0)
        # A motion with no velocity and no acceleration at its ends begins with t³.
        for near, nearer in [(path[3] - path[0], path[2] - path[0]), (path[4] - path[-1], path[5] - path[-1])]:
            np.testing.assert_allclose(near, 8 * nearer, rtol=1e-6, atol=1e-13)
        assert np.abs(path[1] - path[-1]).max() > 1e-3
        assert (np.abs(path) <= RANDOM.joint_bound()).all()


def test_motions_fill_the_range():
    starts = np.array([motion.control[0] for motion in drawn(2000)])
    share = (starts - ARM.lower) / (ARM.upper - ARM.lower)
    np.testing.assert_allclose(share.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_allclose(share.std(axis=0), 0.9 / 12**0.5, rtol=0.05)
