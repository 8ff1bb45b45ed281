"""Time laws and orientation laws on paths: at rest at both ends, within their limits in between."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import ikgym
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories import (
    AlongPath,
    FixedOrientation,
    OrientationThrough,
    PathTrajectory,
    Quintic,
    Trapezoidal,
    Turning,
)
from ikgym.trajectories.paths import Line
from ikgym.trajectories.time_laws import TIME_LAWS
from tests.trajectories.test_paths import EXAMPLES, every_path

ARM = ikgym.arms.get("varga7")
LINE = Line([0, 0, 0], [1, 0, 0])
DOWN = Rotation.from_euler("x", np.pi).as_matrix()
SPEED, ACCELERATION = 0.5, 2.0
every_law = pytest.mark.parametrize("law", TIME_LAWS.values(), ids=TIME_LAWS)


def motion(trajectory, dt=2e-3):
    """Positions from a little before the start until a little after the end, velocities and accelerations."""
    times = np.arange(-5, int(trajectory.duration / dt) + 10) * dt
    positions = trajectory.frames(times, ARM)[:, -3:]
    velocities = np.diff(positions, axis=0) / dt
    return positions, velocities, np.diff(velocities, axis=0) / dt


@every_path
@every_law
@pytest.mark.parametrize("slower", [None, 1.3])
def test_from_rest_to_rest_within_speed_and_acceleration(path, law, slower):
    trajectory = PathTrajectory(path, law(SPEED, ACCELERATION))
    shortest = trajectory.duration
    if slower is not None:
        trajectory = trajectory.replace(time_law=law(SPEED, ACCELERATION, slower * shortest))
        assert trajectory.duration == slower * shortest
    positions, velocities, accelerations = motion(trajectory)
    np.testing.assert_allclose(positions[[0, -1]], path.along(np.array([0.0, path.length]))[0], atol=1e-14)
    assert not velocities[[0, 1, -2, -1]].any()
    assert np.linalg.norm(velocities, axis=1).max() <= SPEED * (1 + 1e-9)
    assert np.linalg.norm(accelerations, axis=1).max() <= ACCELERATION * (1 + 1e-4)


def test_the_shortest_times():
    """Trapezoid: L / v + v / a, or 2 √(L / a) without a cruise; quintic: 15/8 L / v, or √(10 / √3 L / a)."""
    for law, wanted in {
        Trapezoidal(0.5, 2.0): 2.25,
        Trapezoidal(50.0, 4.0): 1.0,
        Quintic(0.5, 2.0): 3.75,
        Quintic(50.0, 10.0 / 3**0.5): 1.0,
    }.items():
        assert law.time(LINE) == pytest.approx(wanted, rel=1e-14)
        _, velocities, accelerations = motion(PathTrajectory(LINE, law), 1e-4)
        used = [np.abs(velocities).max() / law.speed, np.abs(accelerations).max() / law.acceleration]
        assert max(used) == pytest.approx(1.0, rel=1e-5)


def test_a_quintic_has_no_jump_in_its_acceleration():
    for law, jump in {Quintic(0.5, 2.0): 0.01, Trapezoidal(0.5, 2.0): 2.5}.items():
        accelerations = motion(PathTrajectory(LINE, law))[2]
        largest = np.abs(np.diff(accelerations, axis=0)).max()
        assert largest < jump
        assert largest > jump / 10


@every_path
def test_along_the_path(path):
    tool = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
    law = AlongPath(approach=[0.2, 0.3, -2.0], rotation=tool)
    s = np.linspace(0.0, path.length, 301)
    frame = law.rotations(path, s) @ tool.T
    tangents = path.along(s)[1]
    np.testing.assert_allclose(frame[:, :, 0], tangents, atol=1e-14)
    np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (301, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0)
    # In the plane of tangent and approach, and on its side.
    np.testing.assert_allclose(np.cross(tangents, law.approach)[:, None] @ frame[:, :, 2:], 0.0, atol=1e-13)
    assert (frame[:, :, 2] @ law.approach > 0.0).all()


def test_fixed_and_turning():
    s = np.linspace(0.0, 1.0, 11)
    np.testing.assert_array_equal(FixedOrientation(DOWN).rotations(LINE, s), np.tile(DOWN, (11, 1, 1)))
    vector = np.array([0.0, 3.0, 6.0])
    turned = Turning(DOWN, vector).rotations(LINE, s)
    wanted = Rotation.from_rotvec(s[:, None] * vector).as_matrix() @ DOWN
    np.testing.assert_allclose(turned, wanted, atol=1e-14)
    np.testing.assert_array_equal(Turning(DOWN, np.zeros(3)).rotations(LINE, s)[5], DOWN)


@pytest.mark.parametrize("path", [EXAMPLES["spline"], EXAMPLES["polyline"]], ids=["spline", "polyline"])
def test_orientations_through_quaternions(path):
    turns = Rotation.from_rotvec(np.random.default_rng(1).uniform(-0.8, 0.8, (6, 3)))
    quaternions = turns.as_quat(scalar_first=True) * np.array([1, -1, 1, 1, -1, 1])[:, None]  # a sign means nothing
    law = OrientationThrough(quaternions)
    np.testing.assert_allclose(law.rotations(path, path.stations), turns.as_matrix(), atol=1e-12)
    dense = law.rotations(path, np.linspace(0.0, path.length, 5001))
    np.testing.assert_allclose(dense @ dense.transpose(0, 2, 1), np.tile(np.eye(3), (5001, 1, 1)), atol=1e-13)
    rates = np.diff(dense, axis=0) * 5000
    assert np.abs(np.diff(rates, axis=0)).max() < 0.02 * np.abs(rates).max(), "the turning has a kink"


def test_only_with_an_orientation_is_there_one():
    pose = ikgym.tasks.get("pose")
    for orientation in (None, FixedOrientation(DOWN)):
        trajectory = PathTrajectory(LINE, Quintic(0.5, 2.0), orientation)
        for one in (trajectory, trajectory.replace(path=EXAMPLES["circle"])):
            assert one.has_orientation is (orientation is not None)
            assert one.frames(np.zeros(2), ARM).shape == (2, 12 if orientation else 3)
    with pytest.raises(InvalidInputError, match="task 'pose' needs orientations, the trajectory has none"):
        ikgym.Scenario("x", ARM, pose, PathTrajectory(LINE, Quintic(1.0, 1.0)), 1.0, start=np.zeros(7))
