"""From a motion that excites an arm to its log, its plant, a scenario and a controller; and logs that are refused."""

import dataclasses
import math

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import baselines
import ikgym
from baselines.cli import main
from baselines.identification.excitation import excite
from baselines.identification.log import Log, read
from baselines.identification.report import identify
from ikgym import Plant
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.plant.identified import IdentifiedPlant

ARM = ikgym.arms.get("panda")
PERIOD = 0.002
DELAYS = (0.0, 1.3, 2.0, 3.6, 0.5, 5.0, 2.25)
CONSTANTS = np.array([5.0, 8.0, 12.0, 18.0, 25.0, 32.0, 40.0]) * 1e-3
LAGS = Plant(command_delay=DELAYS, bandwidth=tuple(1.0 / (2.0 * math.pi * CONSTANTS)), gain=(1, 0.98, 1, 1, 1, 0.95, 1))
#: A servo of second order with an overshoot.
SERVO = (1.6, -0.68, 0.0, 0.02, 0.04, 0.02, 0.0)


def record(plant, seconds=20.0, period=PERIOD, share=0.4):
    """The log of a motion that excites the simulated arm."""
    _, command = excite(ARM, seconds, period, share)
    scenario = ikgym.scenarios.get("panda-random").replace(dt=period, steps=len(command), start=ARM.home, plant=plant)
    env, q = ikgym.RedundantIKEnv(scenario), []
    seen, _ = env.reset(seed=0)
    for row in command:
        q.append(seen["q"])
        seen, *_ = env.step(row / scenario.velocity_limit)
    return Log(period, np.array(q), command)


@pytest.fixture(scope="module")
def log():
    return record(LAGS)


def frame_of(log):
    """The log as the columns of a CSV file."""
    columns = {"t": log.period * np.arange(len(log.q))}
    for kind, values in (("q", log.q), ("command", log.command)):
        columns |= {f"{kind}.{name}": values[:, j] for j, name in enumerate(ARM.joint_names)}
    return pd.DataFrame(columns)


@pytest.mark.parametrize("bits", [None, pytest.param(14, marks=pytest.mark.slow)])
def test_the_drives_of_the_simulator_are_recovered(log, bits):
    if bits:
        step = 2.0 * math.pi / 2**bits
        log = log._replace(q=np.round(log.q / step) * step)
    found = identify(log, ARM)
    lags = [joint.lag for joint in found.joints]
    latency = np.array([lag.delay + lag.time_constant / PERIOD for lag in lags])
    wanted = np.array(DELAYS) + CONSTANTS / PERIOD
    np.testing.assert_allclose([lag.time_constant for lag in lags], CONSTANTS, rtol=0.1 if bits else 0.03)
    np.testing.assert_allclose([lag.gain for lag in lags], LAGS.gain, rtol=2e-3)
    np.testing.assert_allclose(latency, wanted, atol=0.1)
    late = np.array([lag.delay for lag in lags]) - DELAYS
    if bits:  # the log tells no more of the fast drives, by the bound of Cramér and Rao
        assert (np.abs(late) < 3.0 * np.array([lag.deviations[0] for lag in lags])).all()
        assert min(lag.deviations[0] for lag in lags[:2]) > 0.1
    else:
        np.testing.assert_allclose(late, 0.0, atol=0.1)
        np.testing.assert_allclose(found.plant.plant.bandwidth, LAGS.bandwidth, rtol=0.03)
    assert not found.shaped
    assert not found.warnings()
    assert found.errors(log).max() < (0.03 if bits else 1e-4)


def test_a_servo_of_higher_order_becomes_a_drive_of_low_order():
    """It predicts a second motion, and joints that stood still have the numbers of the others."""
    plant = Plant(drive=SERVO, command_delay=2)
    log, other = record(plant, 12.0), record(plant, 8.0, share=0.2)
    still = log.command.copy()
    still[:, 3] = 0.0
    q = log.q.copy()
    q[:, 3] = q[0, 3]
    found = identify(log._replace(command=still, q=q), ARM)
    assert found.shaped
    assert found.errors(other)[[0, 1, 2, 4, 5, 6]].max() < 1e-3
    first, impulse = found.joints[0], np.eye(1, 60)[0]  # of the responses: a pole and a zero may cancel
    responses = [
        np.concatenate([np.zeros(whole), lfilter(row[3:], np.append(1.0, -np.array(row[:3])), impulse)])[:60]
        for whole, row in ((first.whole, first.row), (2, SERVO))
    ]
    np.testing.assert_allclose(*responses, atol=1e-5)
    assert [line.partition(" ")[0] for line in found.warnings()] == ["panda_joint4"]
    assert found.plant.plant.drive[0] == found.joints[0].row
    assert 2.0 < found.plant.plant.command_delay[3] < 20.0


def test_friction_and_a_dead_band_show(log):
    """Here each joint loses 5 mrad/s, and is at rest below that."""
    speed = np.diff(log.q, axis=0) / PERIOD
    lost = np.sign(speed) * np.maximum(np.abs(speed) - 5e-3, 0.0)
    q = log.q[0] + PERIOD * np.concatenate([np.zeros((1, 7)), np.cumsum(lost, axis=0)])
    found = identify(log._replace(q=q), ARM)
    assert sum("friction or a dead band" in line for line in found.warnings()) >= 5
    np.testing.assert_allclose([joint.friction for joint in found.joints if joint.friction], 5e-3, rtol=0.4)


def _swap(frame):
    one, other = "q.panda_joint2", "q.panda_joint6"
    shift = frame[one].iloc[0] - frame[other].iloc[0]
    return frame.assign(**{one: frame[other] + shift, other: frame[one] - shift})


def _measure(frame):
    speeds = {f"command.{name}": np.gradient(frame[f"q.{name}"], PERIOD) for name in ARM.joint_names}
    return frame.assign(**speeds)


BAD = {
    "gap": (lambda f: f.drop(index=range(3000, 3020)), "expected no gaps, got one of 42 ms after t = 5.998 s"),
    "equal": (lambda f: f.assign(t=f.t.where(f.index != 9, f.t[8])), "line 11: .* got equal ones: t = 0.016 s"),
    "falling": (lambda f: f.assign(t=f.t.where(f.index != 9, 0.0)), "line 11: .* got falling ones"),
    "degrees": (
        lambda f: f.assign(**{name: np.degrees(f[name]) for name in f if name != "t"}),
        "got .* these look like degrees",
    ),
    "command in degrees": (
        lambda f: f.assign(**{name: np.degrees(f[name]) for name in f if name.startswith("command")}),
        "these look like degrees",
    ),
    "measured": (_measure, "these look like measured velocities"),
    "swapped": (_swap, "got a motion that follows command.panda_joint[26]: joints are swapped"),
    "names": (lambda f: f.rename(columns={"q.panda_joint3": "q.panda_joint33"}), "panda_joint33.*Did you mean"),
    "missing": (lambda f: f.drop(columns="command.panda_joint7"), "got none named command.panda_joint7"),
    "rest": (lambda f: f.assign(**{name: 0.0 for name in f if name[0] == "c"}), "got a log at rest"),
    "a second": (lambda f: f[:500], "expected at least 4 s, got 0.998 s"),
    "saturated": (
        lambda f: f.assign(**{"command.panda_joint1": np.sign(np.sin(9.0 * f.t)) * 2.175}),
        "command.panda_joint1: .* got (9\\d|100) % of them at it or beyond: what a saturated drive does",
    ),
    "two periods": (
        lambda f: f.assign(t=np.cumsum(np.where(f.index < 4000, PERIOD, 2.0 * PERIOD))),
        "expected one control period, got .* around .* ms and .* ms",
    ),
    "no time": (lambda f: f.rename(columns={"t": "time"}), "expected a column t"),
    "text": (lambda f: f.assign(t=f.t.astype(object).where(f.index != 4, "x")), "line 6: expected a finite number"),
}


@pytest.mark.parametrize("name", BAD)
def test_logs_that_are_refused_say_what_came(log, name, tmp_path):
    change, message = BAD[name]
    change(frame_of(log)).to_csv(tmp_path / "log.csv", index=False)
    with pytest.raises(IkgymError, match=message) as error:
        identify(read(tmp_path / "log.csv", ARM), ARM)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("when", ["before", "during", "after"])
@pytest.mark.parametrize("noise", [1e-3, 1e-2])
def test_measured_velocities_with_noise_are_no_commands(log, when, noise):
    short = log._replace(q=log.q[3000:6000], command=log.command[3000:6000])
    speed = np.diff(short.q, axis=0) / PERIOD
    columns = {"before": np.vstack([speed[:1], speed]), "after": np.vstack([speed, speed[-1:]])}
    columns["during"] = 0.5 * (columns["before"] + columns["after"])
    measured = columns[when] + noise * np.random.default_rng(0).normal(size=short.q.shape)
    with pytest.raises(InvalidInputError, match="or have noise that it lacks: these look like measured velocities"):
        identify(short._replace(command=measured), ARM)


def test_fast_drives_are_no_measured_velocities():
    """The motion follows within a period, and encoders have noise."""
    log = record(Plant(command_delay=0.4, bandwidth=300.0), 6.0)
    noise = 1e-5 * np.random.default_rng(0).normal(size=log.q.shape)
    found = identify(log._replace(q=log.q + noise), ARM)
    assert all(joint.moved for joint in found.joints)
    np.testing.assert_allclose([joint.lag.gain for joint in found.joints], 1.0, atol=2e-3)


@pytest.mark.parametrize("kind", ["sensor_msgs/msg/JointState", "std_msgs/msg/Float64MultiArray"])
def test_messages_of_ros_are_the_same_log(log, kind, tmp_path):
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store, short = get_typestore(Stores.ROS2_HUMBLE), log._replace(q=log.q[:2500], command=log.command[:2500])
    state, names = "sensor_msgs/msg/JointState", [*ARM.joint_names]
    header, stamp = store.types["std_msgs/msg/Header"], store.types["builtin_interfaces/msg/Time"]
    layout, none = store.types["std_msgs/msg/MultiArrayLayout"](dim=[], data_offset=0), np.empty(0)
    with Writer(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {"/joint_states": state, "/arm/command": kind}
        topics = [writer.add_connection(topic, one, typestore=store) for topic, one in topics.items()]
        for k, (q, command) in enumerate(zip(short.q, short.command, strict=True)):
            head = header(stamp=stamp(sec=0, nanosec=0), frame_id="")
            sent = {"layout": layout, "data": command}
            if kind == state:
                sent = {"header": head, "name": names[::-1], "position": none, "velocity": command[::-1].copy()}
                sent["effort"] = none
            seen = {"header": head, "name": names[::-1], "position": q[::-1].copy(), "velocity": none, "effort": none}
            for topic, late, one, fields in ((0, 0, state, seen), (1, 200_000, kind, sent)):
                raw = store.serialize_cdr(store.types[one](**fields), one)
                writer.write(topics[topic], round(1e9 * PERIOD * k) + late, raw)
    (file,) = (tmp_path / "bag").glob("*.mcap")
    found = read(file, ARM)
    np.testing.assert_allclose(found.period, PERIOD, rtol=1e-9)
    np.testing.assert_array_equal(found.q, short.q)
    np.testing.assert_array_equal(found.command, short.command)


@pytest.mark.parametrize("name", ["panda", "fr3", "iiwa14", "planar2", "varga7"])
def test_the_motion_is_within_its_share_clear_and_at_rest_at_both_ends(name):
    arm = ikgym.arms.get(name)
    if not np.isfinite(arm.velocity_limit).all():
        with pytest.raises(InvalidInputError, match="limits of velocity"):
            excite(arm, 10.0, 0.004)
        return
    q, command = excite(arm, 10.0, 0.004, 0.3)
    limit, change = 0.3 * arm.velocity_limit, 0.3 * arm.acceleration_limit * 0.004
    assert (np.abs(command) <= limit * (1.0 + 1e-9)).all()
    assert (np.abs(np.diff(command, axis=0, prepend=0.0)) <= change * (1.0 + 1e-9)).all()
    assert not command[[0, -1]].any()
    np.testing.assert_allclose(q[-1] + 0.004 * command[-1], arm.home, atol=1e-9)
    np.testing.assert_allclose(np.diff(q, axis=0), 0.004 * command[:-1], atol=1e-12)
    assert (q >= arm.lower).all()
    assert (q <= arm.upper).all()
    if len(arm.bodies):
        assert arm.clearance(q[::5])[0].min() > 0.0


@pytest.mark.parametrize("share", [0.2, 0.9])
def test_the_motion_that_excites_keeps_a_share_of_the_limits_of_jerk(share):
    """At 1 kHz they bind, and those of acceleration do not."""
    _, command = excite(ARM, 10.0, 0.001, share)
    jerk = np.abs(np.diff(np.pad(command, ((2, 2), (0, 0))), n=2, axis=0)).max(axis=0) / 0.001**2
    np.testing.assert_allclose(jerk, share * ARM.jerk_limit, rtol=1e-9)
    arm = ARM.replace(jerk_limit=None)
    assert (np.abs(excite(arm, 10.0, 0.001, share)[1]).max(axis=0) > np.abs(command).max(axis=0)).all()


def test_the_command_writes_a_plant_that_others_take(log, tmp_path, capsys, monkeypatch, own_registries):
    monkeypatch.setenv("COLUMNS", "120")  # so that no name is broken into two lines
    motion, record_file, plant = (str(tmp_path / name) for name in ("excite.csv", "log.csv", "plant.toml"))
    assert main(["identify", "--excite", "panda", "--seconds", "6", "--out", motion]) == 0
    assert read(motion, ARM).period == pytest.approx(PERIOD)
    frame_of(log).to_csv(record_file, index=False)
    plot = tmp_path / "fit.png"
    assert main(["identify", record_file, "--out", plant, "--plot", str(plot), "--test", record_file]) == 0
    said = capsys.readouterr().out
    assert "panda_joint7" in said
    assert "test [%]" in said
    assert plot.stat().st_size > 20_000
    found = IdentifiedPlant.load(plant)
    (tmp_path / "mine.toml").write_text('name = "mine"\nlike = "panda-circle"\ndt = 0.002\nplant = "plant.toml"\n')
    scenario = ikgym.scenarios.load(tmp_path / "mine.toml")
    assert scenario.plant == found.plant
    np.testing.assert_allclose(scenario.plant.bandwidth, LAGS.bandwidth, rtol=0.03)
    ikgym.scenarios.get("panda-circle").replace(plant=Plant(drive=SERVO)).save(tmp_path / "base.toml")
    ikgym.scenarios.register(ikgym.scenarios.load(tmp_path / "base.toml").replace(name="servo"))
    (tmp_path / "other.toml").write_text('name = "other"\nlike = "servo"\ndt = 0.002\nplant = "plant.toml"\n')
    assert ikgym.scenarios.load(tmp_path / "other.toml").plant == found.plant
    controller = baselines.Controller(scenario, drives=plant)
    np.testing.assert_allclose(controller.drives.time_constant, CONSTANTS, rtol=0.03)
    assert dataclasses.replace(found).plant_for(ARM, PERIOD) == found.plant
    for changes, message in (({"arm": ikgym.arms.get("fr3")}, "identified on 'panda'"), ({"dt": 0.001}, "at 2 ms")):
        other = ikgym.scenarios.get("panda-circle").replace(**({"dt": 0.002} | changes))
        with pytest.raises(InvalidInputError, match=message):
            found.plant_for(other.arm, other.dt)
        with pytest.raises(InvalidInputError, match=message):
            baselines.Controller(other, drives=plant)
    (tmp_path / "bad.toml").write_text('arm = "panda"\n')
    with pytest.raises(InvalidInputError, match=r"bad.toml: joints: expected a file that ikgym identify wrote"):
        IdentifiedPlant.load(tmp_path / "bad.toml")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "expected a log, or --excite"),
        (["--excite", "panda"], "--excite: expected --out FILE.csv"),
        (["--excite", "panda", "--out", "x.toml"], "--out: expected a file that ends in .csv"),
        (["log.csv", "--out", "x.csv"], "--out: expected a file that ends in .toml"),
        (["log.csv", "--seconds", "9"], "--seconds has no effect without --excite"),
        (["nothing.csv"], "Cannot read nothing.csv"),
    ],
)
def test_options_without_effect_are_refused(words, message, capsys):
    assert main(["identify", *words]) == 2
    assert message in capsys.readouterr().err
