"""The loop on perfect drives: the policy acts on the measurements, as in the environment."""

from __future__ import annotations

import numpy as np
import pytest

import baselines
import ikgym
from baselines import Controller, Drives, Guards
from ikgym.exceptions import InvalidInputError, UnknownNameError
from tests.limited import limited

STEPS = 25
#: For paths that an arm cannot follow.
LOST = Guards(position_error=None, orientation_error=None)


def perfect(which, name, **parameters):
    return Controller(which, baselines.make(name, which, **parameters), Drives(), guards=LOST)


def scenario(name="varga7-fast"):
    return ikgym.scenarios.get(name).replace(steps=STEPS)


def driven(which, name, pose, **parameters):
    """Joint coordinates of a plain loop, after each step."""
    controller = Controller(which, (name, parameters), Drives(), guards=LOST, steps=STEPS)
    nominal, q = which.nominal(0, controller.ahead), np.array(which.first_q(which.trajectory))
    out = []
    for k in range(STEPS):
        qdot = controller.step(q, pose(which, q), nominal[k + 1 : k + 1 + controller.ahead])
        q = q + which.dt * qdot
        out.append(q)
    return np.array(out)


@pytest.mark.parametrize(
    ("name", "parameters", "pose"),
    [
        ("dls", {}, lambda which, q: which.task.coordinates(*which.arm.forward(q))),
        ("dls", {}, lambda which, q: which.arm.forward(q)),
        ("rhc", {"horizon": 8, "stop_at_end": True}, lambda which, q: None),
    ],
    ids=["coordinates", "rotation and position", "of the model"],
)
def test_it_moves_the_arm_as_the_environment_does(name, parameters, pose):
    which = scenario()
    expected = baselines.track(which, (name, parameters)).q
    np.testing.assert_allclose(driven(which, name, pose, **parameters), expected, rtol=0, atol=1e-12)


def test_it_remembers_until_it_is_reset():
    which = scenario()
    controller = perfect(which, "smoothed")
    q, nominal = which.first_q(which.trajectory), which.nominal(0, 3)[1:]
    made = [controller.step(q, None, nominal) for _ in range(3)]
    assert (made[0] != made[2]).any()
    assert controller.report.iterations.shape == (1,)
    controller.reset()
    np.testing.assert_array_equal([controller.step(q, None, nominal) for _ in range(3)], made)
    controller.reset()
    with pytest.raises(InvalidInputError, match="expected a step to be made first"):
        controller.report  # noqa: B018


def test_joint_velocities_stay_within_their_limit_and_are_our_own():
    which = scenario().replace(velocity_limit=0.01)
    controller = perfect(which, "dls")
    qdot = controller.step(which.first_q(which.trajectory), None, which.nominal(0)[-1:] + 0.1)
    assert np.abs(qdot).max() == pytest.approx(0.01)
    qdot[:] = 99.0
    controller.step(which.first_q(which.trajectory), None, which.nominal(0)[-1:])
    assert controller._last.max() <= 0.01 + 1e-9


@pytest.mark.parametrize(("name", "parameters"), [("dls", {}), ("rhc", {"horizon": 8, "rate_weight": 10.0})])
def test_an_arm_with_limits_is_driven_within_them_and_the_policy_sees_how(name, parameters):
    """The environment, step by step: what it applies is what the controller returns, and remembers."""
    which = limited(steps=40)
    policy = baselines.make(name, which, **parameters)
    env = ikgym.RedundantIKEnv(which, preview=policy.preview)
    controller, state = Controller(which, policy, Drives(), guards=LOST), None
    seen, _ = env.reset(seed=4)
    held = np.zeros(3)
    for _ in range(which.steps):
        qdot = controller.step(seen["q"], seen["pose"], seen["nominal"])
        action, state = policy.predict({**seen, "remaining": np.array([1e6])}, state)
        seen, *_, info = env.step(action)
        np.testing.assert_array_equal(qdot, seen["qdot"])
        held += info["at_limit"]
    assert (held > 0).all() if name == "dls" else not held.any()  # dls knows of no limit, and rhc keeps all of them


def test_a_measured_velocity_is_what_the_acceleration_starts_from():
    which = limited()
    most = which.dt * which.arm.acceleration_limit[0]
    q, there = np.zeros(7), which.nominal(0)[1:] + 0.5
    for measured in (0.0, 2.0, -3.0):
        controller = perfect(which, "dls")
        qdot = controller.step(q, None, there, qdot=np.full(7, measured))
        assert abs(qdot[0] - measured) <= most + 1e-12


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros(6), None, np.zeros((2, 6))), r"q: expected shape \(7,\), got \(6,\)"),
        ((["a"] * 7, None, np.zeros((2, 6))), "q: expected an array of real numbers"),
        ((np.zeros(7), np.zeros(5), np.zeros((2, 6))), r"pose: expected shape \(6,\), got \(5,\)"),
        ((np.zeros(7), None, np.zeros(6)), r"reference: expected shape \(any, 6\), got \(6,\)"),
        ((np.zeros(7), None, np.zeros((1, 6))), "reference: expected 2 poses, so far rhc_gradient looks ahead, got 1"),
    ],
)
def test_what_has_a_wrong_shape_is_refused(arguments, message):
    with pytest.raises(InvalidInputError, match=message):
        perfect(scenario(), "rhc_gradient").step(*arguments)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Controller("varga7-fast", "dlss"), "Did you mean 'dls'"),
        (lambda: Controller("varga7-fast", 3), "policy: expected 'name:parameter=value' or"),
        (lambda: Controller("varga7-fast", "follow_nominal", Drives()), "privileged information on one .*: give its"),
        (lambda: Controller("varga7-fast", "follow_nominal"), "one that acts on what it sees, got the reference"),
        (lambda: Controller("varga7-fast", "dls", steps=0), "steps: expected a whole number of at least 1"),
        (
            lambda: Controller("varga7-fast", baselines.make("dls", "panda-circle")),
            "expected one for 7 joints, the task",
        ),
        (lambda: Drives(-1), "delay: expected a number of at least 0 or one a joint, got -1"),
        (lambda: Controller("panda-circle", drives=Drives((1, 2))), "delay: expected "),
        (lambda: Drives(2, -0.02), "time_constant: expected a number of at least 0 or one a joint, got -0.02"),
        (
            lambda: Controller("varga7-fast", drives="known"),
            "drives: expected Drives.…., 'identify' or a file that ends in .toml, got 'known'",
        ),
        (lambda: Controller("panda-circle", "predicted", Drives(2)), "drives: predicted predicts by itself"),
        (lambda: Guards(age=-1), "age: expected a whole number of at least 0"),
        (lambda: Guards(tolerance=None), "tolerance: expected a finite number above 0, got None"),
        (lambda: Guards(position_error=np.inf), "position_error: expected a finite number above 0, got inf"),
    ],
)
def test_bad_input(make, message):
    with pytest.raises((InvalidInputError, UnknownNameError), match=message):
        make()
