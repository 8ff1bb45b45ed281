"""Bodies from the collision geometry of URDF files, compared with Pinocchio's placements of the same geometry."""

import logging
from pathlib import Path
from xml.etree.ElementTree import fromstring as xml_of

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from ikgym.arms import Arm, from_urdf
from ikgym.arms.urdf import bodies as urdf_bodies
from ikgym.arms.urdf import geometry
from ikgym.arms.urdf.covering import Capsule, around, around_box, distances
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.obstacles import Box
from ikgym.obstacles.solids import closest
from tests.arms.test_urdf import LIMIT
from tests.arms.test_urdf import joint as bare

PANDA = Path(__file__).parents[1] / "robots" / "panda_hand.urdf"
#: Arms, alone and on bases, in example-robot-data; without `xarm_description`, which is always tested.
KINDS = ("baxter", "centauro", "kinova", "panda", "pr2", "so_arm", "tiago", "tiago_pro", "ur", "z1")
ARMS = ("talos_data", *(f"{kind}_description" for kind in KINDS))


def shape(geometry, xyz="0 0 0", rpy="0 0 0"):
    return f'<collision><origin xyz="{xyz}" rpy="{rpy}"/><geometry>{geometry}</geometry></collision>'


def joint(name, parent, child, kind="revolute", xyz="0 0 0", rpy="0 0 0", axis="0 0 1"):
    return bare(name, parent, child, kind, f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{LIMIT}')


def robot(links, joints):
    inside = "".join(f'<link name="{name}">{shapes}</link>' for name, shapes in links.items())
    return f'<robot name="r">{inside}{"".join(joints)}</robot>'


# Each shape, a fixed link within the chain, and a gripper of which one finger moves.
LINKS = {
    "world": "",
    "base": shape('<box size="0.12 0.1 0.3"/>', "0.1 0 0.2", "0.3 0.2 0.1"),
    "one": shape('<cylinder radius="0.05" length="0.4"/>', "0 0.1 0.2", "1 0.5 -0.4"),
    "two": shape('<sphere radius="0.07"/>', "0.02 0.03 0.04") + shape('<sphere radius="0.02"/>', "0.2 0.03 0.04"),
    "bracket": shape('<cylinder radius="0.03" length="0.2"/>', "0.1 0.1 0", "0 0.7 0"),
    "tool": shape('<sphere radius="0.01"/>', "0 0 0.1"),
    "finger": shape('<cylinder radius="0.01" length="0.1"/>', "0.05 0 0"),
}
JOINTS = [
    joint("mount", "world", "base", "fixed", "0.1 0.2 0.3", "0.1 0.2 0.3"),
    joint("turn", "base", "one", "revolute", "0 0.1 0.4", "0.5 -0.3 0.2", "0 1 0"),
    joint("slide", "one", "two", "prismatic", "0.3 0 0.1", "-0.2 0.6 0.1", "0.6 0 0.8"),
    joint("weld", "two", "bracket", "fixed", "0.1 0 0", "0 0 0.9"),
    joint("roll", "bracket", "tool", "revolute", "0.2 0.1 0", "0.4 0 0.1", "1 0 0"),
    joint("jaw", "tool", "finger", "prismatic", "0 0.02 0.1", "0 0 0.3", "0 1 0"),
]
SMALL = robot(LINKS, JOINTS)


def placed(arm, q, number, point):
    """A point of a link, by the kinematics of the joints before it."""
    if number == 0:
        return point
    chain = [each[:number] for each in (arm.offsets, arm.axes, arm.prismatic)]
    return Arm("part", *chain, tool=point).forward(q[:number])[1]


def pinocchio_shapes(xml, base, names, q):
    """Names of links, and placements and shapes of their collision geometry from the base."""
    model = pin.buildModelFromXML(xml)
    geometry = pin.buildGeomFromUrdfString(model, xml, pin.GeometryType.COLLISION)
    data, geometry_data, whole = model.createData(), geometry.createData(), pin.neutral(model)
    for name, value in zip(names, q, strict=True):
        whole[model.joints[model.getJointId(name)].idx_q] = value
    pin.framesForwardKinematics(model, data, whole)
    pin.updateGeometryPlacements(model, data, geometry, geometry_data)
    start = data.oMf[model.getFrameId(base)]
    for each, there in zip(geometry.geometryObjects, geometry_data.oMg, strict=True):
        yield model.frames[each.parentFrame].name, start.actInv(there), each.geometry


@pytest.mark.parametrize(("xml", "base", "tip"), [(SMALL, "base", "tool"), (PANDA.read_text(), None, "panda_hand_tcp")])
def test_bodies_are_where_pinocchio_places_the_geometry(write, xml, base, tip, monkeypatch):
    monkeypatch.setattr(urdf_bodies, "_outermost", lambda capsules: capsules)  # one body a shape
    arm = from_urdf(write(xml), base=base, tip=tip)
    bodies, generator = arm.bodies, np.random.default_rng(1)
    for q in generator.uniform(arm.lower, arm.upper, (5, arm.joints)):
        seen = list(pinocchio_shapes(xml, base or "panda_link0", arm.joint_names, q))
        assert len(seen) == len(bodies)
        for i, (name, number) in enumerate(zip(bodies.names, bodies.links, strict=True)):
            same = [entry for entry in seen if entry[0] == name.split("[")[0]]
            _, there, solid = same[int(name.split("[")[1][:-1]) - 1 if "[" in name else 0]
            ends = [placed(arm, q, number, point) for point in (bodies.starts[i], bodies.ends[i])]
            np.testing.assert_allclose(np.mean(ends, axis=0), there.translation, atol=1e-9)
            length = {"Cylinder": "halfLength", "Box": "halfSide"}.get(type(solid).__name__)
            if length is not None:
                axis = 2.0 * np.max(getattr(solid, length)) * there.rotation[:, 2]
                np.testing.assert_allclose(ends[1] - ends[0], axis, atol=1e-9)
            if length != "halfSide":
                assert bodies.radii[i] == solid.radius


def test_links_are_those_of_the_chain_before_them(write):
    bodies = from_urdf(write(SMALL), base="base", tip="tool").bodies
    found = dict(zip(bodies.names, bodies.links, strict=True))
    assert found == {"base": 0, "one": 1, "two[1]": 2, "two[2]": 2, "bracket": 2, "tool": 3, "finger": 3}


def test_links_above_the_base_are_left_out(write):
    assert "base" not in from_urdf(write(SMALL), base="one", tip="tool").bodies.names


@pytest.mark.parametrize("size", [(1, 1, 1), (0.3, 0.2, 0.1), (0.1, 0.5, 0.02), (2.0, 0.01, 1.0), (0.1, 0.1, 1.0)])
def test_capsules_contain_their_box(size):
    capsules = around_box(size)
    points = (np.random.default_rng(0).random((2000, 3)) - 0.5) * size
    corners = 0.5 * np.array(size) * (np.indices((2, 2, 2)).reshape(3, -1).T * 2 - 1)
    outside = [distances(np.vstack([points, corners]), one.start, one.end) - one.radius for one in capsules]
    assert np.min(outside, axis=0).max() < 1e-12
    assert len(capsules) <= 4


def test_the_capsule_around_a_mesh_contains_its_corners_and_is_small():
    generator = np.random.default_rng(3)
    for _ in range(3):
        points = generator.normal(size=(400, 3)) * [0.1, 0.05, 0.02]
        capsule = around(points)
        assert (distances(points, capsule.start, capsule.end) <= capsule.radius * (1 + 1e-12)).all()
    mesh = trimesh.creation.capsule(0.4, 0.1)
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(np.array([0.1, 0.6, 0.3])))
    found, exact = around(np.array(mesh.vertices)), Capsule(np.zeros(3), np.array([0, 0, 0.4]), 0.1).volume
    assert found.volume < 1.02 * exact


@pytest.mark.parametrize(
    ("name", "kind"),
    [("package://some_robot/meshes/link", "stl"), *(("meshes/link", kind) for kind in ("obj", "ply", "dae"))],
)
def test_meshes_are_opened_where_they_are_asked_for(tmp_path, name, kind):
    folder = tmp_path / "some_robot"
    (folder / "meshes").mkdir(parents=True)
    mesh = trimesh.creation.cone(0.1, 0.5)
    mesh.export(folder / "meshes" / f"link.{kind}")
    inside = shape(f'<mesh filename="{name}.{kind}" scale="1 2 1"/>', "0.1 0 0", "0 0.5 0")
    path = folder / "arm.urdf"
    path.write_text(robot({"a": "", "b": inside}, [joint("j", "a", "b", xyz="0 0 1", rpy="0.3 0 0")]))
    assert from_urdf(path).bodies.unseen == (f"'b': its mesh '{name}.{kind}' was not opened",)
    arm = from_urdf(path, meshes=True)
    assert arm.bodies.unseen == ()
    assert arm.bodies.names == ("b",)
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0, 0), np.zeros(3)) * pin.SE3(
        pin.rpy.rpyToMatrix(0, 0.5, 0), np.array([0.1, 0, 0])
    )
    corners = np.array([pose.act(corner) for corner in np.array(mesh.vertices) * [1, 2, 1]])
    outside = distances(corners, arm.bodies.starts[0], arm.bodies.ends[0]) - arm.bodies.radii[0]
    assert outside.max() < 1e-6  # single precision of the files
    assert outside.max() > -1e-3


def test_a_cylinder_between_two_spheres_is_one_capsule(write):
    ends = [shape('<sphere radius="0.1"/>', f"0 0 {z}") for z in (-0.2, 0.2)]
    link = shape('<cylinder radius="0.1" length="0.4"/>') + "".join(ends) + ends[0]
    assert from_urdf(write(robot({"a": "", "b": link}, [joint("j", "a", "b")]))).bodies.names == ("b",)


def test_pairs_that_always_touch_are_ignored_and_named(write, caplog):
    ball = shape('<sphere radius="0.3"/>')
    links = {"a": ball, "b": "", "c": ball, "d": shape('<sphere radius="0.1"/>', "0.35 0 0")}
    steps = [joint("j", "a", "b"), joint("k", "b", "c", xyz="0.1 0 0"), joint("l", "c", "d", axis="0 1 0")]
    with caplog.at_level(logging.INFO, "ikgym"):
        bodies = from_urdf(write(robot(links, steps))).bodies
    assert set(map(frozenset, bodies.ignored)) == {frozenset("ac")}  # d meets a in some postures
    assert "r: ignored, since they always touch: c and a" in caplog.text


@pytest.mark.parametrize(
    ("geometry", "message"),
    [
        ('<sphere radius="-1"/>', "link 'b': expected radius of <sphere> from 0 to 1e+12 m, got '-1'"),
        ('<box size="1 1e300 1"/>', "link 'b': expected size of <box> from 0 to 1e+12 m, got '1 1e300 1'"),
        ("<sphere/>", "link 'b': expected <sphere radius=\"…\">, got none"),
        ('<cylinder radius="1" length="nan"/>', "link 'b': expected length to be a finite number, got 'nan'"),
        ('<box size="1 2"/>', "link 'b': expected size to be 3 finite numbers"),
        ("<cone/>", "expected one of 'sphere', 'cylinder', 'capsule', 'box', 'mesh' in <geometry>, got 'cone'"),
        ("", "in <geometry>, got none"),
    ],
)
def test_bad_geometry_is_refused(write, geometry, message):
    path = write(robot({"a": "", "b": shape(geometry)}, [joint("j", "a", "b")]))
    with pytest.raises(InvalidInputError) as caught:
        from_urdf(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("mesh", "reason"),
    [
        ('filename="package://no/such.stl"', "its mesh 'package://no/such.stl' was not found from /"),
        ('filename="arm.urdf"', "expected a mesh of kind .stl, .obj, .ply, .dae, got 'arm.urdf'"),
        ('filename="bomb.dae"', "expected XML without a DOCTYPE in 'bomb.dae'"),
        ('filename="broken.stl"', "its mesh 'broken.stl' cannot be read: "),
        ('filename="cone.stl" scale="1 1e300 1"', "expected corners of at most 1e+12 m in 'cone.stl'"),
    ],
)
def test_a_link_whose_mesh_cannot_be_opened_gets_no_verdict(write, mesh, reason):
    path = write(robot({"a": "", "b": shape(f"<mesh {mesh}/>")}, [joint("j", "a", "b")]))
    path.with_name("broken.stl").write_bytes(b"no mesh")
    path.with_name("bomb.dae").write_bytes(b'<!DOCTYPE lolz [<!ENTITY lol "lol">]><COLLADA/>')
    trimesh.creation.cone(0.1, 0.5).export(path.with_name("cone.stl"))
    arm = from_urdf(path, meshes=True)
    with pytest.raises(InvalidInputError) as caught:
        arm.clearance([0.0])
    for part in ("got none on 'b'", reason, "--packages DIR", "bodyless"):
        assert part in str(caught.value)


VISUAL = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'


@pytest.mark.parametrize(
    ("link", "unseen"),
    [
        ("c", ("'c': it has a visual shape, but no collision shape",)),  # off the chain, and fixed to it
        ("b", ("'b': it has a visual shape, but no collision shape",)),
        ("d", ()),  # a finger, which a joint off the chain moves
        ("a", ("'a': it has a visual shape, but no collision shape",)),
    ],
)
def test_links_of_the_chain_and_links_fixed_to_them_need_a_body(write, link, unseen):
    links = {name: shape('<sphere radius="0.1"/>') for name in "abcd"} | {link: VISUAL}
    steps = [joint("j", "a", "b"), joint("k", "b", "c", "fixed"), joint("l", "b", "d", "prismatic")]
    path = write(robot(links, steps))
    assert from_urdf(path, tip="b").bodies.unseen == unseen
    assert from_urdf(path, tip="b", bodyless=[link]).bodies.unseen == ()
    assert link not in from_urdf(path, tip="b", bodyless=[link]).bodies.names


def test_a_link_that_moves_alone_needs_a_body_and_a_frame_does_not(write):
    ball = shape('<sphere radius="0.1"/>')
    links = {"world": "", "one": ball, "two": "", "three": ball, "tool0": ""}
    steps = [joint("j", "world", "one"), joint("k", "one", "two"), joint("l", "two", "three")]
    path = write(robot(links, [*steps, joint("m", "three", "tool0", "fixed")]))
    assert from_urdf(path).bodies.unseen == ("'two': it has no shape",)
    with pytest.raises(UnknownNameError, match="Did you mean 'two'"):
        from_urdf(path, bodyless=["tow"])


def test_shapes_without_extent_are_left_out(write, caplog):
    inside = shape('<sphere radius="0"/>') + shape('<cylinder radius="0.1" length="0"/>') + shape('<box size="1 0 1"/>')
    arm = from_urdf(write(robot({"a": "", "b": inside + shape('<sphere radius="0.2"/>')}, [joint("j", "a", "b")])))
    assert arm.bodies.radii.tolist() == [0.2]
    assert caplog.text.count("is left out") == 3


def test_a_visible_link_whose_only_shape_has_no_extent_was_not_looked_at(write):
    arm = from_urdf(write(robot({"a": "", "b": VISUAL + shape('<sphere radius="0"/>')}, [joint("j", "a", "b")])))
    assert arm.bodies.unseen == ("'b': it has a visual shape, but no collision shape",)


def test_no_distance_is_told_of_an_arm_that_was_not_looked_at(write):
    """As viewers show it, which draw the bodies that there are."""
    ball = shape('<sphere radius="0.1"/>')
    arm = from_urdf(write(robot({"a": "", "b": ball, "c": VISUAL}, [joint("j", "a", "b"), joint("k", "b", "c")])))
    box = Box("box", [1.0, 0.0, 0.0], [0.1, 0.1, 0.1])
    around = arm.bodies.surroundings([box])
    assert closest(arm, np.zeros((1, 2)), around.boxes[None], around.checked).distances.tolist() == [np.inf]


def test_many_shapes_that_always_touch_are_found(write):
    """Pair after pair they took a minute and a half."""
    links = {name: "".join(shape('<sphere radius="0.1"/>', f"0 0 {i / 1e4}") for i in range(40)) for name in "abc"}
    bodies = from_urdf(write(robot(links, [joint("j", "a", "b"), joint("k", "b", "c")]))).bodies
    assert len(bodies.ignored) == 40 * 40
    assert len(bodies.pairs) == 0


def test_a_fine_mesh_is_covered_in_no_time():
    """All of its corners are on its hull; a sample of them is searched, and all are inside."""
    points = np.array(trimesh.creation.icosphere(subdivisions=6, radius=0.3).vertices)
    capsule = around(points)
    assert (distances(points, capsule.start, capsule.end) <= capsule.radius * (1 + 1e-12)).all()
    assert capsule.radius < 0.31


@pytest.mark.parametrize("robot", ["xarm_description", *(pytest.param(name, marks=pytest.mark.slow) for name in ARMS)])
def test_capsules_contain_the_meshes_of_public_arms(robot):
    """All of them, those that are only shown too."""
    cmeel = pytest.importorskip("cmeel")
    folder = Path(cmeel.__file__).parents[1] / "cmeel.prefix/share/example-robot-data/robots" / robot
    if not folder.parent.is_dir():
        pytest.skip("example-robot-data is not installed")
    files = [file for file in folder.rglob("*") if file.suffix.lower() in geometry.MESHES]
    assert files
    for file in files:
        vertices = trimesh.load_mesh(file, process=False).vertices
        (capsule,) = geometry._mesh("link", xml_of(f'<mesh filename="{file}"/>'), [folder]).capsules
        assert (distances(np.array(vertices), capsule.start, capsule.end) - capsule.radius).max() < 1e-4, file


def test_more_shapes_than_an_arm_may_have_are_refused(write):
    many = "".join(shape('<sphere radius="0.1"/>', f"{i} 0 0") for i in range(urdf_bodies.MAX_BODIES + 1))
    with pytest.raises(InvalidInputError, match="expected at most 256 bodies"):
        from_urdf(write(robot({"a": "", "b": many}, [joint("j", "a", "b")])))
