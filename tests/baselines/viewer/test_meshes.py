"""Meshes of a URDF file, if it is of the arm."""

from __future__ import annotations

import types

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


class Server:
    """The part of viser's that meshes need."""

    def __init__(self):
        self.scene, self.handles = self, {}

    def add(self, name, mesh=None, color=(0, 0, 0), visible=True, **content):
        self.handles[name] = handle = types.SimpleNamespace(mesh=mesh, color=color, visible=visible)
        return handle

    add_mesh_trimesh = add_mesh_simple = add_icosphere = add


@pytest.fixture
def server():
    return Server()


@pytest.fixture
def shown(arm, server, tmp_path):
    """Shows a posture."""
    made = meshes.Meshes(server, "/root", meshes.read_urdf(urdf(tmp_path), arm), arm)
    return lambda q: made.show(np.array(q), Reader(arm, ikgym.tasks.get("position")).read(np.array(q)))


def seen(server):
    return {name: handle for name, handle in server.handles.items() if handle.visible}


def test_meshes_move_with_the_arm(arm, server, shown):
    shown([0.3, 0.5])
    assert list(seen(server)) == ["/root/0/own", "/root/1/own", "/root/tool"]
    places = np.array([handle.position for handle in seen(server).values()])
    wanted = [*arm.joint_points(np.array([0.3, 0.5]))[:, 1], arm.forward(np.array([0.3, 0.5]))[1]]
    np.testing.assert_allclose(places, wanted, atol=1e-6)
    last = server.handles["/root/1/own"]
    np.testing.assert_allclose(last.wxyz, [np.cos(0.4), 0.0, 0.0, np.sin(0.4)], atol=1e-6)
    np.testing.assert_allclose(last.mesh.bounds[:, 0], [0.0, 1.0], atol=1e-6)


@pytest.mark.parametrize(("elbow", "colour"), [(0.99, NEAR), (1.0, AT)])
def test_what_a_joint_near_its_limit_moves_has_the_colour_of_the_limit(server, shown, elbow, colour):
    shown([0.3, elbow])
    assert list(seen(server)) == ["/root/0/own", "/root/1/plain", "/root/tool"]
    handle = server.handles["/root/1/plain"]
    assert handle.color == colour
    np.testing.assert_allclose(handle.wxyz, [np.cos((0.3 + elbow) / 2), 0.0, 0.0, np.sin((0.3 + elbow) / 2)], atol=1e-6)
    shown([0.3, 0.5])
    assert "/root/1/own" in seen(server)


def test_the_ball_at_the_tool_says_how_manipulable_the_arm_is(server, shown):
    shown([0.3, 0.0])
    assert server.handles["/root/tool"].color == share_colour(0.0)


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
    shaper = shaper_of(stage(), None)
    assert isinstance(shaper(server)("/root", AT), meshes.Meshes)
    assert list(seen(server)) == ["/root/0/own", "/root/1/own", "/root/tool"]


def test_an_arm_from_a_file_without_meshes_is_shown_as_cylinders(stage, capsys):
    assert shaper_of(stage(shape=""), None) is None
    assert "Cylinders are shown: urdf:" in capsys.readouterr().err
