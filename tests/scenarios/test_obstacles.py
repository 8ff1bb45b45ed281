"""Obstacles of a scenario: where they are, and what they are checked against."""

import numpy as np
import pytest
import trimesh

import ikgym
from ikgym.arms.bodies import Bodies
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere
from ikgym.scenarios import Scenario
from ikgym.trajectories import Helix, Sinusoid, StraightLine
from tests.comparison import fields, identical

LINE = ikgym.scenarios.get("panda-line")
ARM = LINE.arm.replace(bodies=Bodies(("hand", "upper"), (7, 3), [[0, 0, -0.1], [0, 0, -0.1]], None, (0.05, 0.1)))
BALL = Sphere("ball", [0.5, 0.5, 0.5], 0.1)
SCENARIO = LINE.replace(arm=ARM, obstacles=(BALL, HalfSpace("floor", [0, 0, -0.1], [0, 0, 1])))
TURN = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def test_bodies_are_sorted_by_link_and_pairs_are_on_links_that_are_no_neighbours():
    bodies = Bodies(("d", "c", "b", "a"), (3, 2, 0, 2), np.arange(12.0).reshape(4, 3), None, (4, 3, 2, 1), [("d", "b")])
    assert bodies.names == ("b", "c", "a", "d")
    assert bodies.links == (0, 2, 2, 3)
    np.testing.assert_array_equal(bodies.radii, [2, 3, 1, 4])
    np.testing.assert_array_equal(bodies.ends, np.arange(12.0).reshape(4, 3)[[2, 1, 3, 0]])
    assert {*map(tuple, bodies.pairs.tolist())} == {(1, 0), (2, 0)}


def test_added_bodies_are_those_given_at_once():
    built = Bodies().added("hand", 7, [0, 0, -0.1], radius=0.05)
    built = built.added("upper", 3, [0, 0, -0.1], radius=0.1, ignored=("hand",))
    assert identical(fields(built), fields(ARM.bodies.replace(ignored=(("upper", "hand"),))))


def test_obstacles_make_collisions_matter():
    assert SCENARIO.collides
    assert not LINE.replace(arm=ARM).collides
    assert LINE.replace(arm=ARM, collisions=True).collides
    assert not SCENARIO.replace(collisions=False).collides


def test_what_touches_the_start_is_refused_at_reset():
    near = BALL.replace(position=ARM.forward(SCENARIO.start_of())[1])
    with pytest.raises(InvalidInputError, match="'hand' and 'ball'"):
        ikgym.RedundantIKEnv(SCENARIO.replace(obstacles=[near])).reset()
    ikgym.RedundantIKEnv(SCENARIO.replace(obstacles=[near.replace(ignored=("hand",))])).reset()


def test_obstacles_at_rest_have_one_row():
    assert SCENARIO.obstacle_rows(100).shape == (1, 2, 16)
    np.testing.assert_array_equal(SCENARIO.surroundings.boxes, SCENARIO.obstacle_rows(1)[0])
    np.testing.assert_array_equal(SCENARIO.surroundings.checked, np.ones((2, 2)))


def test_a_moving_obstacle_is_in_the_frame_of_its_motion():
    helix = Helix([0.0, 0, 1], 0.1, 0.2, 3.0)
    line = StraightLine([*np.eye(3).ravel(), 1, 0, 0], [*TURN.ravel(), 1, 2, 0], 1.0, 0.1)
    box = Box("box", [0.5, 0, 0], [0.1, 0.2, 0.3], np.eye(3), motion=line)
    ball, bar = BALL.replace(motion=helix), Capsule("bar", [0, 0, 1], [0, 1, 1], 0.1, motion=line)
    moving = SCENARIO.replace(obstacles=[ball, box, bar, HalfSpace("floor", [0, 0, -0.1], [0, 0, 1])])
    rows, times = moving.obstacle_rows(2000), moving.times(2000)
    places = helix.frames(times, ARM)[:, -3:]
    np.testing.assert_allclose(rows[:, 0, 9:12], places + BALL.position, rtol=0, atol=1e-15)
    end = rows[-1]
    np.testing.assert_allclose(end[1, :12], [*TURN.ravel(), 1, 2.5, 0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(end[2, 9:12], [0.5, 2, 1], rtol=0, atol=1e-12)
    np.testing.assert_allclose(np.abs(end[2, [2, 5, 8]]), [1, 0, 0], rtol=0, atol=1e-12)
    assert (rows[:, 3] == rows[0, 3]).all()
    assert moving.obstacles_shown
    assert not SCENARIO.obstacles_shown


def test_a_motion_of_joints_is_that_of_the_tool():
    motion = Sinusoid(0.3 * np.ones(7), offset=ARM.home)
    scenario = SCENARIO.replace(obstacles=[BALL.replace(position=[0, 0, 0.3], motion=motion)], collisions=False)
    rotation, position = ARM.forward(0.3 * np.sin(scenario.times(50))[:, None] + ARM.home)
    wanted = position + rotation @ [0, 0, 0.3]
    np.testing.assert_allclose(scenario.obstacle_rows(50)[:, 0, 9:12], wanted, rtol=0, atol=1e-12)


def test_meshes_are_opened_where_touching_matters(tmp_path):
    """They stay closed elsewhere; the file that is written says that they are open."""
    trimesh.creation.capsule(0.3, 0.05).export(tmp_path / "rod.stl")
    shape = '<collision><geometry><mesh filename="rod.stl"/></geometry></collision>'
    limit = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
    joint = f'<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{limit}</joint>'
    (tmp_path / "arm.urdf").write_text(f'<robot name="r"><link name="a"/><link name="b">{shape}</link>{joint}</robot>')
    arm = ikgym.arms.from_urdf(tmp_path / "arm.urdf")
    trajectory = ikgym.trajectories.Sinusoid([0.1], [1.0])
    free = Scenario("s", arm, ikgym.tasks.get("position"), trajectory, steps=10)
    assert (len(free.arm.bodies), len(free.arm.bodies.unseen)) == (0, 1)
    clear = free.replace(collisions=True)
    assert (clear.arm.bodies.names, clear.arm.bodies.unseen, clear.model is clear.arm) == (("b",), (), True)
    clear.save(tmp_path / "s.toml")
    assert "meshes = true" in (tmp_path / "s.toml").read_text()
    read = ikgym.scenarios.load(tmp_path / "s.toml")
    assert read.arm.bodies.starts.tobytes() == clear.arm.bodies.starts.tobytes()
    (tmp_path / "rod.stl").unlink()
    with pytest.raises(InvalidInputError, match=r"got none on 'b'\. 'b': its mesh 'rod.stl' was not found"):
        free.replace(collisions=True)
    changed = arm.replace(name="other")
    with pytest.raises(InvalidInputError, match="got none on 'b'"):
        Scenario("s", changed, ikgym.tasks.get("position"), trajectory, steps=10, collisions=True)


def test_too_many_obstacles_are_counted_first(tmp_path):
    ikgym.scenarios.get("panda-circle").save(tmp_path / "many.toml")
    box = '[[obstacles]]\nkind = "no kind, which is not even read"\n'
    text = (tmp_path / "many.toml").read_text().replace("obstacles = []\n", "")
    (tmp_path / "many.toml").write_text(text + 1001 * box)
    with pytest.raises(InvalidInputError, match="obstacles: expected at most 1000 tables, got 1001"):
        ikgym.scenarios.load(tmp_path / "many.toml")
