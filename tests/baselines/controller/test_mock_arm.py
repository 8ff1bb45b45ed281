"""The mock arm refuses what a real one refuses, and lets pass what keeps the limits."""

import numpy as np
import pytest

import ikgym
from baselines.controller import ArmInterface, Controller, Drives, MockArm, Reflex
from docs import reflexes
from docs.reflexes import drive, scenario_of
from ikgym.exceptions import InvalidInputError
from ikgym.plant import Plant

SCENARIO = ikgym.scenarios.get("panda-circle")
ACCELERATION, JERK = SCENARIO.arm.acceleration_limit[0], SCENARIO.arm.jerk_limit[0]
DT = SCENARIO.dt


def first_joint(values):
    """Commands of the first joint; the others rest."""
    commands = np.zeros((len(values), 7))
    commands[:, 0] = values
    return commands


def reflex_of(commands, **options):
    """The reflex that commands start, and the period in which they do."""
    arm = ArmInterface(SCENARIO, **options)
    for k, command in enumerate(commands):
        if (state := arm.cycle(command)).reflex is not None:
            return state.reflex, k
    return None, len(commands)


def ramp(jerk, periods):
    """Velocities with a constant jerk."""
    return np.cumsum(np.cumsum(np.full(periods, jerk * DT * DT)))


def test_commands_within_the_limits_pass():
    assert reflex_of(first_joint(ramp(0.999 * JERK, 2)))[0] is None
    smooth = ramp(0.1 * JERK, 10)
    smooth = np.concatenate([smooth, smooth[-1] + 0.9 * ACCELERATION * DT * np.arange(1, 3)])
    assert reflex_of(first_joint(smooth[:10]))[0] is None


@pytest.mark.parametrize(
    ("values", "reflex", "period"),
    [
        (ramp(1.1 * JERK, 2), Reflex.JERK, 0),
        (ramp(0.9 * JERK, 5), Reflex.ACCELERATION, 2),
        ([3.0], Reflex.VELOCITY, 0),
        ([0.0, np.nan], Reflex.NOT_FINITE, 1),
    ],
)
def test_reflexes(values, reflex, period):
    assert reflex_of(first_joint(values)) == (reflex, period)


def test_an_array_that_is_used_again_hides_no_jump():
    arm, command = MockArm(SCENARIO, real_time=False), np.zeros(7)
    for speed in (0.0, 0.5):
        arm.read()
        command[:] = speed
        arm.write(command)
    assert arm.read().reflex is Reflex.ACCELERATION
    with pytest.raises(InvalidInputError, match=r"command: expected .*\(7,\)"):
        ArmInterface(SCENARIO).cycle([0.0])


def test_after_a_reflex_the_arm_comes_to_rest_and_stays_there():
    arm = ArmInterface(SCENARIO)
    for value in ramp(0.5 * JERK, 3):
        arm.cycle(first_joint([value])[0])
    arm.cycle(np.full(7, 9.0))
    for _ in range(50):
        state = arm.cycle(np.full(7, 0.1))
    assert state.reflex is Reflex.VELOCITY
    assert (state.commanded == 0.0).all()


def test_a_joint_that_comes_too_fast_near_its_stop():
    stop = SCENARIO.arm.upper[0]
    arm = ArmInterface(SCENARIO.replace(start=SCENARIO.arm.home + (stop - 0.02 - SCENARIO.arm.home) * np.eye(7)[0]))
    velocity, reflex = 0.0, None
    for k in range(200):
        velocity = min(velocity + min(k + 1, 2) * 0.4 * JERK * DT * DT, 1.0)
        reflex = arm.cycle(first_joint([velocity])[0]).reflex
        if reflex is not None:
            break
    assert reflex is Reflex.POSITION
    assert arm.true_q[0] < stop


def test_lost_messages_continue_the_motion_and_too_many_stop_it():
    arm = ArmInterface(SCENARIO)
    for value in ramp(0.1 * JERK, 3):
        last = arm.cycle(first_joint([value])[0]).commanded
    change = ramp(0.1 * JERK, 3)[2] - ramp(0.1 * JERK, 3)[1]
    for k in range(1, 21):
        state = arm.cycle(None)
        assert state.reflex is None
        assert state.commanded[0] == pytest.approx(last[0] + k * change)
    assert arm.cycle(None).reflex is Reflex.COMMUNICATION
    assert reflex_of(first_joint(np.zeros(60)), lost=1.0) == (Reflex.COMMUNICATION, 20)
    assert reflex_of(first_joint(np.zeros(60)), jitter=1e9) == (Reflex.COMMUNICATION, 20)


@pytest.mark.parametrize("arm", ["panda", "fr3"])
def test_the_loop_starts_no_reflex_with_a_limit_of_jerk(arm):
    scenario = scenario_of(arm, "circle")
    run = drive(scenario, 3, 1.5, jerk=True)
    assert run.stopped == ""
    assert run.largest < 1e-3
    assert drive(scenario, 3, 1.5, jerk=False).stopped == "jerk"


def test_a_measurement_that_was_killed_continues(tmp_path, monkeypatch):
    line = {"arm": "panda", "path": "circle", "runs": "1", "seconds": "1.2"}
    table = [line | {"jerk": "limited"}, line | {"jerk": "free"}]
    monkeypatch.setattr(reflexes, "WORK", tmp_path)
    monkeypatch.setattr(reflexes, "lines", lambda _: table)
    first, second = reflexes.measure()
    assert (first["stopped"], second["stopped"], second["by"]) == (0, 1, "jerk")
    assert 0.0 < first["error_rms_mm"] < first["error_max_mm"] < 1.0
    made = []
    monkeypatch.setattr(reflexes, "drive", lambda *_, jerk: made.append(jerk) or reflexes.Run(0.1, "velocity"))
    table[1]["runs"] = "2"
    again = reflexes.measure()
    assert (made, again[0]) == ([False], first)
    assert (again[1]["stopped"], again[1]["by"]) == (2, "jerk velocity")


@pytest.mark.slow
@pytest.mark.parametrize("path", ["square", "circle, retimed"])
def test_no_reflex_in_longer_runs(path):
    scenario = scenario_of("panda", path)
    for seed in range(3):
        assert drive(scenario, seed, 3.0, jerk=True).stopped == ""


def test_the_loop_starts_from_what_the_arm_has_taken_where_messages_are_lost():
    """With one of ten lost, and without the report, the next command would jump."""
    scenario = SCENARIO.replace(jerk_limit=None, steps=800)
    for reported in (True, False):
        arm = MockArm(scenario, real_time=False, lost=0.1, seed=1)
        controller = Controller(scenario)
        reference, state = scenario.nominal(preview=controller.ahead), arm.read()
        for k in range(scenario.steps):
            commanded = state.commanded if reported else None
            ahead = reference[k + 1 : k + 1 + controller.ahead]
            arm.write(controller.step(state.q, None, ahead, commanded=commanded))
            state = arm.read()
        assert state.reflex is None if reported else state.reflex is not None


@pytest.mark.parametrize("drives", ["identify", Drives()])
@pytest.mark.parametrize("reported", [True, False])
def test_periods_without_a_call_start_no_reflex_of_jerk_where_the_acceleration_is_reported(drives, reported):
    """The arm keeps its last acceleration, which the loop does not know from the velocities that it sees."""
    scenario, rng = SCENARIO.replace(jerk_limit=None, steps=1000), np.random.default_rng(1)
    arm = ArmInterface(
        scenario.replace(plant=Plant(bandwidth=8.0, command_delay=2) if drives == "identify" else Plant())
    )
    controller, state = Controller(scenario, drives=drives), arm.state
    reference = scenario.nominal(preview=controller.ahead)
    for k in range(scenario.steps):
        report = {"commanded": state.commanded, "commanded_acceleration": state.commanded_acceleration}
        if not reported:
            del report["commanded_acceleration"]
        command = controller.step(state.q, None, reference[k + 1 : k + 1 + controller.ahead], **report)
        for message in [command] if rng.random() > 0.02 else [None] * int(rng.integers(2, 10)):
            state = arm.cycle(message)
        if state.reflex is not None:
            break
    assert state.reflex is (None if reported else Reflex.JERK)
    assert controller.stopped is None


def test_a_stop_keeps_the_limits_of_acceleration_and_jerk():
    arm = ArmInterface(SCENARIO)
    velocity = first_joint(0.8 * np.append(ramp(0.9 * JERK, 2), ramp(0.9 * JERK, 2)[-1] + 0.7 * ACCELERATION * DT))
    states = [arm.cycle(command) for command in velocity] + [arm.brake() for _ in range(30)]
    acceleration = np.array([state.commanded_acceleration[0] for state in states])
    assert states[len(velocity) - 1].commanded[0] > 0.01
    assert (states[-1].commanded == 0.0).all()
    assert np.abs(acceleration).max() <= ACCELERATION
    assert np.abs(np.diff(acceleration, prepend=0.0)).max() <= (1.0 + 1e-9) * DT * JERK


@pytest.mark.parametrize("real_time", [False, True])
def test_stop_brings_the_arm_to_rest_and_switches_it_off(real_time):
    scenario = SCENARIO.replace(dt=0.02, steps=5)
    with MockArm(scenario, real_time=real_time) as arm:
        for speed in (0.0, 0.1, 0.2, 0.3, 0.3, 0.3, 0.3, 0.3):  # longer than the steps of the scenario
            arm.read()
            arm.write(np.full(7, speed))
        last = arm.stop()
        assert last.time >= 0.1
        assert (last.commanded == 0.0).all()
        assert last.reflex is None
        assert arm.stop() is None
    with pytest.raises(InvalidInputError, match="write: expected an arm that is switched on"):
        arm.write(np.zeros(7))


def test_a_process_keeps_its_period():
    """Slow enough for a machine that does other things besides."""
    scenario = SCENARIO.replace(dt=0.02, steps=50, plant=Plant(q_noise=1e-5))
    with MockArm(scenario) as arm:
        first = arm.read()
        assert first.reflex is None
        for _ in range(3):
            arm.write(np.zeros(7))
            state = arm.read()
        assert state.time > first.time
        arm.write(np.full(7, 9.0))
        while state.reflex is None:
            state = arm.read()
        assert state.reflex is Reflex.VELOCITY
    with pytest.raises(InvalidInputError, match="switched on"):
        arm.read()
    with pytest.raises(InvalidInputError, match="switched on"):
        arm.write(np.zeros(7))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"lost": 2.0}, "lost: expected a finite number"),
        ({"jitter": -1.0}, "jitter: expected a finite number"),
        ({"seed": -1}, "seed: expected"),
    ],
)
def test_bad_options(options, message):
    with pytest.raises(InvalidInputError, match=message):
        MockArm("panda-circle", real_time=False, **options)
    with pytest.raises(InvalidInputError, match=r"qdot: expected .*\(7,\)"):
        MockArm("panda-circle", real_time=False).write([0.0])
