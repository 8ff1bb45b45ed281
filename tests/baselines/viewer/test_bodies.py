"""The solids of an arm are where its kinematics are."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.viewer.approach import Pose
from baselines.viewer.bodies import BASE, bodies, joint_frames, size


def frames(arm, q):
    """Of the base and of all joints, seen from the base: rotations and positions."""
    out = [(np.eye(3), np.zeros(3))]
    for position, wxyz in zip(*joint_frames(arm, q), strict=True):
        step = Pose.at(position, wxyz)
        rotation, origin = out[-1]
        out.append((rotation @ step.rotation, origin + rotation @ step.position))
    return out


def postures(arm, count=3):
    low, high = np.maximum(arm.lower, -3.0), np.minimum(arm.upper, 3.0)
    return np.random.default_rng(0).uniform(low, high, (count, arm.joints))


@pytest.mark.parametrize("name", ikgym.arms.names())
def test_frames_of_joints_are_those_of_the_arm(name):
    arm = ikgym.arms.get(name)
    for q in postures(arm):
        found = frames(arm, q)
        np.testing.assert_allclose([p for _, p in found[1:]], arm.joint_points(q)[:, 1], atol=1e-12 * size(arm))
        (rotation, origin), (there, tool) = found[-1], arm.forward(q)
        np.testing.assert_allclose(rotation @ arm.chain.tool_rotation, there, atol=1e-12)
        np.testing.assert_allclose(origin + rotation @ arm.tool, tool, atol=1e-12 * size(arm))


@pytest.mark.parametrize("name", ["panda", "varga7", "tiago", "planar2"])
def test_links_lead_from_joint_to_joint_to_the_tool(name):
    arm = ikgym.arms.get(name)
    q = postures(arm, 1)[0]
    found, points = frames(arm, q), arm.joint_points(q)
    begins = [np.zeros(3), *points[:, 1]]
    ends = [*points[:, 0], arm.forward(q)[1]]
    for body in bodies(arm):
        rotation, origin = found[body.frame - BASE]
        if body.kind == "link":
            np.testing.assert_allclose(origin + rotation @ body.start, begins[body.frame + 1], atol=1e-9)
            np.testing.assert_allclose(origin + rotation @ body.end, ends[body.frame + 1], atol=1e-9)
        if body.kind == "tool":
            np.testing.assert_allclose(origin + rotation @ body.start, ends[-1], atol=1e-9)


def test_each_joint_has_a_solid_about_its_axis():
    arm = ikgym.arms.get("varga7")
    shown = {body.joint: body for body in bodies(arm) if body.joint is not None}
    assert sorted(shown) == list(range(7))
    for joint, body in shown.items():
        assert body.kind == ("prismatic" if arm.prismatic[joint] else "revolute")
        along = (body.end - body.start) / np.linalg.norm(body.end - body.start)
        np.testing.assert_allclose(along, arm.axes[joint], atol=1e-12)


def test_a_carriage_stays_on_its_rail():
    """At either end of its travel, the prismatic joint of TIAGo is at the same end of the rail."""
    arm = ikgym.arms.get("tiago")
    (joint,) = np.flatnonzero(arm.prismatic)
    (rail,) = [body for body in bodies(arm) if body.kind == "rail"]
    assert rail.frame == joint - 1
    q = postures(arm, 1)[0]
    for limit, end in ((arm.lower, rail.start), (arm.upper, rail.end)):
        q[joint] = limit[joint]
        rotation, origin = frames(arm, q)[rail.frame - BASE]
        np.testing.assert_allclose(origin + rotation @ end, arm.joint_points(q)[joint, 1], atol=1e-12)
