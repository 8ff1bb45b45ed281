"""Arms in the scene: cylinders where the kinematics are, and meshes of a URDF file that is of the arm."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.cli.view import meshes
from baselines.viewer.readings import AT, FREE, Reader, share_colour
from baselines.viewer.replay import Stage, size
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories import Sinusoid

pytest.importorskip("yourdfpy")
trimesh = pytest.importorskip("trimesh")
transforms = pytest.importorskip("viser.transforms")
arms = pytest.importorskip("baselines.viewer.arms")

JOINTS = ("shoulder", "elbow")


@pytest.fixture
def arm():
    """Two links of 1 m in a plane, the base of which is 0.5 m above the floor."""
    return ikgym.Arm(
        name="two", offsets=[[0.0, 0.0, 0.5], [1.0, 0.0, 0.0]], axes=[[0.0, 0.0, 1.0]] * 2, tool=[1.0, 0.0, 0.0],
        lower=[-1.0, -1.0], upper=[1.0, 1.0], joint_names=JOINTS,
    )  # fmt: skip


def urdf(folder, length=1.0, joints=JOINTS, shape='<mesh filename="link.stl"/>'):
    trimesh.creation.box((1.0, 0.1, 0.1)).apply_translation((0.5, 0.0, 0.0)).export(folder / "link.stl")
    visual = f"<visual><geometry>{shape}</geometry></visual>" if shape else ""
    text = '<robot name="two"><link name="base"/>'
    before, xyz = "base", "0 0 0.5"
    for number, joint in enumerate(joints):
        text += f'<link name="link_{number}">{visual}</link>'
        text += f'<joint name="{joint}" type="continuous"><origin xyz="{xyz}"/><axis xyz="0 0 1"/>'
        text += f'<parent link="{before}"/><child link="link_{number}"/></joint>'
        before, xyz = f"link_{number}", f"{length} 0 0"
    file = folder / "two.urdf"
    file.write_text(text + "</robot>")
    return file


def chained(poses):
    """The last of poses that are each seen from the one before."""
    out = transforms.SE3.identity()
    for position, wxyz in poses:
        out = out @ transforms.SE3.from_rotation_and_translation(transforms.SO3(np.asarray(wxyz)), np.asarray(position))
    return out


@pytest.mark.parametrize("name", ikgym.arms.names())
def test_frames_of_joints_are_those_of_the_arm(name):
    arm = ikgym.arms.get(name)
    low, high = np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0)
    q = np.random.default_rng(0).uniform(low, high)
    frames = list(zip(*arms.joint_frames(arm, q), strict=True))
    for joint, point in enumerate(arm.joint_points(q)[:, 1]):
        found = chained(frames[: joint + 1])
        np.testing.assert_allclose(found.translation(), point, atol=1e-12 * size(arm))
    np.testing.assert_allclose(found @ arm.tool, arm.forward(q)[1], atol=1e-12 * size(arm))


def read(arm, q):
    return Reader(arm, ikgym.tasks.get("position")).read(q)


def test_cylinders_have_the_colours_of_the_readings(arm, server):
    made = arms.Cylinders(server, "/root", arm, FREE)
    made.show(np.array([0.3, 1.0]), read(arm, np.array([0.3, 1.0])))
    assert [tuple(joint.color) for joint in made._joints] == [FREE, AT]
    assert tuple(made._tool.color) != share_colour(0.0)
    made.show(np.zeros(2), read(arm, np.zeros(2)))
    assert tuple(made._tool.color) == share_colour(0.0)


def test_meshes_move_with_the_arm(arm, server, tmp_path):
    made, q = arms.Meshes(server, "/root", arms.read_urdf(urdf(tmp_path), arm), arm), np.array([0.3, 0.5])
    made.show(q, read(arm, q))
    first, last = made._meshes.values()
    np.testing.assert_allclose([first.position, last.position], arm.joint_points(q)[:, 1], atol=1e-6)
    np.testing.assert_allclose(last.wxyz, [np.cos(0.4), 0.0, 0.0, np.sin(0.4)], atol=1e-6)
    np.testing.assert_allclose(made._tool.position, arm.forward(q)[1], atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": 1.1}, "moves differently from arm 'two'"),
        ({"joints": ("shoulder", "wrist")}, "has no joint 'elbow' of arm 'two'; it has shoulder, wrist"),
        ({"shape": ""}, "has no visible shapes"),
    ],
)
def test_other_files_are_refused(arm, tmp_path, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        arms.read_urdf(urdf(tmp_path, **changes), arm)


def test_files_that_cannot_be_read(arm, tmp_path):
    with pytest.raises(InvalidInputError, match="expected a file"):
        arms.read_urdf(tmp_path / "nowhere.urdf", arm)
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot")
    with pytest.raises(InvalidInputError, match="cannot be read"):
        arms.read_urdf(broken, arm)


@pytest.fixture
def stage(tmp_path):
    """Makes a stage for an arm that was read from a URDF file."""
    pytest.importorskip("pinocchio")

    def made(**changes):
        arm = ikgym.arms.from_urdf(urdf(tmp_path, **changes))
        sinusoid, task = Sinusoid(np.array([0.1, 0.2])), ikgym.tasks.get("position")
        return Stage.of(ikgym.Scenario("mine", arm, task, sinusoid, velocity_limit=3.0, steps=2))

    return made


def test_an_arm_from_a_file_with_meshes_is_shown_with_them(stage, server):
    made = meshes(stage(), None)(server)("/root", AT)
    assert isinstance(made, arms.Meshes)


def test_an_arm_from_a_file_without_meshes_is_shown_as_cylinders(stage, capsys):
    assert meshes(stage(shape=""), None) is None
    assert "Cylinders are shown: urdf:" in capsys.readouterr().err
