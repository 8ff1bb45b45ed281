"""Limits belong to the plant: what no policy can do, and how it is reported."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

import ikgym
from ikgym.exceptions import InvalidInputError
from tests.comparison import identical
from tests.limited import ACCELERATION, LOWER, UPPER, VELOCITY, limited

DT, SCALE = 0.1, 4.0
# The bandwidth at which a drive makes up for half of what is missing in a step, in [Hz].
HALF = math.log(2.0) / (2.0 * math.pi * DT)


def one_joint(lower=-1.0, upper=1.0, velocity=2.0, acceleration=np.inf, **changes):
    """A slide along x that starts at 0 with commands up to ±4 m/s."""
    arm = ikgym.Arm("slide", [[0, 0, 0]], [[1, 0, 0]], (True,), [0, 0, 0], np.eye(3), [lower], [upper])
    arm = arm.replace(velocity_limit=[velocity], acceleration_limit=[acceleration])
    still = ikgym.trajectories.Sinusoid(np.zeros(1))
    task = ikgym.tasks.get("position")
    given = {"velocity_limit": SCALE, "dt": DT, "start": [0.0], "steps": 50}
    return ikgym.Scenario("slide", arm, task, still, **{**given, **changes})


def played(scenario, commands):
    """q, q̇ and joints held back after each command in [m/s]."""
    env = ikgym.RedundantIKEnv(scenario)
    env.reset(seed=0)
    steps = [env.step(np.array([command / SCALE])) for command in commands]
    return [(seen["q"][0], seen["qdot"][0], tuple(info["at_limit"].tolist())) for seen, *_, info in steps]


@pytest.mark.parametrize(
    ("scenario", "commands", "wanted"),
    [
        # The command is cut to the velocity limit, and so is what is observed.
        (one_joint(), [1.0, 4.0, -4.0], [(0.1, 1.0, (0, 0, 0)), (0.3, 2.0, (0, 1, 0)), (0.1, -2.0, (0, 1, 0))]),
        # The change is cut, beginning at rest; from 1.5 back to 0 takes two steps.
        (
            one_joint(velocity=np.inf, acceleration=10.0),
            [2.0, 1.5, 0.0, 0.0],
            [(0.1, 1.0, (0, 0, 1)), (0.25, 1.5, (0, 0, 0)), (0.3, 0.5, (0, 0, 1)), (0.3, 0.0, (0, 0, 0))],
        ),
        # Both: first the velocity, then its change.
        (
            one_joint(acceleration=10.0),
            [4.0, 4.0, 4.0],
            [(0.1, 1.0, (0, 1, 1)), (0.3, 2.0, (0, 1, 0)), (0.5, 2.0, (0, 1, 0))],
        ),
        # The joint goes as far as its stop, and rests there; it leaves at once.
        (
            one_joint(upper=0.25),
            [2.0, 2.0, 2.0, -1.0],
            [(0.2, 2.0, (0, 0, 0)), (0.25, 0.5, (1, 0, 0)), (0.25, 0.0, (1, 0, 0)), (0.15, -1.0, (0, 0, 0))],
        ),
        # It rests, whatever the acceleration limit says, and is accelerated from there.
        (
            one_joint(upper=0.15, acceleration=10.0),
            [1.0, 2.0, 0.0, -2.0],
            [(0.1, 1.0, (0, 0, 0)), (0.15, 0.5, (1, 0, 0)), (0.15, 0.0, (0, 0, 0)), (0.05, -1.0, (0, 0, 1))],
        ),
        # A joint that cannot brake in time runs into its stop.
        (
            one_joint(upper=0.3, acceleration=10.0),
            [1.0, 2.0, 0.0],
            [(0.1, 1.0, (0, 0, 0)), (0.3, 2.0, (0, 0, 0)), (0.3, 0.0, (1, 0, 1))],
        ),
        # The bias comes after velocity and acceleration, before the stop; it is no part of what is observed.
        (
            one_joint(upper=0.5, plant=ikgym.Plant(bias=0.5)),
            [4.0, 2.0, -0.5, 0.0],
            [(0.25, 2.0, (0, 1, 0)), (0.5, 2.0, (0, 0, 0)), (0.5, -0.5, (0, 0, 0)), (0.5, 0.0, (1, 0, 0))],
        ),
        # All in their order: delay, velocity, acceleration, a lag that makes up for half in a step, bias, stop.
        (
            one_joint(upper=0.5, acceleration=10.0, plant=ikgym.Plant(command_delay=1, bandwidth=HALF, bias=0.5)),
            [4.0, 4.0, 0.0, 0.0, 0.0, 0.0],
            [
                (0.05, 0.0, (0, 0, 0)),
                (0.15, 1.0, (0, 1, 1)),
                (0.325, 2.0, (0, 1, 0)),
                (0.4875, 1.0, (0, 0, 1)),
                (0.5, 0.125, (1, 0, 0)),
                (0.5, 0.0, (1, 0, 0)),
            ],
        ),
        # Backlash comes after all of them but the stop: half of it is lost at the start, all of it at a turn.
        (
            one_joint(plant=ikgym.Plant(backlash=0.1, bias=0.5)),
            [1.0, 1.0, -1.5, -1.5],
            [(0.1, 1.0, (0, 0, 0)), (0.25, 1.0, (0, 0, 0)), (0.25, -1.5, (0, 0, 0)), (0.15, -1.5, (0, 0, 0))],
        ),
    ],
)  # fmt: skip
def test_a_step_goes_by_the_order_of_the_limits(scenario, commands, wanted):
    for got, want in zip(played(scenario, commands), wanted, strict=True):
        np.testing.assert_allclose(got[:2], want[:2], rtol=0, atol=1e-12)
        assert got[2] == want[2]


def test_who_keeps_a_limit_exactly_is_not_held_back():
    """Actions in float32 miss it by some 1e-8, which is no matter of the policy."""
    env = ikgym.RedundantIKEnv(one_joint(upper=1 / 3, velocity=0.7))
    env.reset()
    held = np.zeros(3)
    for _ in range(4):
        seen, *_, info = env.step(np.array([0.7 / SCALE], dtype=np.float32))
        held += info["at_limit"]
        assert abs(seen["qdot"][0]) <= 0.7
    seen, _, _, _, info = env.step(np.array([(1 / 3 - seen["q"][0]) / DT / SCALE], dtype=np.float32))
    assert not (held + info["at_limit"]).any()
    assert seen["q"][0] <= 1 / 3


ACTIONS = hnp.arrays(np.float32, (25, 7), elements=st.floats(-1.5, 1.5, width=32))


@settings(max_examples=40, derandomize=True, deadline=None)
@given(ACTIONS, st.integers(0, 10_000), st.sampled_from([0.0, 3.0]))
def test_no_action_leaves_the_limits(actions, seed, noise):
    """Noise or not; that each step is that of the specification is in tests/test_env.py."""
    scenario = limited(steps=len(actions), plant=ikgym.Plant(noise=noise))
    env = ikgym.RedundantIKEnv(scenario)
    last, _ = env.reset(seed=seed)
    for action in actions:
        seen, *_ = env.step(action)
        q, qdot, dt = seen["q"], seen["qdot"], scenario.dt
        assert ((q >= LOWER) & (q <= UPPER)).all()
        assert (np.abs(qdot) <= np.minimum(VELOCITY, scenario.velocity_limit)).all()
        assert env.observation_space.contains(seen)
        free = (q > LOWER) & (q < UPPER)
        change = np.abs(qdot - last["qdot"])
        assert (change[free] <= dt * ACCELERATION[free] * (1 + 1e-9) + 1e-12).all()
        last = seen


def test_wide_limits_change_no_bit():
    plain = limited(arm=ikgym.arms.get("varga7"))
    wide = np.full(7, 1e9)
    arm = plain.arm.replace(lower=-wide, upper=wide, velocity_limit=wide, acceleration_limit=1e6 * wide)
    envs = [ikgym.RedundantIKEnv(plain), ikgym.RedundantIKEnv(plain.replace(arm=arm))]
    firsts = [env.reset(seed=5) for env in envs]
    assert identical(*firsts)
    rng = np.random.default_rng(0)
    for _ in range(plain.steps):
        action = rng.uniform(-1.2, 1.2, 7)
        assert identical(*(env.step(action) for env in envs))


@pytest.mark.parametrize("make", [ikgym.RedundantIKEnv, lambda scenario: ikgym.RedundantIKVectorEnv(2, scenario)])
def test_a_start_outside_the_limits_is_refused_with_its_joint(make):
    env = make(limited())
    before, _ = env.reset(seed=3)
    env.reset(seed=3, options={"q": [0.8, -1.0, 0, 3, 0, -5, 2.0]})  # at the stops, and beyond where there are none
    env.reset(seed=3)
    message = (
        r"options\['q'\]: expected joint 'joint_5' of arm 'limited7' within its limits, "
        r"from -1.6 to 1.6 \[rad\], got 1.601"
    )
    with pytest.raises(InvalidInputError, match=message):
        env.reset(options={"q": [0, 0, 0, 0, 1.601, 9, 0]})
    with pytest.raises(InvalidInputError, match=r"joint 'joint_3' of arm .* from -1.2 to 1.2 \[m\], got -1.3"):
        env.reset(options={"q": [0, 0, -1.3, 0, 0, 0, 0]})
    assert identical(env.reset(seed=3)[0], before)


def test_the_bounds_of_q_are_the_limits():
    box = ikgym.RedundantIKEnv(limited(steps=100_000)).observation_space["q"]
    np.testing.assert_array_equal(box.low[np.isfinite(LOWER)], LOWER[np.isfinite(LOWER)])
    np.testing.assert_array_equal(box.high[np.isfinite(UPPER)], UPPER[np.isfinite(UPPER)])
    assert np.isfinite([box.low, box.high]).all()
    reach = limited(steps=100_000).arm.reach(limited(steps=100_000).joint_bound())
    assert reach < 13.0  # the slide ends at its stop
    speeds = ikgym.RedundantIKEnv(limited()).observation_space["qdot"].high
    np.testing.assert_array_equal(speeds, np.minimum(VELOCITY, 20.0))


def test_an_action_of_1_means_the_limits_of_the_arm():
    made = {"arm": one_joint().arm, "task": one_joint().task, "trajectory": one_joint().trajectory}
    scenario = ikgym.Scenario("own", **made)
    assert scenario.velocity_limit.tolist() == [2.0] == scenario.largest_qdot.tolist()
    faster = scenario.arm.replace(velocity_limit=[3.0])
    assert scenario.replace(arm=faster).velocity_limit.tolist() == [3.0]
    assert scenario.replace(arm=faster, velocity_limit=1.0).velocity_limit.tolist() == [1.0]
    free = scenario.arm.replace(velocity_limit=None)
    assert scenario.replace(arm=free).velocity_limit.tolist() == [2.0]
    assert one_joint().replace(arm=faster).velocity_limit.tolist() == [SCALE]
    with pytest.raises(InvalidInputError, match="arm 'slide' has no velocity limit of its own at joint 'joint_1'"):
        ikgym.Scenario("own", **{**made, "arm": free})
    with pytest.raises(InvalidInputError, match=r"has no velocity limit of its own at joint 'joint_2', 'joint_4'\."):
        limited(velocity_limit=None)
