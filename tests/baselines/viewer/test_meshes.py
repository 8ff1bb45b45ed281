"""Meshes of a URDF file, if it is of the arm."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.viewer.readings import AT, NEAR, Reader, share_colour
from baselines.viewer.replay import Stage
from baselines.viewer.view import shaper_of
from ikgym.exceptions import InvalidInputError
from ikgym.trajectories import Sinusoid

pytest.importorskip("yourdfpy")
trimesh = pytest.importorskip("trimesh")
pytest.importorskip("viser")
meshes = pytest.importorskip("baselines.viewer.meshes")

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


@pytest.fixture
def shown(arm, server, tmp_path):
    """The arm in viser's scene, at a posture."""
    made = meshes.Meshes(server, "/root", meshes.read_urdf(urdf(tmp_path), arm), arm)

    def show(*q):
        made.show(np.array(q), Reader(arm, ikgym.tasks.get("position")).read(np.array(q)))
        return made

    return show


def seen(made):
    """The handles of the meshes that are seen, each with whether it has the colours of its file."""
    assert all(mesh._own.visible != mesh._plain.visible for mesh in made._meshes)
    return [(mesh._own, True) if mesh._own.visible else (mesh._plain, False) for mesh in made._meshes]


def test_meshes_move_with_the_arm(arm, shown):
    made, q = shown(0.3, 0.5), np.array([0.3, 0.5])
    (first, own), (last, own_as_well) = seen(made)
    assert own
    assert own_as_well
    np.testing.assert_allclose([first.position, last.position], arm.joint_points(q)[:, 1], atol=1e-6)
    np.testing.assert_allclose(last.wxyz, [np.cos(0.4), 0.0, 0.0, np.sin(0.4)], atol=1e-6)
    np.testing.assert_allclose(made._tool.position, arm.forward(q)[1], atol=1e-6)


@pytest.mark.parametrize(("elbow", "colour"), [(0.99, NEAR), (1.0, AT)])
def test_what_a_joint_near_its_limit_moves_has_the_colour_of_the_limit(shown, elbow, colour):
    (_, first_own), (handle, own) = seen(shown(0.3, elbow))
    assert first_own
    assert not own
    assert tuple(handle.color) == colour
    np.testing.assert_allclose(handle.wxyz, [np.cos((0.3 + elbow) / 2), 0.0, 0.0, np.sin((0.3 + elbow) / 2)], atol=1e-6)
    np.testing.assert_allclose(np.ptp(handle.vertices, axis=0), [1.0, 0.1, 0.1], atol=1e-6)
    assert [own for _, own in seen(shown(0.3, 0.5))] == [True, True]


def test_the_ball_at_the_tool_says_how_manipulable_the_arm_is(shown):
    assert tuple(shown(0.3, 0.0)._tool.color) == share_colour(0.0)
    assert tuple(shown(0.3, 0.8)._tool.color) != share_colour(0.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"length": 1.1}, "moves otherwise than arm 'two'"),
        ({"joints": ("shoulder", "wrist")}, "has no joint 'elbow' of arm 'two'; it has shoulder, wrist"),
        ({"shape": ""}, "has no visible shapes"),
    ],
)
def test_other_files_are_refused(arm, tmp_path, changes, message):
    with pytest.raises(InvalidInputError, match=message):
        meshes.read_urdf(urdf(tmp_path, **changes), arm)


def test_files_that_cannot_be_read(arm, tmp_path):
    with pytest.raises(InvalidInputError, match="expected a file"):
        meshes.read_urdf(tmp_path / "nowhere.urdf", arm)
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot")
    with pytest.raises(InvalidInputError, match="cannot be read"):
        meshes.read_urdf(broken, arm)


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
    made = shaper_of(stage(), None)(server)("/root", AT)
    assert isinstance(made, meshes.Meshes)
    assert len(made._meshes) == 2


def test_an_arm_from_a_file_without_meshes_is_shown_as_cylinders(stage, capsys):
    assert shaper_of(stage(shape=""), None) is None
    assert "Cylinders are shown: urdf:" in capsys.readouterr().err
