"""Joint motions as files: what is written is what was played, and what ROS 2 takes for a message."""

from __future__ import annotations

import csv
import dataclasses
import json
import re

import numpy as np
import pytest
from numpy import polynomial
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore

import baselines
import ikgym
from baselines.evaluate import evaluate
from baselines.evaluation import run as command
from baselines.evaluation.export import FORMATS
from ikgym.exceptions import MissingDependencyError
from tests.baselines.making import circle

STEPS = 12


def named(**changes):
    """A path of an arm whose joints have names."""
    scenario = ikgym.scenarios.get("zhang6-lspb")
    names = [f"slider_{i}" for i in range(6)]
    return scenario.replace(arm=scenario.arm.replace(joint_names=names), steps=STEPS, **changes)


def files(folder):
    return sorted(file.relative_to(folder / "export").as_posix() for file in (folder / "export").rglob("*.*"))


def read_csv(file):
    with file.open(newline="", encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    return head, np.array(rows, dtype=float)


def test_csv_holds_the_episode_from_its_start_to_the_last_digit(tmp_path):
    scenario = named()
    evaluate(scenario, "dls", out=tmp_path, export="csv", accelerations=True)
    (file,) = (tmp_path / "export" / "zhang6-lspb").iterdir()
    head, table = read_csv(file)
    names = [f"slider_{i}" for i in range(6)]
    assert head == ["time [s]", *(f"{name} [rad{per}]" for per in ("", "/s", "/s²") for name in names)]
    track = baselines.track(scenario, "dls")
    assert table.shape == (STEPS + 1, 19)
    np.testing.assert_array_equal(table[:, 0], scenario.dt * np.arange(STEPS + 1))
    np.testing.assert_array_equal(table[0, 1:], [*scenario.start, *np.zeros(12)])
    np.testing.assert_array_equal(table[1:, 1:7], track.q)
    np.testing.assert_array_equal(table[1:, 7:13], track.qdot)
    np.testing.assert_allclose(table[1:, 13:], np.diff(table[:, 7:13], axis=0) / scenario.dt, rtol=1e-12)


def test_joint_trajectory_starts_and_ends_at_rest_on_time(tmp_path):
    scenario = named(dt=0.3)
    evaluate(scenario, "dls", out=tmp_path, export="joint-trajectory")
    (name,) = files(tmp_path)
    text = (tmp_path / "export" / name).read_text(encoding="utf-8")
    content = json.loads(text)
    assert content["joint_names"] == [f"slider_{i}" for i in range(6)]
    points, track = content["points"], baselines.track(scenario, "dls")
    assert len(points) > STEPS + 1  # the episode ends in motion
    np.testing.assert_array_equal(points[0]["positions"], scenario.start)
    assert points[0]["velocities"] == points[-1]["velocities"] == [0.0] * 6
    assert [point["accelerations"] for point in points] == [[]] * len(points)
    times = [point["time_from_start"] for point in points]
    assert times[0] == {"sec": 0, "nanosec": 0}
    assert times[4] == {"sec": 1, "nanosec": 200_000_000}
    seconds = [time["sec"] + 1e-9 * time["nanosec"] for time in times]
    np.testing.assert_allclose(seconds, 0.3 * np.arange(len(points)), atol=1e-9)
    track.to_joint_trajectory(tmp_path / "again.json")
    assert (tmp_path / "again.json").read_text(encoding="utf-8") == text


def interpolated(points, dt, accelerations, samples=10):
    """Velocities, accelerations and jerks of cubic or quintic polynomials between points, as controllers make them."""
    data = [np.array([point[key] for point in points]) for key in ("positions", "velocities", "accelerations")]
    data = data[: 3 if accelerations else 2]
    k, out = len(data), []
    powers = [polynomial.Polynomial.basis(i) for i in range(2 * k)]
    system = [[p.deriv(i)(t) if i else p(t) for p in powers] for t in (0.0, dt) for i in range(k)]
    values = np.concatenate([np.stack([each[:-1] for each in data]), np.stack([each[1:] for each in data])])
    coefficients = np.linalg.solve(system, values.reshape(2 * k, -1))
    times = dt * np.linspace(0.0, 1.0, samples + 1)  # both ends of each piece
    for i in (1, 2, 3):
        basis = np.array([p.deriv(i)(times) for p in powers])
        found = (basis.T @ coefficients).reshape(len(times), *values.shape[1:])
        out.append(found.transpose(1, 0, 2))
    return out


@pytest.mark.parametrize("accelerations", [False, True])
def test_exports_keep_the_limits_of_jerk_between_samples(accelerations, tmp_path):
    """At 10 kHz, from rest to rest, with continuous accelerations; without limits of jerk they jump."""
    scenario = ikgym.scenarios.get("panda-line")
    law = dataclasses.replace(scenario.trajectory.time_law, speed=0.8, acceleration=6.0)
    scenario, jumps = scenario.replace(trajectory=scenario.trajectory.replace(time_law=law), steps=None), []
    arm = scenario.arm
    for limit in (None, np.inf):
        track = baselines.track(scenario.replace(jerk_limit=limit), "qp")
        track.to_joint_trajectory(tmp_path / "motion.json", accelerations=accelerations)
        points = json.loads((tmp_path / "motion.json").read_text(encoding="utf-8"))["points"]
        velocity, acceleration, jerk = interpolated(points, scenario.dt, accelerations)
        before = np.concatenate([np.zeros((1, 7)), acceleration[:, -1]])
        jumps.append(np.abs(np.concatenate([acceleration[:, 0], np.zeros((1, 7))]) - before).max())
        if limit is None:
            assert np.abs(velocity[[0, -1], [0, -1]]).max() < 1e-9
            for values, most in (
                (velocity, arm.velocity_limit),
                (acceleration, arm.acceleration_limit),
                (jerk, arm.jerk_limit),
            ):
                share = (np.abs(values) / most).max()
                assert share <= 1.0 + 1e-4
            assert share > 0.5
    assert jumps[0] < 1e-3
    assert jumps[1] > 1.0


def test_mcap_is_read_without_ros_and_holds_the_same_message(tmp_path, monkeypatch):
    track = baselines.track(named(), "dls")
    track.to_joint_trajectory(tmp_path / "motion.json", accelerations=True)
    track.to_mcap(tmp_path / "motion.mcap", accelerations=True)
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(tmp_path / "motion.mcap") as reader:
        ((connection, _, data),) = reader.messages()
        read = store.deserialize_cdr(data, connection.msgtype)
    written = json.loads((tmp_path / "motion.json").read_text(encoding="utf-8"))
    assert {len(point["accelerations"]) for point in written["points"]} == {6}
    assert written["points"][-1]["accelerations"] == [0.0] * 6
    assert connection.topic == "/joint_trajectory_controller/joint_trajectory"
    assert connection.msgtype == "trajectory_msgs/msg/JointTrajectory"
    assert list(written) == ["header", "joint_names", "points"]  # no others, which `ros2 topic pub` would refuse
    assert read.joint_names == written["joint_names"]
    assert len(read.points) == len(written["points"])
    for point, other in zip(read.points, written["points"], strict=True):
        assert len(other) == 5
        for key in ("positions", "velocities", "accelerations", "effort"):
            np.testing.assert_array_equal(getattr(point, key), other[key])
        assert {"sec": point.time_from_start.sec, "nanosec": point.time_from_start.nanosec} == other["time_from_start"]
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match=r"needs rosbags: pip install \"ikgym\[paths\]\""):
        evaluate(named(), "dls", out=tmp_path / "out", export="mcap")


class Rushing:
    """Drives the first joint as fast as it goes."""

    preview = 1

    def predict(self, observation, state=None, episode_start=None, deterministic=False):
        return np.eye(7, dtype=np.float32)[0], None


def test_a_motion_without_room_to_stop_is_named_and_the_others_are_written(tmp_path):
    scenario = circle(dt=2e-3).replace(steps=20)
    close = scenario.start + np.eye(7)[0] * (scenario.arm.upper[0] - 0.02 - scenario.start[0])
    rows = evaluate([scenario, scenario.replace(name="close", start=close)], Rushing(), out=tmp_path, export="mcap")
    (skipped,) = rows.skipped
    assert (len(rows), skipped.scenario, skipped.policy) == (2, "close", "Rushing")
    assert "no .mcap of seed 0: expected a run that ends at rest" in skipped.reason
    assert "joint 'panda_joint1' moves at 0.6 rad/s at the end" in skipped.reason
    assert [name.partition("/")[0] for name in files(tmp_path)] == ["circle-pose"]


def test_every_episode_in_every_format(tmp_path):
    rows = evaluate(
        "varga7-random", ["dls", "dls:damping=1e-2"], episodes=2, steps=STEPS, out=tmp_path, export=list(FORMATS),
    )  # fmt: skip
    found = files(tmp_path)
    assert len(found) == len(rows) * len(FORMATS) == 12
    pattern = re.compile(r"varga7-random/dls-[0-9a-f]{8}-seed-200000[01]\.(csv|json|mcap)")
    assert all(map(pattern.fullmatch, found))
    scenario = ikgym.scenarios.get("varga7-random")
    for seed in (2_000_000, 2_000_001):
        file = next((tmp_path / "export").glob(f"*/*seed-{seed}.csv"))
        np.testing.assert_array_equal(read_csv(file)[1][0, 1:8], scenario.nominal_joint_path(seed)[0])


def test_resuming_plays_what_is_not_exported_yet_and_overwriting_removes_it(tmp_path, monkeypatch):
    given = {"steps": 3, "out": tmp_path}
    evaluate("varga7-fast", "dls", **given, export="csv")
    play, played = command.play, []
    monkeypatch.setattr(command, "play", lambda batch, tick: played.append(batch) or play(batch, tick))
    evaluate("varga7-fast", "dls", **given, export="csv", resume=True)
    assert played == []
    evaluate("varga7-fast", "dls", **given, export=["csv", "joint-trajectory"], resume=True)
    assert len(played) == 1
    evaluate("varga7-fast", "dls", **given, overwrite=True)
    assert files(tmp_path) == []
