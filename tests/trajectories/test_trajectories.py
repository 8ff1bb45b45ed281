"""Nominal trajectories against the papers' formulas."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ikgym
from ikgym.trajectories import RandomJointSpline, Sinusoid, first_joints_of, frames_of
from tests.comparison import identical

TIMES = np.linspace(0, 7, 57)
VARGA = np.array([0.8, 1.0, 1.2, 1.4, 1.6, 1.8, 2.0])


def path(scenario):
    return ikgym.scenarios.get(scenario).trajectory.joint_path(TIMES)


def test_varga_fast_and_slow():
    """Eq. 11, and eq. 12 with the sigmoid x / (1 + |x|)."""
    wave = np.sin(3 * TIMES)[:, None]
    np.testing.assert_allclose(path("varga7-fast"), VARGA * wave, atol=1e-15)
    inner = 0.5 * VARGA * wave
    np.testing.assert_allclose(path("varga7-slow"), 0.3 * inner / (1 + abs(inner)), atol=1e-15)


def test_faitli():
    t = TIMES
    for name, columns in {
        "stretched": [np.sin(t), 0.3 + 0.5 * np.sin(2 * t), 0.2 + 0.8 * np.sin(3 * t + 0.5)],
        "regular": [np.sin(t), 0.3 + 0.5 * np.sin(2 * t), 1 + 0.5 * np.sin(3 * t)],
        "shoulder": [0.5 * np.sin(t), -0.8 - 0.7 * np.sin(t), -1 + 0.3 * np.sin(2 * t)],
    }.items():
        np.testing.assert_allclose(path(f"faitli3-{name}"), np.column_stack(columns), atol=1e-14)


def test_khan():
    q1, q7q8 = path("khan8-q1"), path("khan8-q7q8")
    np.testing.assert_allclose(q1[:, 0], 0.5 * np.sin(TIMES))
    assert not q1[:, 1:].any()
    np.testing.assert_allclose(q7q8[:, 6:], 0.5 * np.column_stack([np.sin(TIMES), np.sin(2 * TIMES)]))
    assert not q7q8[:, :6].any()


def test_zhang_helix():
    """Sample k of the paper, counted from 1, is point k - 1."""
    nominal = ikgym.scenarios.get("zhang3-helix").nominal()
    k = np.arange(1, 801)
    wanted = np.column_stack([4 + 3 * np.sin(np.pi * k / 50), 3 * np.cos(np.pi * k / 50), 5 + k / 200])
    np.testing.assert_allclose(nominal, wanted, atol=1e-12)


class TestStraightLine:
    scenario = ikgym.scenarios.get("zhang6-lspb")
    line = scenario.trajectory
    times = np.linspace(-0.1, 2.5, 2601)

    def test_progress_is_parabola_line_parabola(self):
        share = self.line.progress(self.times)
        assert share[0] == 0.0
        assert share[-1] == 1.0
        rate = np.gradient(share, self.times)
        bend = np.gradient(rate, self.times)
        moving = (self.times > 0.51) & (self.times < 1.49)
        np.testing.assert_allclose(rate[moving], 1 / 1.5, rtol=1e-9)
        inside = (self.times > 0.01) & (self.times < 0.49)
        np.testing.assert_allclose(bend[inside], 1 / 1.5 / 0.5, rtol=1e-6)
        assert (np.diff(share) >= -1e-15).all()

    def test_ends_are_the_papers_configurations(self):
        arm = self.scenario.arm
        frames = self.line.frames(np.array([0.0, 2.0, 9.0]), arm)
        for frame, q1 in zip(frames, [-np.pi / 4, np.pi / 4, np.pi / 4], strict=True):
            rotation, position = arm.forward([q1, np.pi / 6, 0, 0, -np.pi / 4, 0])
            np.testing.assert_allclose(frame, [*rotation.ravel(), *position], atol=1e-14)

    def test_straight_and_about_one_axis(self):
        frames = self.line.frames(np.linspace(0, 2, 41), self.scenario.arm)
        positions, turns = frames[:, 9:], Rotation.from_matrix(frames[:, :9].reshape(-1, 3, 3))
        along = positions[-1] - positions[0]
        np.testing.assert_allclose(np.cross(positions - positions[0], along), 0, atol=1e-14)
        vectors = (turns * turns[0].inv()).as_rotvec()
        np.testing.assert_allclose(np.cross(vectors, vectors[-1]), 0, atol=1e-13)
        assert np.linalg.norm(vectors[-1]) == pytest.approx(np.pi / 2)


class TestRandom:
    random = ikgym.scenarios.get("varga7-random").trajectory

    def test_distribution(self):
        """Amplitudes A_i U(0.2, 1), frequencies U(1, 3) rad/s, phases U(0, 2π)."""
        rng = np.random.default_rng(0)
        drawn = [self.random.sample(rng) for _ in range(2000)]
        for values, low, high in [
            (np.array([d.amplitude for d in drawn]) / VARGA, 0.2, 1.0),
            (np.array([d.frequency for d in drawn]), 1.0, 3.0),
            (np.array([d.phase for d in drawn]), 0.0, 2 * np.pi),
        ]:
            assert values.min() >= low
            assert values.max() <= high
            np.testing.assert_allclose(values.mean(axis=0), (low + high) / 2, rtol=0.05)
            np.testing.assert_allclose(values.std(axis=0), (high - low) / 12**0.5, rtol=0.05)


@pytest.mark.parametrize("name", [*ikgym.scenarios.names(), "rlitg-random"])
def test_reach_bounds_the_positions(name):
    scenario = ikgym.scenarios.get(name)
    times = scenario.times(3000)
    drawn = scenario.trajectory.sample(np.random.default_rng(1))
    farthest = np.linalg.norm(drawn.frames(times, scenario.model)[:, -3:], axis=1).max()
    assert farthest <= scenario.trajectory.reach(times, scenario.model) * (1 + 1e-12)


class Shaken(Sinusoid):
    """Inherits all of it but the path."""

    def joint_path(self, times):
        return super().joint_path(times) + 0.1 * times[:, None]


@pytest.mark.parametrize("kinds", ["drawn", "bent", "shaken", "mixed", "splines"])
def test_frames_of_many_are_those_of_each(kinds):
    """Splines are also drawn together as each alone."""
    arm = ikgym.arms.get("varga7")
    rng = np.random.default_rng(2)
    random = ikgym.scenarios.get("varga7-random").trajectory
    drawn = [random.sample(rng).replace(offset=rng.uniform(-1, 1, 7)) for _ in range(5)]
    bent = [sinusoid.replace(sigmoid=0.1 + 0.1 * i) for i, sinusoid in enumerate(drawn)]
    shaken = [Shaken(s.amplitude, s.frequency, s.phase) for s in drawn]
    line = ikgym.scenarios.get("zhang6-lspb").trajectory
    mixed = [drawn[0], bent[1], line, shaken[2], drawn[3]]
    spline = RandomJointSpline(-np.ones(7), np.ones(7), np.ones(7), np.ones(7), 2.0)
    splines = spline.samples([np.random.default_rng(seed) for seed in range(5)])
    assert all(
        identical(one.control, spline.sample(np.random.default_rng(seed)).control) for seed, one in enumerate(splines)
    )
    trajectories = {"drawn": drawn, "bent": bent, "shaken": shaken, "mixed": mixed, "splines": splines}[kinds]
    times = rng.uniform(0.0, 9.0, (5, 13))
    many = frames_of(trajectories, times, arm)
    for frames, trajectory, row in zip(many, trajectories, times, strict=True):
        assert identical(frames, trajectory.frames(row, arm))
    if kinds == "splines":
        first = np.array([spline.joint_path(np.zeros(1))[0] for spline in splines])
        assert identical(first_joints_of(splines), first)
