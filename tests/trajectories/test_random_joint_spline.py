"""Random motions within limits: what is drawn is feasible, and the arm that follows it is never held back."""

import gymnasium as gym
import numpy as np
import pytest

import ikgym
from ikgym.trajectories import RandomJointSpline, first_joints_of, frames_of
from tests.comparison import identical

DT = 0.002
ARM = ikgym.arms.get("varga7").replace(
    lower=np.linspace(-2.8, -0.1, 7),
    upper=np.linspace(0.5, 3.7, 7),
    velocity_limit=np.linspace(0.3, 2.5, 7),
    acceleration_limit=np.linspace(20.0, 5.0, 7),
)
RANDOM = RandomJointSpline.within(ARM, 2.0)
SCENARIO = ikgym.Scenario("x", ARM, ikgym.tasks.get("pose"), RANDOM, dt=DT, steps=1010)


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


def test_motions_fill_the_range():
    starts = np.array([motion.control[0] for motion in drawn(2000)])
    share = (starts - ARM.lower) / (ARM.upper - ARM.lower)
    np.testing.assert_allclose(share.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_allclose(share.std(axis=0), 0.9 / 12**0.5, rtol=0.05)


def test_the_draw_is_the_certificate():
    """An arm that is sent along the drawn joint motion follows the path of the tool, and no limit holds it back."""
    env = gym.make("RedundantIK-v0", scenario=SCENARIO)
    for seed in (1, 2, 3):
        path = SCENARIO.nominal_joint_path(seed)
        observation, _ = env.reset(seed=seed)
        np.testing.assert_array_equal(observation["q"], path[0])
        held = error = 0.0
        for k in range(SCENARIO.steps):
            qdot = (path[k + 1] - observation["q"]) / DT
            observation, _, _, _, info = env.step(qdot / SCENARIO.velocity_limit)
            held, error = held + info["at_limit"].sum(), max(error, info["position_error"])
        assert held == 0
        assert error < 1e-6


def test_many_are_drawn_as_each_alone():
    motions = drawn(5)
    for seed, motion in enumerate(motions):
        alone = RANDOM.sample(np.random.default_rng(seed))
        assert identical(alone.control, motion.control)
    times = np.random.default_rng(9).uniform(-0.5, 3.0, (5, 13))
    many = frames_of(motions, times, ARM)
    for frames, motion, row in zip(many, motions, times, strict=True):
        assert identical(frames, motion.frames(row, ARM))
    first = first_joints_of(motions)
    assert identical(first, np.array([motion.joint_path(np.zeros(1))[0] for motion in motions]))
