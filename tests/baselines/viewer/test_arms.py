"""Arms in the scene: frames where the kinematics are, and meshes of a URDF file that describes the arm."""

import io
import zipfile

import numpy as np
import pytest

import ikgym
from baselines.cli.commands import view
from baselines.viewer.readings import AT, FREE, NEAR, Reader, slider_range
from baselines.viewer.replay import size
from ikgym.exceptions import InvalidInputError

pytest.importorskip("yourdfpy")
trimesh = pytest.importorskip("trimesh")
transforms = pytest.importorskip("viser.transforms")
meshes = pytest.importorskip("baselines.viewer.meshes")
drawing = pytest.importorskip("baselines.viewer.drawing")

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
    visual = f'<visual><origin xyz="0 0 0.1"/><geometry>{shape}</geometry></visual>' if shape else ""
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


def place(handles):
    """Where a frame is whose parents are the handles before it."""
    out = transforms.SE3.identity()
    for one in handles:
        rotation = transforms.SO3(np.asarray(one.wxyz))
        out = out @ transforms.SE3.from_rotation_and_translation(rotation, np.asarray(one.position))
    return out


def read(arm, q):
    return Reader(arm, ikgym.tasks.get("position")).read(q)


def test_frames_of_joints_are_those_of_the_arm(server):
    for name in ("planar2", "varga7", "tiago"):
        arm = ikgym.arms.get(name)
        q = np.random.default_rng(0).uniform(np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0))
        drawn = drawing.DrawnArm(server, f"/{name}", arm, FREE)
        drawn.show(q, read(arm, q))
        for joint, point in enumerate(arm.joint_points(q)[:, 1]):
            # viser leaves out motion that it takes for none.
            np.testing.assert_allclose(place(drawn._frames[: joint + 1]).translation(), point, atol=1e-6 * size(arm))
        np.testing.assert_allclose(place(drawn._frames) @ arm.tool, arm.forward(q)[1], atol=1e-6 * size(arm))


def test_cylinders_have_the_colours_of_the_readings(arm, server):
    drawn = drawing.DrawnArm(server, "/root", arm, FREE)
    drawn.show(np.array([0.95, 1.0]), read(arm, np.array([0.95, 1.0])))
    assert [tuple(joint.color) for joint in drawn._joints] == [NEAR, AT]
    assert tuple(drawn._tool.color) != AT
    drawn.show(np.zeros(2), read(arm, np.zeros(2)))
    assert [tuple(joint.color) for joint in drawn._joints] == [FREE, FREE]
    assert tuple(drawn._tool.color) == AT  # stretched, thus singular


def test_manipulability_is_the_root_of_the_determinant_and_sliders_go_to_the_limits():
    panda, varga = ikgym.arms.get("panda"), ikgym.arms.get("varga7")
    jacobian, reader = panda.jacobian(panda.home), Reader(panda, ikgym.tasks.get("pose"))
    reading = reader.read(panda.home)
    assert reading.manipulability == pytest.approx(np.sqrt(np.linalg.det(jacobian @ jacobian.T)), rel=1e-9)
    assert reading.share == pytest.approx(reading.manipulability / reader.largest, rel=1e-9)
    assert 0.1 < reading.share <= 1.0
    np.testing.assert_array_equal(slider_range(panda), [panda.lower, panda.upper])
    low, high = slider_range(varga)  # without limits: half a turn, or half the reach
    np.testing.assert_allclose(high, np.where(varga.prismatic, 0.5 * size(varga), np.pi))
    np.testing.assert_array_equal(low, -high)


def test_meshes_move_with_the_arm(arm, server, tmp_path):
    shapes, q = meshes.read_urdf(urdf(tmp_path), arm), np.array([0.3, 0.5])
    drawn = drawing.DrawnArm(server, "/root", arm, FREE, shapes)
    drawn.show(q, read(arm, q))
    assert [shape.frame for shape in shapes] == [1, 2]
    for shape, joint in zip(shapes, arm.joint_points(q)[:, 1], strict=True):
        corners = shape.mesh.vertices
        np.testing.assert_allclose(corners.min(axis=0), [0.0, -0.05, 0.05], atol=1e-6)
        np.testing.assert_allclose(corners.max(axis=0), [1.0, 0.05, 0.15], atol=1e-6)
        np.testing.assert_allclose(place(drawn._frames[: shape.frame]).translation(), joint, atol=1e-6)


def mesh(folder, name, content):
    """A URDF file with a mesh of that content."""
    (folder / name).write_bytes(content)
    return urdf(folder, shape=f'<mesh filename="{name}"/>')


def zipped(content):
    """An archive."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("link.dae", content)
    return stream.getvalue()


def text(file, old, new):
    file.write_text(file.read_text().replace(old, new))
    return file


BOMB = zipped(b" " * 10**8)
NODE = b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><instance_node url="#x"/></COLLADA>'


def test_other_files_are_refused(arm, tmp_path):
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot")
    points = trimesh.PointCloud(np.eye(3)).export(file_type="ply")
    for file, message in (
        (lambda: tmp_path / "nowhere.urdf", "Cannot read .*nowhere.urdf: No such file"),
        (lambda: broken, "cannot be read"),
        (lambda: urdf(tmp_path, length=1.1), "moves differently"),
        (lambda: urdf(tmp_path, joints=("shoulder", "wrist")), "no joint 'elbow'"),
        (lambda: urdf(tmp_path, shape=""), "no visible shapes"),
        (lambda: urdf(tmp_path, shape='<mesh filename="none.stl"/>'), "no visible shapes"),
        (lambda: mesh(tmp_path, "a.zae", BOMB), "formats dae, obj, ply, stl"),
        (lambda: mesh(tmp_path, "a.dae", BOMB), "expected XML"),
        (lambda: mesh(tmp_path, "a.dae", NODE), "without <instance_node>"),
        (lambda: mesh(tmp_path, "a.ply", points), "expected triangles in space, got a PointCloud"),
        (lambda: text(urdf(tmp_path), "<link", "<link/>" * 2000 + "<link"), "at most 2000 links and shapes"),
        (lambda: text(urdf(tmp_path), "<robot", "<!DOCTYPE x><robot"), "no DOCTYPE"),
    ):
        with pytest.raises(InvalidInputError, match=message):
            meshes.read_urdf(file(), arm)


def test_all_meshes_together_are_bounded(arm, tmp_path, monkeypatch):
    size = (urdf(tmp_path).parent / "link.stl").stat().st_size
    monkeypatch.setattr(meshes, "MOST_BYTES", 2 * size)
    assert len(meshes.read_urdf(tmp_path / "two.urdf", arm)) == 2
    monkeypatch.setattr(meshes, "MOST_BYTES", 2 * size - 1)
    with pytest.raises(InvalidInputError, match=f"link.stl: expected at most {size - 1} bytes, got {size}"):
        meshes.read_urdf(tmp_path / "two.urdf", arm)


def test_an_arm_from_a_file_is_shown_with_its_meshes_if_there_are_any(tmp_path, capsys):
    pytest.importorskip("pinocchio")
    assert len(view.meshes(ikgym.arms.from_urdf(urdf(tmp_path)), None)) == 2
    assert view.meshes(ikgym.arms.from_urdf(urdf(tmp_path, shape="")), None) is None
    assert "Cylinders are shown: urdf:" in capsys.readouterr().err
