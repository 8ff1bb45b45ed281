"""Policies follow a target that is moved by hand, with the calls that a real arm would make."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines.viewer.approach import Approach, Pose
from baselines.viewer.following import Follower, followers
from baselines.viewer.replay import Stage


@pytest.fixture(scope="module")
def stage():
    return Stage.of("panda-circle", steps=20)


def approaching(stage, shift):
    """The reference on its way to a target beside the start."""
    out = Approach(stage.pose(0), *stage.pace)
    out.aim(Pose(stage.rotations[0], stage.path[0] + shift))
    return out


@pytest.mark.parametrize("policy", ["dls", "qp", "mfac"])
def test_a_policy_gets_to_the_target(stage, policy):
    (follower,) = followers(stage, [policy])
    way = approaching(stage, [0.0, 0.02, -0.01])
    for _ in range(400):
        follower.step(way)
        way.advance()
    position, orientation = follower.errors(way)
    assert position < 1e-4
    assert orientation < 1e-3
    np.testing.assert_allclose(stage.scenario.arm.forward(follower.q)[1], stage.path[0] + [0.0, 0.02, -0.01], atol=1e-4)


def test_a_step_is_that_of_the_controller(stage):
    """What is shown ahead are the nominal coordinates at just the steps that the policy asks for."""
    policy = baselines.make("dls", stage.scenario)
    follower, way = Follower(stage.scenario, policy, stage.start), approaching(stage, [0.01, 0.0, 0.0])
    follower.step(way)
    reference = stage.scenario.task.coordinates(*way.ahead([1]))
    pose = stage.scenario.task.coordinates(*stage.scenario.arm.forward(stage.start))
    action, _ = policy.predict({
        "q": stage.start, "qdot": np.zeros(7), "pose": pose, "nominal": reference, "remaining": np.array([1e6]),
    })  # fmt: skip
    moved = stage.scenario.dt * action * stage.scenario.velocity_limit
    assert np.abs(moved).max() > 1e-6
    # The controller keeps to the limit of acceleration, which holds back the first step.
    assert (np.sign(follower.q - stage.start) == np.sign(moved)).all()
    assert (np.abs(follower.q - stage.start) <= np.abs(moved) + 1e-12).all()


def test_no_joint_leaves_its_limits(stage):
    (follower,) = followers(stage, ["dls"])
    way = approaching(stage, [3.0, 0.0, 0.0])
    arm = stage.scenario.arm
    for _ in range(300):
        follower.step(way)
        way.advance()
        assert (arm.lower <= follower.q).all()
        assert (follower.q <= arm.upper).all()


def test_privileged_information_cannot_follow(stage):
    scenario = ikgym.scenarios.get("varga7-fast").replace(steps=5)
    solver, reference = followers(Stage.of(scenario), ["dls", "follow_nominal"])
    assert solver is not None
    assert reference is None


def test_a_placed_arm_has_forgotten(stage):
    (follower,) = followers(stage, ["mfac"])
    way = approaching(stage, [0.0, 0.02, 0.0])
    follower.step(way)
    first = follower.q
    way.advance()
    follower.step(way)
    follower.place(stage.start)
    follower.step(approaching(stage, [0.0, 0.02, 0.0]))
    np.testing.assert_array_equal(follower.q, first)
