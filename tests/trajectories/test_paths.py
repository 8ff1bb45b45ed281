"""Paths: their arc length, direction and curvature, and the figures they are meant to be."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from ikgym.trajectories.paths import (
    PATHS,
    Circle,
    CircularHelix,
    Lemniscate,
    Line,
    Polyline,
    Raster,
    SplinePath,
    Square,
)

CENTER, PLACED = np.array([0.4, -0.2, 0.3]), Rotation.from_rotvec([0.3, 0.2, -1.0]).as_matrix()
POINTS = np.random.default_rng(0).uniform(-1, 1, (6, 3))
EXAMPLES = {
    "line": Line([0, 0, 0], [1, 2, 0.5]),
    "circle": Circle(CENTER, 0.3, turns=1.0, rotation=PLACED),
    "helix": CircularHelix(CENTER, 0.3, 0.1, turns=2.5, rotation=PLACED),
    "lemniscate": Lemniscate(CENTER, 0.2, rotation=PLACED),
    "square": Square(CENTER, 0.3, 0.02, rotation=PLACED),
    "raster": Raster(CENTER, 0.3, 0.2, 5, 0.02, rotation=PLACED),
    "polyline": Polyline(POINTS, 0.05),
    "spline": SplinePath(POINTS),
}
every_path = pytest.mark.parametrize("path", EXAMPLES.values(), ids=EXAMPLES)


def seen(path, points):
    """Points in the frame of a placed figure."""
    return (points - path.center) @ path.rotation


def test_every_path_has_its_example():
    assert {name: type(path) for name, path in EXAMPLES.items()} == PATHS


@every_path
def test_the_parameter_is_the_arc_length(path):
    s = np.linspace(0.0, path.length, 20001)
    points, tangents = path.along(s)
    np.testing.assert_allclose(np.linalg.norm(tangents, axis=1), 1.0, atol=1e-12)
    rate = np.diff(points, axis=0) / s[1]
    # A chord is shorter than its arc by κ² s² / 24, and leads as the path does in its middle.
    np.testing.assert_allclose(np.linalg.norm(rate, axis=1), 1.0, atol=1e-8 + (path.curvature * s[1]) ** 2 / 20)
    np.testing.assert_allclose(rate, path.along(s[:-1] + 0.5 * s[1])[1], atol=1e-9 + 0.3 * path.curvature * s[1])


@every_path
def test_the_curvature_is_the_largest(path):
    s = np.linspace(0.0, path.length, 20001)
    bent = np.linalg.norm(np.diff(path.along(s)[1], axis=0), axis=1) / s[1]
    assert bent.max() == pytest.approx(path.curvature, rel=0.02, abs=1e-12)


def test_round_figures():
    circle, helix, lemniscate = EXAMPLES["circle"], EXAMPLES["helix"], EXAMPLES["lemniscate"]
    s = np.linspace(0, 1, 101)
    x, y, z = seen(circle, circle.along(s * circle.length)[0]).T
    np.testing.assert_allclose([x, y, z], [0.3 * np.cos(2 * np.pi * s), 0.3 * np.sin(2 * np.pi * s), 0 * s], atol=1e-14)
    x, y, z = seen(helix, helix.along(s * helix.length)[0]).T
    np.testing.assert_allclose(z, 0.25 * s, atol=1e-14)
    np.testing.assert_allclose(np.hypot(x, y), 0.3, atol=1e-14)
    x, y, z = seen(lemniscate, lemniscate.along(s * lemniscate.length)[0]).T
    np.testing.assert_allclose((x**2 + y**2) ** 2, 0.04 * (x**2 - y**2), atol=1e-15)
    assert lemniscate.length == pytest.approx(0.2 * 5.244115108584239, rel=1e-12)  # 2 ϖ a
    assert (x.min(), x.max()) == pytest.approx((-0.2, 0.2))


def test_square_and_raster():
    square, raster = EXAMPLES["square"], EXAMPLES["raster"]
    assert square.length == pytest.approx(4 * 0.3 - 8 * 0.02 + 2 * np.pi * 0.02)
    points = seen(square, square.along(np.linspace(0, square.length, 4001))[0])
    np.testing.assert_allclose(points[[0, -1]], [[0, -0.15, 0]] * 2, atol=1e-14)
    np.testing.assert_allclose(np.abs(points[:, :2]).max(axis=0), 0.15, atol=1e-12)
    # A corner lies (√2 - 1) r off the path.
    assert np.abs(points[:, :2]).sum(axis=1).max() == pytest.approx(0.3 - (2 - 2**0.5) * 0.02, abs=1e-6)
    points = seen(raster, raster.along(np.linspace(0, raster.length, 4001))[0])
    np.testing.assert_allclose(points[[0, -1]], [[-0.15, -0.1, 0], [0.15, 0.1, 0]], atol=1e-14)
    passed = [y for y in np.linspace(-0.1, 0.1, 5) if (np.abs(points[:, 1] - y) < 1e-12).sum() > 100]
    assert len(passed) == 5


def test_through_all_points_or_near_them():
    spline, polyline = EXAMPLES["spline"], EXAMPLES["polyline"]
    np.testing.assert_allclose(spline.along(spline.stations)[0], POINTS, atol=1e-12)
    near = polyline.along(polyline.stations)[0]
    np.testing.assert_allclose(near[[0, -1]], POINTS[[0, -1]], atol=1e-14)
    sides = np.diff(POINTS, axis=0)
    sides /= np.linalg.norm(sides, axis=1)[:, None]
    angles = np.arccos(np.sum(sides[1:] * sides[:-1], axis=1))
    away = 0.05 * (1 / np.cos(angles / 2) - 1)
    np.testing.assert_allclose(np.linalg.norm(near - POINTS, axis=1)[1:-1], away, atol=1e-12)


def test_points_in_a_line_have_no_corners():
    path = Polyline([[0, 0, 0], [1, 0, 0], [3, 0, 0]], 0.1)
    assert (path.length, path.curvature) == (3.0, 0.0)
    np.testing.assert_array_equal(path.stations, [0, 1, 3])
