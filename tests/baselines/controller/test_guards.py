"""Guards of the loop, one by one: what trips them, and the stop that follows."""

from __future__ import annotations

import numpy as np
import pytest

from baselines import Controller, Drives, Guards, StopReason
from baselines.policy import Solution, SolverPolicy, Status, statuses
from ikgym.exceptions import InvalidInputError
from tests.baselines.controller.circles import circle

NAN = np.full(7, np.nan)


@pytest.fixture(scope="module")
def scenario():
    return circle("panda", 4e-3)


class Loop:
    """A perfect arm on its circle, with what a controller sees of it."""

    def __init__(self, scenario, **options):
        self.scenario = scenario
        self.controller = Controller(scenario, **{"drives": Drives(), **options})
        self.q, self.qdot, self.k = np.array(scenario.start), np.zeros(scenario.joints), 0
        self.nominal = scenario.nominal(0, self.controller.ahead + 1)

    def step(self, **changes):
        seen = {"q": self.q, "pose": None, "reference": self.nominal[self.k + 1 :][: self.controller.ahead], **changes}
        self.qdot = self.controller.step(seen.pop("q"), seen.pop("pose"), seen.pop("reference"), **seen)
        self.q, self.k = self.q + self.scenario.dt * self.qdot, self.k + 1
        return self.controller.stopped

    def run(self, steps):
        for _ in range(steps):
            assert self.step() is None
        return self


def far(loop):
    rotation, position = loop.scenario.arm.forward(loop.q)
    return {"pose": (rotation, position + np.array([0.0, 0.0, 0.03]))}


def turned(loop):
    rotation, position = loop.scenario.arm.forward(loop.q)
    return {"pose": (rotation @ np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), position)}


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (lambda loop: {"q": NAN}, StopReason.NOT_FINITE),
        (lambda loop: {"qdot": -NAN}, StopReason.NOT_FINITE),
        (lambda loop: {"pose": np.full(12, np.inf)}, StopReason.NOT_FINITE),
        (lambda loop: {"reference": np.full((2, 12), np.nan)}, StopReason.NOT_FINITE),
        (lambda loop: {"q_age": 11}, StopReason.STALE),
        (lambda loop: {"pose_age": 11}, StopReason.STALE),
        (lambda loop: {"q_age": -1}, StopReason.STALE),
        (lambda loop: {"q": loop.q + 0.02}, StopReason.JUMP),
        (lambda loop: {"q": np.r_[2.92, loop.q[1:]]}, StopReason.OUTSIDE_LIMITS),
        (far, StopReason.PATH_ERROR),
        (turned, StopReason.PATH_ERROR),
    ],
)
def test_what_trips_a_guard(scenario, fault, reason):
    """And stops the arm within its accelerations, until the controller begins anew."""
    loop = Loop(scenario).run(100)
    change, last = scenario.dt * scenario.arm.acceleration_limit, loop.qdot
    assert np.abs(last).max() > 0.05
    assert loop.step(**fault(loop)) is reason
    while last.any():
        assert (np.abs(loop.qdot) <= np.abs(last)).all()
        assert (np.abs(loop.qdot - last) <= change + 1e-12).all()
        last = loop.qdot
        assert loop.step() is reason
    loop.controller.reset()
    assert loop.controller.stopped is None


def test_a_joint_without_acceleration_limit_stops_in_a_stated_time():
    scenario = circle("ur10", 4e-3)
    loop = Loop(scenario, guards=Guards(stopping_time=0.5)).run(200)
    last = loop.qdot
    loop.step(q=NAN[:6])
    slower = np.abs(last) - np.abs(loop.qdot)
    fastest = np.argmax(np.abs(last))
    assert slower[fastest] == pytest.approx(scenario.dt * scenario.velocity_limit[fastest] / 0.5)


def test_late_measurements_may_jump_farther(scenario):
    """What was measured later has moved for longer."""
    tight = Guards(tolerance=1e-4, position_error=None, orientation_error=None)
    for age, reason in ((0, StopReason.JUMP), (9, None)):
        loop = Loop(scenario, guards=tight).run(3)
        before = loop.q
        loop.step(q_age=age)
        assert loop.step(q=before + 8 * scenario.dt * 0.5 * scenario.arm.velocity_limit) is reason


def test_a_sensor_that_repeats_itself_is_stale(scenario):
    """As soon as the arm should have moved."""
    loop = Loop(scenario, drives="identify").run(50)
    frozen, steps = loop.q, 0
    while loop.step(q=frozen) is None:
        steps += 1
    assert loop.controller.stopped is StopReason.STALE
    assert 10 + 12 <= steps < 70


def test_a_sensor_may_repeat_itself_at_rest(scenario):
    loop = Loop(scenario)
    for _ in range(300):
        assert loop.step(q=scenario.start, reference=loop.nominal[:1]) is None


def test_guards_can_be_wider(scenario):
    loop = Loop(scenario, guards=Guards(position_error=None, orientation_error=None, tolerance=0.1, age=20)).run(10)
    assert loop.step(q=loop.q + 0.05, q_age=20, **far(loop)) is None


class Failing(SolverPolicy):
    """Raises an error, or diverges, as the test wants."""

    how = None

    def solve(self, batch, memory):
        if self.how == "raise":
            raise np.linalg.LinAlgError("singular")
        status = Status.DIVERGED if self.how == "diverge" else Status.APPLIED
        return Solution(np.full(batch.q.shape, 0.1), memory, statuses(len(batch.q), status), statuses(len(batch.q)))


@pytest.mark.parametrize("how", ["raise", "diverge"])
def test_a_policy_that_fails_is_a_reason(scenario, how, monkeypatch, caplog):
    loop = Loop(scenario, policy=Failing.for_scenario(scenario))
    loop.run(20)
    moving = loop.qdot
    monkeypatch.setattr(Failing, "how", how)
    assert loop.step() is StopReason.POLICY
    assert (loop.qdot > 0.0).all()
    assert (loop.qdot < moving).all()
    assert ("LinAlgError: singular" in caplog.text) == (how == "raise")


def test_what_the_loop_cannot_make_anew(scenario):
    with pytest.raises(InvalidInputError, match="expected one with a name"):
        Controller(scenario, Failing.for_scenario(scenario))


def test_a_measured_velocity_beyond_the_limits_is_no_reason_to_go_on_with_it(scenario):
    loop = Loop(scenario)
    for _ in range(3):
        loop.step(qdot=np.full(7, 1e9))
        assert (np.abs(loop.qdot) <= scenario.arm.velocity_limit).all()


@pytest.mark.parametrize("first", [None, 2.0])
@pytest.mark.parametrize(
    "fault", [{"q": NAN}, {"q_age": -1.0}, {"pose": np.full(12, np.nan)}, {"q": np.full(7, 9.0)}, {"pose_age": np.inf}]
)
def test_a_stop_in_the_first_period_ends_at_rest_whatever_is_measured(scenario, first, fault):
    loop = Loop(scenario)
    seen = {"qdot": None if first is None else np.full(7, first), **fault}
    assert loop.step(**seen) is not None
    last = loop.qdot
    trusted = first is not None and all(np.isfinite(value).all() for value in fault.values())
    assert last.any() == trusted
    for k in range(100):
        loop.step(**{"qdot": np.full(7, 2.0 * (-1.0) ** k) if k % 3 else NAN, **fault})
        assert (np.abs(loop.qdot) <= np.abs(last)).all()
        assert (loop.qdot * last >= 0.0).all()
        last = loop.qdot
    assert not last.any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda scenario: Controller(scenario, guards=True), "guards: expected Guards.…. or None, got True"),
        (lambda scenario: Loop(scenario).step(q_age=None), "q_age: expected an array of real numbers, got None"),
        (lambda scenario: Loop(scenario).step(pose_age="1"), "pose_age: expected an array of real numbers, got '1'"),
        (lambda scenario: Loop(scenario).step(obstacles=[]), "obstacles: expected none"),
        (lambda scenario: Loop(scenario).controller.warm_up(10**400), "calls: expected a whole number from 1 to"),
    ],
)
def test_hostile_input(scenario, call, message):
    with pytest.raises(InvalidInputError, match=message) as error:
        call(scenario)
    assert "\n" not in str(error.value)
