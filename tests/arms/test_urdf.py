import sys
import threading
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from ikgym import arms
from ikgym.arms import from_urdf
from ikgym.exceptions import InvalidInputError, MissingDependencyError, UnknownNameError

LIMIT = '<limit lower="-1.5" upper="2.5" velocity="3" effort="1"/>'


def joint(name, parent, child, kind="revolute", inside=LIMIT):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def robot(*joints, links="abc", extra=""):
    parts = [f"<link name={link!r}/>" for link in links] + list(joints)
    return f'<robot name="r2">{"".join(parts)}{extra}</robot>'


# A shifted base, every kind of joint with a turned origin, axes between the coordinate axes, a tool
# with an orientation, a mesh that does not exist, and a gripper as a branch.
ORIGIN = '<origin xyz="0.{0} -0.2 0.{1}" rpy="0.{1} -1.{0} 2.{0}"/>'
WHOLE = robot(
    joint("mount", "world", "base", "fixed", ORIGIN.format(1, 3)),
    joint("turn", "base", "one", "revolute", ORIGIN.format(2, 4) + '<axis xyz="0 0 -1"/>' + LIMIT),
    joint("spin", "one", "two", "continuous", ORIGIN.format(3, 5) + '<axis xyz="0.6 0 -0.8"/>'),
    joint("elbow", "two", "three", "fixed", ORIGIN.format(4, 6)),
    joint(
        "slide",
        "three",
        "four",
        "prismatic",
        ORIGIN.format(5, 7) + '<axis xyz="0.577 -0.577 0.577"/><limit upper="0.8" velocity="0.1" effort="1"/>',
    ),
    joint("roll", "four", "five", "revolute", LIMIT),
    joint("flange", "five", "tool", "fixed", ORIGIN.format(6, 8)),
    joint("jaw", "five", "finger", "prismatic", LIMIT),
    joint("jaw2", "five", "thumb", "prismatic", LIMIT + '<mimic joint="jaw"/>'),
    joint("rope", "base", "bucket", "floating", ""),
    links=("world", "base", "one", "two", "three", "four", "five", "tool", "finger", "thumb", "bucket"),
    extra='<material name="steel"/><gazebo/>',
).replace(
    "<link name='two'/>",
    "<link name='two'><visual><geometry><mesh filename='package://no/two.dae'/></geometry></visual></link>",
)


def pinocchio_pose(xml, base, tip, coordinates):
    """Where Pinocchio, reading the whole file, sees the tip from the base; coordinates by names of joints."""
    model = pin.buildModelFromXML(xml)
    data, q = model.createData(), pin.neutral(model)
    for name, value in coordinates.items():
        index = model.joints[model.getJointId(name)]
        q[index.idx_q : index.idx_q + index.nq] = [np.cos(value), np.sin(value)] if index.nq == 2 else value
    pin.framesForwardKinematics(model, data, q)
    return data.oMf[model.getFrameId(base)].actInv(data.oMf[model.getFrameId(tip)])


def assert_same(pose, expected):
    """That an arm has its tip where Pinocchio has it."""
    np.testing.assert_allclose(pose[0], expected.rotation, rtol=0, atol=1e-12)
    np.testing.assert_allclose(pose[1], expected.translation, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("base", "tip", "moving"),
    [
        ("world", "tool", ["turn", "spin", "slide", "roll"]),
        ("base", "tool", ["turn", "spin", "slide", "roll"]),
        ("one", "five", ["spin", "slide", "roll"]),
        ("two", "four", ["slide"]),
        ("two", "finger", ["slide", "roll", "jaw"]),
    ],
)
def test_forward_kinematics_is_that_of_pinocchio(write, base, tip, moving):
    path = write(WHOLE)
    arm = from_urdf(path, base=base, tip=tip)
    assert arm.joints == len(moving)
    for q in (np.zeros(arm.joints), *np.random.default_rng(0).uniform(-3, 3, (20, arm.joints))):
        assert_same(arm.forward(q), pinocchio_pose(WHOLE, base, tip, dict(zip(moving, q, strict=True))))


def test_vendor_tags_of_an_undeclared_prefix_are_passed_over_as_pinocchio_does(write):
    inside = '<vendor:limit lower="9"/>' + LIMIT
    xml = robot(joint("j1", "a", "b", inside=inside), links="ab", extra='<vendor:link name="no"/>')
    xml = xml.replace("<robot ", '<robot vendor:model="7" ')
    arm = from_urdf(write(xml))
    assert_same(arm.forward([0.3]), pinocchio_pose(xml, "a", "b", {"j1": 0.3}))
    assert (arm.joint_names, arm.lower[0]) == (("j1",), -1.5)


def test_limits_and_kinds_are_read(write):
    arm = from_urdf(write(WHOLE), tip="tool")
    assert arm.name == "r2"
    assert arm.prismatic == (False, False, True, False)
    np.testing.assert_array_equal(arm.lower, [-1.5, -np.inf, 0, -1.5])
    np.testing.assert_array_equal(arm.upper, [2.5, np.inf, 0.8, 2.5])
    np.testing.assert_array_equal(arm.velocity_limit, [3, np.inf, 0.1, 3])


def test_the_only_leaf_below_the_base_that_moves_is_the_tip(write):
    joints = joint("left", "a", "b"), joint("right", "a", "c"), joint("wrist", "c", "d")
    path = write(robot(*joints, joint("mount", "c", "e", "fixed"), links="abcde"))
    assert from_urdf(path, base="c").joint_names == ("wrist",)
    with pytest.raises(InvalidInputError, match="expected a tip, since there are several: 'd', 'b', 'e'"):
        from_urdf(path)


@pytest.mark.parametrize(
    ("quaternion", "rpy"),
    [
        ("0 0 0 1", (0, 0, 0)),
        ("0 0.7071067811865476 0 0.7071067811865476", (0, np.pi / 2, 0)),
        ("0 -0.7071067811865476 0 0.7071067811865476", (0, -np.pi / 2, 0)),
        ("-0.2 0.5 -0.4 0.7416198487095663", None),
        ("0.8 0 0.6 0", None),
    ],
)
def test_a_rotation_may_be_a_quaternion(write, quaternion, rpy):
    """That of URDF 1.1, which counted as no rotation."""
    inside = f'<origin xyz="0.1 0.2 0.3" quat_xyzw="{quaternion}"/>{LIMIT}'
    rotation, position = from_urdf(write(with_joint(inside=inside))).forward([0.0])
    expected = pin.Quaternion(np.array(quaternion.split(), dtype=float)).toRotationMatrix()
    np.testing.assert_allclose(rotation, expected, rtol=0, atol=1e-15)
    np.testing.assert_array_equal(position, [0.1, 0.2, 0.3])
    if rpy is not None:
        np.testing.assert_allclose(rotation, pin.rpy.rpyToMatrix(*rpy), rtol=0, atol=1e-15)


ENDLESS = '<limit lower="-1e16" upper="1e16" velocity="3" vendor:acceleration="3" effort="1"/>'


@pytest.mark.parametrize(
    ("kind", "inside", "line"),
    [
        ("revolute", '<axis xyz="0 0 2"/>' + LIMIT, "axis (0.0, 0.0, 2.0) was scaled to unit length"),
        ("revolute", '<axis xyz="0.71 0.71 0"/>' + LIMIT, ""),
        ("revolute", LIMIT.replace('"3"', '"180"'), "degrees? Its velocity limit is 180 rad/s"),
        ("prismatic", LIMIT.replace('"3"', '"180"'), ""),
        ("continuous", "", "continuous and has no velocity limit"),
        ("continuous", '<limit velocity="3" acceleration="1" jerk="1"/>', ""),
        ("revolute", ENDLESS, ""),
    ],
)
def test_what_is_unusual_is_said(write, kind, inside, line, caplog):
    arm = from_urdf(write(with_joint(kind, inside)))
    assert np.linalg.norm(arm.axes) == pytest.approx(1.0, abs=1e-15)
    assert [record.getMessage().startswith("arm.urdf: joint 'j1': ") for record in caplog.records] == [True] * bool(
        line
    )
    assert line in caplog.text


HAND = (joint("j1", "base", "arm"), joint("j2", "arm", "panda_hand", "fixed"))
FINGERS = (joint("finger_joint1", "panda_hand", "left", "prismatic"), joint("f2", "panda_hand", "right", "prismatic"))
LINKS = ("base", "arm", "panda_hand", "left", "right")


def test_the_only_tool_frame_is_the_tip_leaf_or_not(write):
    path = write(robot(*HAND, *FINGERS, links=LINKS))
    assert [tip.link for tip in arms.tips(path)] == ["panda_hand", "right", "left"]
    assert from_urdf(path).joint_names == ("j1",)
    # A tool frame below another one is nearer to the tool.
    tcp = '<link name="hand_tcp"/>' + joint("j3", "panda_hand", "hand_tcp", "fixed", '<origin xyz="0 0 0.1"/>')
    path = write(robot(*HAND, *FINGERS, links=LINKS, extra=tcp))
    np.testing.assert_array_equal(from_urdf(path).tool, [0, 0, 0.1])
    # Two hands, however, are a choice.
    two = '<link name="other_hand"/>' + joint("j3", "arm", "other_hand", "fixed", "")
    with pytest.raises(InvalidInputError, match="several: 'other_hand', 'panda_hand', 'right', 'left'"):
        from_urdf(write(robot(*HAND, *FINGERS, links=LINKS, extra=two)))


def test_no_arm_ends_at_a_finger_unless_it_is_asked_for(write, caplog):
    path = write(robot(joint("j1", "a", "b"), joint("gripper", "b", "c", "prismatic")))
    with pytest.raises(
        InvalidInputError, match=r"joint 'gripper' seems to belong to a gripper: 'b', the link before it, or 'c'"
    ):
        from_urdf(path)
    assert from_urdf(path, tip="c").joints == 2
    assert "the last joint of the arm, 'gripper', seems to belong to a gripper" in caplog.text


@pytest.mark.parametrize("link", ["tool0", "flange", "left_hand", "r_tcp", "ee_link", "gripper_l_base", "tool"])
def test_tool_frames_come_first(write, link):
    links = ("a", link, "b", "c")
    joints = joint("j1", "a", link), joint("j2", link, "b"), joint("finger", "b", "c")
    first, second = arms.tips(write(robot(*joints, links=links)))
    assert (first.link, first.leaf, first.gripper) == (link, False, False)
    assert (second.link, second.leaf, second.gripper) == ("c", True, True)


PAIR = (joint("j1", "a", "b"), joint("j2", "b", "c"))


def with_joint(kind="revolute", inside=LIMIT):
    return robot(joint("j1", "a", "b", kind, inside), links="ab")


def limits(text):
    return with_joint(inside=f"<limit {text}/>")


# Files that are refused, and a word of the message.
BAD_FILES = [
    ("", "expected XML, got 0 bytes"),
    (robot(*PAIR)[:-3], "expected XML"),
    (b'<robot name="\xff\xfe"/>', "fault: not well-formed"),
    (b'<?xml version="1.0" encoding="klingon"?><robot/>', "unknown encoding"),
    ("<a>" * 10**5, "expected XML"),
    ("<sdf/>", "root element <robot>, got <sdf>"),
    ('<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r"><xacro:macro name="m"/></robot>', "macros of xacro"),
    ('<robot name="r"/>', "at least one <link>"),
    (robot(), "at least one <joint>"),
    (robot(*PAIR).replace(' name="r2"', ""), 'expected <robot name="…">'),
    (robot(*PAIR, links="abca"), "two called 'a'"),
    (robot(joint("j", "a", "b"), joint("j", "b", "c")), "two called 'j'"),
    (robot(*PAIR).replace("name='c'", ""), 'expected <link name="…">'),
    (with_joint("hinge"), "type of <joint> .* got 'hinge'"),
    (with_joint("").replace(' type=""', ""), 'expected <joint type="…">'),
    (robot(*PAIR, links="ab"), "link of <child>"),
    (robot(*PAIR, links="bc"), "link of <parent>"),
    (with_joint().replace('<child link="b"/>', ""), "expected a <child>"),
    (with_joint().replace('<parent link="a"/>', "<parent/>"), 'expected <parent link="…">'),
    (with_joint(inside=LIMIT + LIMIT), "expected one <limit>, got 2"),
    (robot(*PAIR, joint("j3", "a", "c")), "one joint above it, got joint 'j2' and joint 'j3'"),
    (robot(*PAIR, joint("j3", "c", "a")), "got a loop of 'a', 'b', 'c'"),
    (
        robot(joint("j1", "a", "b"), joint("j2", "c", "d"), joint("j3", "d", "c"), links="abcd"),
        "got a loop of 'c', 'd'",
    ),
    (robot(*PAIR, links="abcde"), "one link without a joint above it, got 'a', 'd', 'e'"),
    (with_joint("floating"), "got 'floating'"),
    (with_joint("planar"), "got 'planar'"),
    (with_joint(inside=LIMIT + "<mimic joint='x'/>"), "got one with <mimic>"),
    (with_joint("fixed"), "a joint that moves"),
    (with_joint(inside=""), "expected a <limit>"),
    (with_joint("prismatic", ""), "expected a <limit>"),
    (robot(joint("mount", "a", "b", "fixed"), joint("mast", "a", "c", "fixed")), "a joint that moves below link 'a'"),
    (limits('lower="-1" upper="1"'), '<limit velocity="…">'),
    (limits('upper="1" velocity="0"'), "velocity limit above 0"),
    (limits('lower="2" upper="1" velocity="1"'), "limits lower < upper, got 2 and 1"),
    (limits('velocity="1"'), "limits lower < upper, got 0 and 0"),
    (with_joint(inside='<axis xyz="0 0 0"/>' + LIMIT), "axis with a direction"),
    (with_joint(inside='<origin RPY="0 1 0"/>' + LIMIT), "'RPY' of <origin>. Did you mean 'rpy'"),
    (with_joint(inside='<origin wxyz="1 0 0 0"/>' + LIMIT), "no attribute 'wxyz' of <origin>"),
    (with_joint(inside='<origin rpy="0 0 0" quat_xyzw="0 0 0 1"/>' + LIMIT), "rpy or quat_xyzw in <origin>, got both"),
    (with_joint(inside='<origin quat_xyzw="0 0 0 0"/>' + LIMIT), "quat_xyzw of unit length"),
    (with_joint(inside='<axis xzy="0 0 1"/>' + LIMIT), "'xzy' of <axis>. Did you mean 'xyz'"),
    (limits('Lower="-1" upper="1" velocity="1"'), "'Lower' of <limit>. Did you mean 'lower'"),
    (with_joint(inside='<Origin rpy="0 1 0"/>' + LIMIT), "'Origin' of <joint>. Did you mean 'origin'"),
    (with_joint("continuous", '<limits velocity="1"/>'), "'limits' of <joint>. Did you mean 'limit'"),
    (limits('lower="-170" upper="170" velocity="2"'), r"two turns, got -170 and 170: degrees\?"),
    (with_joint(inside=LIMIT.replace("2.5", "∞")), "upper to be a finite number"),
    (with_joint(inside=LIMIT.replace("3", "1 2")), "velocity to be a finite number"),
]
BAD_NUMBERS = ("0 0", "0 0 1 0", "", "nan 0 1", "0 inf 0", "0 0 1e999", "0 1_0 1", "0,0,1", "x y z")


def refused(path, message):
    with pytest.raises(InvalidInputError, match=rf"arm\.urdf: .*{message}"):
        from_urdf(path)


@pytest.mark.parametrize(("content", "message"), BAD_FILES, ids=[message for _, message in BAD_FILES])
def test_bad_files_are_refused(write, content, message, capfd):
    refused(write(content), message)
    # All is found out before Pinocchio sees it, which would complain otherwise.
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("tag", "key"), [("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")])
def test_bad_numbers_are_refused(write, tag, key):
    for numbers in BAD_NUMBERS:
        path = write(with_joint(inside=f'<{tag} {key}="{numbers}"/>{LIMIT}'))
        refused(path, f"joint 'j1': expected {key} to be 3 finite numbers, got '{numbers}'")


ENTITIES = "".join(f"<!ENTITY {new} '{10 * f'&{old};'}'>" for old, new in pairwise("abcdefghijklmnopqrstuvwxyz"))


@pytest.mark.parametrize(
    "content",
    [
        pytest.param(f"<!DOCTYPE r [<!ENTITY a 'a'>{ENTITIES}]><robot name='&z;'/>", id="entities without bound"),
        pytest.param("<!DOCTYPE r [<!ENTITY x SYSTEM 'file:///etc/hostname'>]><robot name='&x;'/>", id="another file"),
        pytest.param("<!DOCTYPE robot SYSTEM 'robot.dtd'><robot name='r'/>", id="external subset"),
        pytest.param("<!DOCTYPE r [<!ENTITY a 'a'>]><robot/>".encode("utf-16"), id="utf-16"),
    ],
)
def test_a_doctype_is_refused(write, content):
    with pytest.raises(InvalidInputError, match=r"arm\.urdf: expected no DOCTYPE"):
        from_urdf(write(content))


def test_what_cannot_be_read_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "missing.urdf", "bad\0name", 7.5, None):
        with pytest.raises(InvalidInputError, match="Cannot read"):
            from_urdf(path)


def chain(count):
    names = [f"l{i}" for i in range(count + 1)]
    return robot(*(joint(f"j{i}", *names[i : i + 2]) for i in range(count)), links=names)


def test_a_chain_that_would_overflow_the_stack_of_parsers_is_refused(write):
    with pytest.raises(InvalidInputError, match="expected at most 128 joints from 'l0' to 'l4000', got 4000"):
        from_urdf(write(chain(4000)))
    # The longest that is read, also on the small stack of a thread.
    read = []
    thread = threading.Thread(target=lambda: read.append(from_urdf(write(chain(128))).joints))
    thread.start()
    thread.join()
    assert read == [128]


def test_unknown_links_are_answered_with_the_nearest(write):
    path = write(WHOLE)
    with pytest.raises(UnknownNameError, match=r"no link 'tol'\. Did you mean 'tool'"):
        from_urdf(path, tip="tol")
    with pytest.raises(UnknownNameError, match=r"no link 'bas'\. Did you mean 'base'\? Available: world, base"):
        from_urdf(path, base="bas", tip="tool")


def test_a_missing_pinocchio_is_named_with_its_remedy(write, monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(MissingDependencyError, match=r'pip install "ikgym\[urdf\]"'):
        from_urdf(write(robot(*PAIR)))


TURN = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
OFFSET = '<origin xyz="0.1 -0.2 0.35" rpy="0 0 1.5707963267948966"/>'


@pytest.mark.parametrize("rotated", [False, True])
def test_a_tool_offset_is_a_fixed_joint_at_the_tip(write, rotated):
    inside = OFFSET if rotated else OFFSET.replace("1.5707963267948966", "0")
    end = '<link name="end"/>' + joint("mount2", "tool", "end", "fixed", inside)
    with_tool = WHOLE.replace("</robot>", f"{end}</robot>")
    arm = from_urdf(write(WHOLE), tip="tool", tool=[0.1, -0.2, 0.35], tool_rotation=TURN if rotated else None)
    for q in np.random.default_rng(1).uniform(-3, 3, (20, 4)):
        coordinates = dict(zip(["turn", "spin", "slide", "roll"], q, strict=True))
        assert_same(arm.forward(q), pinocchio_pose(with_tool, "world", "end", coordinates))


def test_an_arm_remembers_its_file_until_it_is_changed(write, monkeypatch):
    path = write(robot(*PAIR))
    monkeypatch.chdir(path.parent)
    arm = from_urdf(path.name, tip="c", tool=[0, 0, 0.1])
    assert (arm.urdf.file, arm.urdf.base, arm.urdf.tip) == (path.resolve(), None, "c")
    np.testing.assert_array_equal(arm.urdf.tool, [0, 0, 0.1])
    assert arm.replace(tool=np.zeros(3)).urdf is None
    assert arms.get("varga7").urdf is None
