"""Meshes of a URDF file, if it is of the arm."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.viewer.readings import Reader
from ikgym.exceptions import InvalidInputError

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
        joint_names=JOINTS,
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

    def add_mesh_trimesh(self, name, mesh):
        self.handles[name] = handle = type("Handle", (), {"mesh": mesh})()
        return handle


def test_meshes_move_with_the_arm(arm, tmp_path):
    server = Server()
    shown = meshes.Meshes(server, "/root", meshes.read_urdf(urdf(tmp_path), arm), arm)
    q = np.array([0.3, 0.9])
    shown.show(q, Reader(arm, ikgym.tasks.get("position")).read(q))
    assert [name.rpartition("/")[0] for name in server.handles] == ["/root", "/root"]
    places = np.array([handle.position for handle in server.handles.values()])
    np.testing.assert_allclose(places, arm.joint_points(q)[:, 1], atol=1e-6)
    last = list(server.handles.values())[-1]
    np.testing.assert_allclose(last.wxyz, [np.cos(0.6), 0.0, 0.0, np.sin(0.6)], atol=1e-6)
    np.testing.assert_allclose(last.mesh.bounds[:, 0], [0.0, 1.0], atol=1e-6)


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
