"""Bounds with a limited jerk: never in contradiction, and a stop always lies in them."""

import numpy as np
import pytest

import baselines
import ikgym
from baselines.policy import Problem
from baselines.solvers.quadratic_program.velocity_box import (
    longest_way,
    smooth_box,
    stopping_change,
    stopping_way,
    velocity_box,
)
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import kernel

DT = 0.01
#: Stops at ±0.5, the largest velocity and its largest change; the largest change of that, as in panda at 1 ms or less.
LOWER, UPPER, FASTEST, CHANGE = -0.5, 0.5, 2.0, 0.15
STEPS = [0.075, 0.31 * CHANGE, 0.01, 0.001]


def limits_of(step, change=CHANGE, lower=LOWER, upper=UPPER):
    return np.array([[lower], [upper], [FASTEST], [change], [change], [step]])


@kernel
def walk(limits, dt, shares, held, out):
    """Moves a joint to shares of the width of the box, each for some steps; receives q, velocity and the box."""
    q, last, change, lower, upper = np.zeros(1), np.zeros(1), np.zeros(1), np.empty(1), np.empty(1)
    for k in range(out.shape[0]):
        smooth_box(limits, dt, q, last, change, lower, upper)
        velocity = lower[0] + shares[k // held] * (upper[0] - lower[0])
        change[0] = velocity - last[0]
        last[0] = velocity
        q[0] += dt * velocity
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = q[0], velocity, lower[0], upper[0]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("change", [CHANGE, np.inf])
def test_no_choice_of_velocities_leads_to_a_contradiction(step, change):
    """At either end of the box, and between, for one step or many."""
    rng = np.random.default_rng(1)
    for held in (1, 7, 200):
        out, shares = np.empty((20_000, 4)), rng.choice([0.0, 1.0, 0.5, rng.random()], 20_000)
        walk(limits_of(step, change), DT, shares, held, out)
        q, v, lower, upper = out.T
        changes = np.diff(v, prepend=0.0)
        assert (lower <= upper).all()
        assert q.min() >= LOWER - 1e-12
        assert q.max() <= UPPER + 1e-12
        assert np.abs(v).max() <= FASTEST + 1e-12
        assert np.abs(changes).max() <= change + 1e-12
        assert np.abs(np.diff(changes, prepend=0.0)).max() <= step + 1e-12
    assert q.max() > 0.49  # the stops are reached
    assert q.min() < -0.49


@pytest.mark.parametrize("step", STEPS)
def test_the_way_of_a_stop_is_that_of_its_steps(step):
    rng = np.random.default_rng(2)
    for _ in range(200):
        velocity, change = rng.uniform(-0.3, FASTEST), rng.uniform(-CHANGE, CHANGE)
        v, d, way, farthest = velocity, change, 0.0, 0.0
        while v > 0.0 or d > 0.0:
            before = d
            d = stopping_change(v, d, CHANGE, step)
            assert abs(d) <= CHANGE + 1e-12
            assert abs(d - before) <= step + 1e-12
            v += d
            way += v
            farthest = max(farthest, way)
        assert stopping_way(velocity, change, CHANGE, step) == pytest.approx(farthest, rel=1e-9, abs=1e-12)


def test_the_longest_way_is_a_bound():
    rng = np.random.default_rng(3)
    for _ in range(20_000):
        step = 10.0 ** rng.uniform(-6, 0)
        change = np.inf if rng.random() < 0.3 else step * 10.0 ** rng.uniform(-1, 3)
        velocity = step * 10.0 ** rng.uniform(-3, 4) * rng.choice([-1, 1])
        state = velocity, rng.uniform(-1, 1) * min(change, 50.0 * step), change, step
        assert stopping_way(*state) <= longest_way(*state)


def test_a_joint_beyond_its_stop_is_led_back_and_one_that_is_too_fast_brakes():
    q, v, d, bounds = np.array([0.52]), np.zeros(1), np.zeros(1), np.empty((2, 1))
    limits = limits_of(0.075)
    for _ in range(200):
        smooth_box(limits, DT, q, v, d, *bounds)
        assert bounds[0] <= bounds[1]
        velocity = bounds[1].copy()  # as far outwards as it may
        assert abs(velocity - v - d) <= 0.075 + 1e-12
        d, v, q = velocity - v, velocity, q + DT * velocity
    assert q == pytest.approx(UPPER, abs=1e-6)
    smooth_box(limits, DT, np.array([0.49]), np.array([1.0]), np.zeros(1), *bounds)
    assert bounds.ravel() == pytest.approx([0.925, 0.925])


def test_without_a_limit_of_jerk_the_box_is_that_of_velocity_and_acceleration():
    q, last, boxes = np.array([0.4]), np.array([0.7]), np.empty((4, 1))
    smooth_box(limits_of(np.inf), DT, q, last, np.full(1, np.nan), boxes[0], boxes[1])
    velocity_box(limits_of(np.inf), DT, q, last, boxes[2], boxes[3])
    assert (boxes[:2] == boxes[2:]).all()


def test_the_limits_of_the_panda_matter_below_periods_of_4_ms():
    scenario = ikgym.scenarios.get("panda-circle").replace(jerk_limit=None)
    assert [Problem.of(scenario.replace(dt=dt)).jerk_limited for dt in (0.001, 0.0039, 0.004, 0.01)] == [
        True,
        True,
        False,
        False,
    ]


def test_a_limit_of_jerk_that_no_stop_can_be_computed_with_is_refused():
    scenario = ikgym.scenarios.get("panda-circle").replace(steps=20)
    message = (
        r"jerk_limit: expected at least 4\.35 rad/s³ for joint 'panda_joint1', .*1000 periods of 1 ms, .*got 4\.3\."
    )
    for policy in ("qp", "sns", "dls"):
        with pytest.raises(InvalidInputError, match=message):
            baselines.make(policy, scenario.replace(jerk_limit=4.3))
    slow = scenario.replace(jerk_limit=[4.36, 4.36, 4.36, 4.36, 5.23, 5.23, 5.23])
    assert np.isfinite(baselines.track(slow, "qp").q).all()
