"""Scenarios as files: nothing is lost on the way, and every mistake in a file is named."""

import math
import tomllib
import typing

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import ikgym
from baselines.fingerprints import fingerprint
from ikgym import scenarios
from ikgym.arms import Arm, from_urdf, read_catalogue
from ikgym.arms.bodies import Bodies
from ikgym.exceptions import IkgymError, InvalidInputError, UnknownNameError
from ikgym.obstacles import Box, Capsule, HalfSpace, Sphere
from ikgym.plant import Plant
from ikgym.scenarios import Scenario, load
from ikgym.scenarios.files import document
from ikgym.trajectories import Helix, PathTrajectory, Quintic, Sinusoid, TimeLaw, Trajectory, paths
from ikgym.trajectories.orientations import Orientation
from tests.arms.test_urdf import LIMIT, joint, robot
from tests.comparison import fields, identical
from tests.every_scenario import every_scenario
from tests.test_bad_input import GOOD

PAIR = robot(joint("j1", "a", "b"), joint("j2", "b", "c", inside='<axis xyz="0 0 1"/>' + LIMIT))
FAST = scenarios.get("varga7-fast")
CORNERS = paths.Polyline(np.eye(3), 0.01)

AXES = np.random.default_rng(0).normal(size=(3, 3))
OWN = Arm(
    'own "arm" \\ größe\n\x7f',
    np.random.default_rng(1).normal(size=(3, 3)),
    AXES / np.linalg.norm(AXES, axis=1)[:, None],
    (False, True, False),
    tool=np.array([0.1, 1 / 3, -1e-300]),
    lower=np.array([-1.0, -np.inf, -0.0]),
    upper=np.array([1.0, np.inf, 2.0]),
    velocity_limit=np.array([1.0, 2.0, np.inf]),
    bodies=Bodies(
        ("column", 'the "tool"', "upper"),
        (0, 3, 2),
        [[0, 0, 1 / 3], [0.1, 0, 0], [-0.0, 5e-324, 1e12]],
        [[0, 0, 0.1], [0.1, 0, 0], [1, 2, 3]],
        (1 / 3, 1e-12, 0.2),
        (("upper", "column"),),
    ),
)
MOTION = Helix([1 / 3, 0, 0], 0.1, 0.2, 3.0)
OBSTACLES = (
    Sphere("ball", [1 / 3, -0.0, 1e-300], 1 / 3, motion=MOTION, ignored=("upper", 'the "tool"')),
    Capsule("bar", [0, 0, 1 / 3], [0.1, 0.2, 0.3], 0.1, motion=Sinusoid(0.1 * np.ones(3)), ignored=("upper",)),
    Box("crate", [1, 2, 3], [1 / 3, 1e-12, 1], Rotation.random(rng=np.random.default_rng(2)).as_matrix()),
    HalfSpace("größe", [0, 0, -9], [0, 1 / 3, 1], motion=MOTION.replace(radius=1.0), ignored=("upper",)),
)
#: A scenario in which nothing has its default.
WHOLE = Scenario(
    "whole",
    OWN,
    ikgym.tasks.get("position"),
    Sinusoid(np.array([0.1, 0.2, 1 / 3]), frequency=[1, 2, 3], phase=0.1, offset=-1e-17, sigmoid=0.7),
    velocity_limit=[1.0, 2.0, math.pi],
    cost=ikgym.TrackingCost(2e-3, 2.5, 0.7, 3.5, 1.5),
    dt=1 / 3,
    steps=17,
    model=OWN.replace(name="model", tool=np.array([1.0, 2.0, 3.0])),
    start=np.array([0.1, 0.2, 0.3]),
    initial_pose=np.array([1e12, 5e-324, -0.0]),
    iterations_per_point=(3, 2),
    plant=Plant(
        zero=(1e-3, 0.0, 1 / 3),
        link=1e-4,
        axis=2e-4,
        payload=(-1e-3, 0.0, 1e-3),
        payload_step=9,
        arms=(OWN, OWN.replace(name="other", offsets=OWN.offsets + 1 / 3)),
        bandwidth=(10.0, 1e3 / 3),
        command_delay=(2, 5),
        backlash=1e-4,
        bias=(0.1, -0.2, 0.3),
        noise=0.01,
        q_noise=1e-5,
        pose_noise=1e-3,
        pose_rotation_noise=2e-3,
        q_delay=1,
        pose_delay=4,
        pose_every=(3, 4),
        calibration=(0.5, 1.5),
        from_middle=(0.0, 1.0 / 3),
        pose_missing=0.1,
    ),
    source="a test",
    obstacles=OBSTACLES,
    collisions=True,
    proximity=ikgym.ProximityCost(1 / 3, 1e-3, 2.5, 1.5),
)


@pytest.mark.parametrize("name", every_scenario())
def test_every_scenario_survives_its_file(name, tmp_path):
    scenario, file = scenarios.get(name), tmp_path / "x.toml"
    scenario.save(file)
    read = load(file)
    assert fingerprint(read) == fingerprint(scenario)
    assert identical(fields(read), fields(scenario))
    assert (read.model is read.arm) is (scenario.model is scenario.arm)


def test_nothing_is_lost(tmp_path):
    WHOLE.save(tmp_path / "x.toml")
    read = load(tmp_path / "x.toml")
    assert identical(fields(read), fields(WHOLE))
    assert fingerprint(read) == fingerprint(WHOLE)
    read.save(tmp_path / "y.toml")
    assert (tmp_path / "y.toml").read_bytes() == (tmp_path / "x.toml").read_bytes()


#: One of each kind of trajectory, path, time law and orientation.
TRAJECTORIES = [
    *(one for one in GOOD if isinstance(one, Trajectory)),
    *(PathTrajectory(one, Quintic(1, 1)) for one in GOOD if isinstance(one, paths.Path)),
    *(PathTrajectory(CORNERS, one) for one in GOOD if isinstance(one, TimeLaw)),
    *(PathTrajectory(CORNERS, Quintic(1, 1 / 3), one) for one in GOOD if isinstance(one, Orientation)),
]


@pytest.mark.parametrize("trajectory", TRAJECTORIES, ids=lambda one: type(one).__name__)
def test_every_trajectory_survives_its_file(trajectory, tmp_path):
    task, file = ikgym.tasks.get("pose" if trajectory.has_orientation else "position"), tmp_path / "x.toml"
    scenario = FAST.replace(task=task, trajectory=trajectory, start=np.zeros(7))
    scenario.save(file)
    read = load(file)
    assert identical(fields(read), fields(scenario))
    assert fingerprint(read) == fingerprint(scenario)
    assert identical(read.nominal(0), scenario.nominal(0))


VALUES = st.one_of(st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(), st.lists(st.floats(-1, 1)))


@settings(max_examples=30)
@given(st.dictionaries(st.from_regex(r"[a-z_]\w*", fullmatch=True).filter(str.isascii), VALUES))
def test_what_is_written_is_what_is_read(values):
    assert tomllib.loads(document({**values, "Table": values})) == {**values, "Table": values}


# Arms.


@pytest.fixture
def urdf(tmp_path):
    """A URDF file next to the folder of scenario files, and an arm from it."""
    path = tmp_path / "arms" / "two.urdf"
    path.parent.mkdir()
    path.write_text(PAIR)
    return path


def on_urdf(path, **where):
    arm = from_urdf(path, **where)
    sinusoid = Sinusoid(np.array([0.1, 0.2]))
    return Scenario("mine", arm, ikgym.tasks.get("pose"), sinusoid, velocity_limit=3.0, steps=20)


@pytest.mark.parametrize(
    "where",
    [
        {},
        {
            "name": "mine",
            "base": "a",
            "tip": "c",
            "tool": [0, 0, 0.1],
            "tool_rotation": [[0, -1, 0], [1, 0, 0], [0, 0, 1]],
        },
    ],
)
def test_an_arm_from_a_urdf_is_a_reference_to_it(urdf, where, tmp_path, monkeypatch):
    scenario, file = on_urdf(urdf, **where), tmp_path / "scenarios" / "mine.toml"
    scenario.save(file)
    table = tomllib.loads(file.read_text())["arm"]
    assert table["urdf"] == "../arms/two.urdf"
    assert set(table) == {"urdf", "name", *where}
    # The path is relative to the file, not to where Python runs, and both may move together.
    (tmp_path / "moved").mkdir()
    for folder in ("arms", "scenarios"):
        (tmp_path / folder).rename(tmp_path / "moved" / folder)
    monkeypatch.chdir(tmp_path)
    read = load("moved/scenarios/mine.toml")
    assert identical(fields(read), fields(scenario))
    assert fingerprint(read) == fingerprint(scenario)


def test_bodies_from_meshes_are_read_from_them_again(urdf, tmp_path):
    trimesh.creation.box((0.1, 0.2, 0.3)).export(urdf.with_name("c.stl"))
    geometry = '<collision><geometry><mesh filename="c.stl"/></geometry></collision>'
    urdf.write_text(PAIR.replace("<link name='c'/>", f"<link name='c'>{geometry}</link>"))
    scenario, file = on_urdf(urdf, meshes=True), tmp_path / "mine.toml"
    assert scenario.arm.bodies.names == ("c",)
    scenario.save(file)
    assert tomllib.loads(file.read_text())["arm"] == {"name": "r2", "urdf": "arms/two.urdf", "meshes": True}
    assert identical(fields(load(file)), fields(scenario))
    urdf.with_name("c.stl").unlink()
    scenario.save(file)
    assert "urdf" not in tomllib.loads(file.read_text())["arm"]
    assert identical(fields(load(file)), fields(scenario))


def test_what_a_urdf_has_not_is_added_and_the_arm_keeps_its_file(urdf, tmp_path, caplog):
    """Without it the viewer would lose the meshes; an arm that moves otherwise is no longer that of the file."""
    file, again = tmp_path / "mine.toml", tmp_path / "again.toml"
    on_urdf(urdf).save(file)
    text = file.read_text()
    file.write_text(text.replace("[arm]", "[arm]\nhome = [0.1, 0.2]\nacceleration_limit = [5.0, 5.0]"))
    arm = load(file).arm
    np.testing.assert_array_equal(arm.home, [0.1, 0.2])
    np.testing.assert_array_equal(arm.acceleration_limit, [5.0, 5.0])
    assert arm.urdf.file == urdf.resolve()
    load(file).save(again)
    assert tomllib.loads(again.read_text())["arm"]["urdf"] == "arms/two.urdf"
    assert identical(fields(load(again)), fields(load(file)))
    file.write_text(text.replace("[arm]", "[arm]\naxes = [[0, 0, 1], [0, 1, 0]]"))
    assert load(file).arm.urdf is None
    assert "axes: the arm differs from its file" in caplog.text


@pytest.mark.parametrize("change", ["gone", "another", "faulty"])
def test_an_arm_whose_urdf_has_changed_is_written_in_numbers(urdf, change, tmp_path):
    scenario = on_urdf(urdf)
    if change == "gone":
        urdf.unlink()
    else:
        urdf.write_text(PAIR.replace("0 0 1", "0 1 0") if change == "another" else "rubbish")
    scenario.save(tmp_path / "x.toml")
    assert "urdf" not in tomllib.loads((tmp_path / "x.toml").read_text())["arm"]
    assert identical(fields(load(tmp_path / "x.toml")), fields(scenario))


def test_an_arm_of_your_own_is_written_in_numbers_though_it_has_a_name_of_ours(tmp_path):
    scenario = FAST.replace(arm=FAST.arm.replace(tool=np.array([2.0, 0.0, 0.0])))
    scenario.save(tmp_path / "x.toml")
    assert identical(fields(load(tmp_path / "x.toml")), fields(scenario))
    FAST.save(tmp_path / "y.toml")
    assert tomllib.loads((tmp_path / "y.toml").read_text())["arm"] == "varga7"


# What no file can hold.


class OwnTrajectory(Helix):
    """Derived from a known kind, and another one all the same."""


class OwnArm(Arm):
    pass


class OwnScenario(Scenario):
    pass


HELIX = scenarios.get("zhang3-helix")


@pytest.mark.parametrize(
    ("scenario", "message"),
    [
        (HELIX.replace(trajectory=OwnTrajectory([0, 0, 0], 1, 1, 1)), "one of the kinds sinusoid, .* OwnTrajectory"),
        (FAST.replace(arm=OwnArm(**FAST.arm._fields())), "a class of ikgym, got OwnArm"),
        (FAST.replace(task=FAST.task.replace(name="mine")), "task: expected one of position"),
        (FAST.replace(name="\ud800"), "surrogates not allowed"),
        (OwnScenario(**FAST._fields()), "expected a Scenario itself"),
    ],
)
def test_scenarios_that_no_file_can_hold_leave_the_file_alone(scenario, message, tmp_path):
    file = tmp_path / "x.toml"
    file.write_text("before")
    with pytest.raises(InvalidInputError, match=message):
        scenario.save(file)
    assert file.read_text() == "before"
    assert [file.name for file in tmp_path.iterdir()] == ["x.toml"]


# Mistakes in a file.

GOOD: dict[str, typing.Any] = {
    "name": "'mine'",
    "arm": "'varga7'",
    "task": "'skew'",
    "velocity_limit": "20.0",
    "trajectory": "{kind = 'sinusoid', amplitude = [1, 1, 1, 1, 1, 1, 1]}",
}


def written(tmp_path, changes):
    keys = {**GOOD, **changes}
    file = tmp_path / "mine.toml"
    file.write_text("\n".join(f"{key} = {value}" for key, value in keys.items() if value is not None))
    return file


def test_what_has_a_default_may_be_left_out(tmp_path):
    read = load(written(tmp_path, {}))
    made = Scenario("mine", FAST.arm, FAST.task, Sinusoid(np.ones(7)), velocity_limit=20.0)
    assert identical(fields(read), fields(made))


PATH = "{kind = 'line', start = [0, 0, 0], end = [0, 0, 1]}"
LAW = "{kind = 'quintic', speed = 1, acceleration = 1}"
#: A change of the file, and a word of the message.
BAD = [
    ({"trajectory": f"{{kind = 'path', path = {{kind = 'lime'}}, time_law = {LAW}}}"}, "Did you mean 'line'"),
    ({"trajectory": f"{{kind = 'path', path = {PATH}, time_law = {{kind = 'quintic', sped = 1}}}}"}, "mean 'speed'"),
    ({"trajectory": "{kind = 'sinusoid', amplitude = [1], frequencies = 1}"}, "Did you mean 'frequency'"),
    ({"trajectory": "{amplitude = [1]}"}, r"\[trajectory\] kind: expected one of sinusoid"),
    ({"trajectory": "{kind = 'sinusoid'}"}, r"\[trajectory\] amplitude: expected numbers"),
    ({"stepps": "3"}, "Did you mean 'steps'"),
    ({"name": None}, "name: expected a text"),
    ({"name": "'"}, "invalid TOML: .*line 1"),
    ({"dt": "[" * 10**5}, "invalid TOML"),
    ({"a." * 10**5 + "a": "1"}, "expected keys of at most 50 names"),
    ({"'a' . \"b c\" . " * 10**5 + "a": "1"}, "expected keys of at most 50 names"),
    ({"dt": "2026-01-01"}, "dt: expected a finite number .* got datetime"),
    ({"velocity_limit": None}, "velocity_limit: expected a number, or one a joint"),
    ({"velocity_limit": "true"}, "velocity_limit: expected an array of real numbers, got True"),
    ({"velocity_limit": "[true, 1, 1, 1]"}, "velocity_limit: expected an array of real numbers, got .True"),
    ({"arm": None}, "arm: expected the name of an arm or a table"),
    ({"arm": "3"}, "arm: expected the name of an arm or a table"),
    ({"arm": "'varga8'"}, "Did you mean 'varga7'"),
    ({"arm": "{name = 'a', axis = []}"}, "Did you mean 'axes'"),
    ({"arm": "{name = 'varga7'}"}, r"\[arm\] offsets: expected numbers"),
    ({"arm": "{urdf = 'a.urdf'}"}, r"\[arm\] Cannot read .*a\.urdf"),
    ({"arm": "{urdf = 3}"}, r"\[arm\] path: expected a text"),
    ({"model": "{urdf = 'a.urdf', tipp = 'c'}"}, "Did you mean 'tip'"),
    ({"arm": "{like = 'varga7', bodies = {nmes = []}}"}, "Did you mean 'names'"),
    ({"arm": "{like = 'varga7', bodies = {names = ['a'], links = [1]}}"}, r"\[arm.bodies\] starts of bodies"),
    ({"obstacles": "[{kind = 'spere'}]"}, "Did you mean 'sphere'"),
    ({"obstacles": "{kind = 'sphere'}"}, "obstacles: expected a list of tables"),
    ({"obstacles": "[{kind = 'box', name = 'a', position = [0, 0, 0]}]"}, r"\[obstacles\] size: expected numbers"),
    ({"obstacles": "[{kind = 'sphere', name = 'a', position = [0, 0, 0], radius = 1}]"}, "an arm with bodies"),
    ({"collisions": "'yes'"}, "collisions: expected true or false"),
    ({"plant": "{arms = ['panda-22']}"}, "Did you mean 'panda-2'"),
    ({"plant": "{arms = 'panda-2'}"}, r"\[plant\] arms: expected a list of arms"),
    ({"plant": "{arms = [{name = 'a'}]}"}, r"\[plant.arms\] offsets: expected numbers"),
]


@pytest.mark.parametrize(("changes", "message"), BAD, ids=[message for _, message in BAD])
def test_bad_files_are_refused(changes, message, tmp_path):
    with pytest.raises(IkgymError, match=rf"mine\.toml.*{message}"):
        load(written(tmp_path, changes))


def test_like_another_scenario(tmp_path):
    file = tmp_path / "x.toml"
    file.write_text("name = 'mine'\nlike = 'panda-circle'\nsteps = 9\narm = { like = 'panda', tool = [0.0, 0.0, 0.2] }")
    read, circle = load(file), scenarios.get("panda-circle")
    changed = circle.replace(name="mine", steps=9, arm=circle.arm.replace(tool=[0.0, 0.0, 0.2]))
    assert identical(fields(read), fields(changed))
    file.write_text("name = 'mine'\nlike = 'panda-cirle'")
    with pytest.raises(UnknownNameError, match=r"no scenario 'panda-cirle' in .*\. Did you mean 'panda-circle'"):
        load(file)


def test_a_scenario_is_added_by_one_file_and_an_arm_by_one_table(tmp_path):
    """What is in the folder of the catalogue, and in the file of arms, is there without another line."""
    for family, known in scenarios.FILES.items():
        assert scenarios.names(family) == tuple(file.stem for file in known)
    assert all(load(file).name == file.stem for known in scenarios.FILES.values() for file in known)
    added = tmp_path / "arms.toml"
    added.write_text("[one]\naxes = 'z'\noffsets = [[0, 0, 1]]\n[long]\nlike = 'one'\ntool = [2, 0, 0]")
    one, long = (make() for make in read_catalogue(added).values())
    np.testing.assert_array_equal(long.forward([0.0])[1] - one.forward([0.0])[1], [2, 0, 0])
    assert (long.name, long.joints) == ("long", 1)
