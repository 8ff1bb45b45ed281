"""Surfaces and outlines of solids, and the closest points of bodies and obstacles."""

import numpy as np
import pytest

import ikgym
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere
from ikgym.obstacles.solids import (
    closest,
    cut_half_spaces,
    in_space,
    link_frames,
    on_links,
    outline,
    solids_of,
    surface,
)
from tests.bodied import AROUND, crowd

#: Half edges and radius, and the volume of the solid in [m³].
SOLIDS = {
    "sphere": ((0, 0, 0, 0.1), 4 / 3 * np.pi * 0.1**3),
    "capsule": ((0, 0, 0.3, 0.1), 4 / 3 * np.pi * 0.1**3 + 0.6 * np.pi * 0.1**2),
    "box": ((0.2, 0.1, 0.3, 0), 0.4 * 0.2 * 0.6),
    "rounded box": (
        (0.2, 0.1, 0.3, 0.05),
        0.048 + 2 * 0.05 * (0.08 + 0.24 + 0.12) + 1.2 * np.pi * 0.05**2 + 4 / 3 * np.pi * 0.05**3,
    ),
}


def distance(size, points):
    """Signed distance of points from a solid in its frame."""
    beyond = np.abs(points) - size[:3]
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0) - size[3]


@pytest.mark.parametrize("kind", SOLIDS)
def test_a_surface_is_closed_and_encloses_the_volume(kind):
    size, volume = np.array(SOLIDS[kind][0], dtype=float), SOLIDS[kind][1]
    vertices, faces = surface(size, 12)
    np.testing.assert_allclose(distance(size, vertices), 0.0, atol=1e-12)
    edges = np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert (uses == 2).all()
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert (np.cross(a, b) * c).sum() / 6 == pytest.approx(volume, rel=0.02)  # outwards, or it would be below 0
    assert len(np.unique(vertices.round(9), axis=0)) == len(vertices) == (8 if kind == "box" else len(vertices))


@pytest.mark.parametrize("kind", SOLIDS)
def test_an_outline_is_on_the_surface(kind):
    size = np.array(SOLIDS[kind][0], dtype=float)
    points = outline(size)
    known = np.isfinite(points[:, 0])
    np.testing.assert_allclose(distance(size, points[known]), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(points[known]).max(axis=0), size[:3] + size[3], atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "tiago", "varga7", "puma560"])
def test_frames_of_links_lead_to_the_tool(name):
    arm = ikgym.arms.get(name)
    q = np.random.default_rng(0).uniform(-1, 1, (5, arm.joints))
    frames, (rotation, position) = link_frames(arm, q), arm.forward(q)
    assert frames.shape == (5, arm.joints + 1, 12)
    last = frames[:, -1, :9].reshape(-1, 3, 3)
    np.testing.assert_allclose(last @ arm.tool_rotation, rotation, atol=1e-12)
    np.testing.assert_allclose(frames[:, -1, 9:] + last @ arm.tool, position, atol=1e-12)


def test_bodies_are_where_their_links_carry_them():
    scenario = crowd()
    arm, q = scenario.arm, np.random.default_rng(1).uniform(-1, 1, (4, 7))
    found = closest(arm, q, scenario.obstacle_rows(1), scenario.surroundings.checked)
    assert found.bodies.shape == (4, len(arm.bodies), 16)
    frames, own = link_frames(arm, q), on_links(arm.bodies)
    for number, link in enumerate(arm.bodies.links):
        ends = np.array([[0, 0, -1], [0, 0, 1]]) * own[number, 14]
        for row in range(4):
            carried = in_space(np.append(frames[row, link], np.zeros(4)), in_space(own[number], ends))
            np.testing.assert_allclose(in_space(found.bodies[row, number], ends), carried, atol=1e-12)


def test_the_closest_points_are_on_both_surfaces():
    scenario = crowd()
    arm, q = scenario.arm, np.random.default_rng(2).uniform(-1.5, 1.5, (300, 7))
    rows = np.broadcast_to(scenario.obstacle_rows(1), (300, 4, 16))
    found = closest(arm, q, rows, scenario.surroundings.checked)
    gap = found.points[:, 0] - found.points[:, 1]
    np.testing.assert_allclose(np.linalg.norm(gap, axis=1), np.abs(found.distances), atol=1e-12)
    for row, (first, second) in enumerate(found.pairs):
        others = found.bodies[row] if second < len(arm.bodies) else cut_half_spaces(rows[row], 9.0)
        solids = found.bodies[row, first], others[second % len(arm.bodies)]
        for solid, point in zip(solids, found.points[row], strict=True):
            own = (point - solid[9:12]) @ solid[:9].reshape(3, 3)
            assert abs(distance(solid[12:], own[None])[0]) < 1e-9
    assert {number >= len(arm.bodies) for number in found.pairs[:, 1]} == {True, False}
    still = closest(arm, q, rows[:1], scenario.surroundings.checked)
    np.testing.assert_array_equal(still.distances, found.distances)
    distances, _ = arm.clearance(q, [one for one in AROUND if one.motion is None])
    alike = (found.pairs != len(arm.bodies) + 2).all(axis=1)
    np.testing.assert_array_equal(found.distances[alike], distances[alike])


def test_where_nothing_can_meet_there_is_no_pair():
    arm = ikgym.arms.get("varga7")
    found = closest(arm, np.zeros((2, 7)), np.zeros((1, 0, 16)), np.zeros((0, 0), dtype=bool))
    assert np.isinf(found.distances).all()
    assert (found.pairs == -1).all()
    assert np.isnan(found.points).all()


def test_half_spaces_are_plates_beside_a_point():
    rows = np.array([HalfSpace("wall", [0.5, 3, 4], [1, 0, 0]).numbers(), Sphere("ball", [1, 2, 3], 0.1).numbers()])
    wall, ball = cut_half_spaces(rows, 0.7, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(wall[9:], [0.5, 0.2, 0.3, 0.7, 0.7, 0.0, 0.0])
    np.testing.assert_array_equal(ball, rows[1])
    vertices, _ = surface(wall[12:])
    assert len(vertices) == 4
    np.testing.assert_allclose(in_space(wall, vertices)[:, 0], 0.5)


def test_obstacles_at_some_times_are_those_of_the_scenario():
    scenario, arm = crowd(), ikgym.arms.get("panda")
    rows = solids_of(AROUND, scenario.times(31), arm)
    np.testing.assert_array_equal(rows, scenario.obstacle_rows(31))
    assert len(solids_of(AROUND[:2], np.zeros(9), arm)) == 1
    assert solids_of((), np.zeros(9), arm).shape == (1, 0, 16)
    one = Capsule("a", [1, 0, 0], [1, 2, 0], 0.2), Box("b", [0, 0, 1], [1, 1, 1])
    np.testing.assert_allclose(solids_of(one, np.zeros(1), arm)[0, :, 12:], [[0, 0, 1, 0.2], [0.5, 0.5, 0.5, 0]])
