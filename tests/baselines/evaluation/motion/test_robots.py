"""From the URDF of an arm to messages, by commands; a controller's spline is the motion."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from scipy.interpolate import CubicHermiteSpline

import ikgym
from baselines.cli import main

ROBOTS = Path(__file__).parents[3] / "robots"
CHAINS = {
    "ur10": ("base_link", "tool0"),
    "ur10_rail": ("world", "tool0"),
    "baxter": ("torso", "left_gripper"),
    "pr2": ("base_link", "r_gripper_tool_frame"),
}
SCENARIO = """
name = "{robot}"
task = "pose"
dt = 0.002

[arm]
urdf = "{folder}/{robot}.urdf"
base = "{base}"
tip = "{tip}"
acceleration_limit = {limits}

[trajectory]
kind = "csv"
file = "{folder}/{robot}.csv"
speed = 0.2
acceleration = 0.5
"""


def scenario_file(robot, folder, **more):
    base, tip = CHAINS[robot]
    joints = ikgym.arms.from_urdf(ROBOTS / f"{robot}.urdf", base=base, tip=tip).joints
    file = folder / f"{robot}.toml"
    text = SCENARIO.format(robot=robot, folder=ROBOTS.as_posix(), base=base, tip=tip, limits=[0.8] * joints)
    file.write_text("\n".join([*(f"{key} = {value}" for key, value in more.items()), text]), encoding="utf-8")
    return file


def arrays(file):
    """Joint names, times, positions and velocities of a message in JSON."""
    content = json.loads(file.read_text(encoding="utf-8"))
    times = [
        point["time_from_start"]["sec"] + 1e-9 * point["time_from_start"]["nanosec"] for point in content["points"]
    ]
    states = (np.array([point[key] for point in content["points"]]) for key in ("positions", "velocities"))
    return content["joint_names"], np.array(times), *states


def played(file):
    """Joint names, times, positions and largest acceleration of what was played."""
    with file.open(newline="", encoding="utf-8") as stream:
        head, *rows = csv.reader(stream)
    table, n = np.array(rows, dtype=float), len(head) // 2
    hardest = np.abs(np.diff(table[:, n + 1 :], axis=0)).max() / (table[1, 0] - table[0, 0])
    return [name.partition(" [")[0] for name in head[1 : n + 1]], table[:, 0], table[:, 1 : n + 1], hardest


@pytest.mark.parametrize("robot", ["ur10", *(pytest.param(name, marks=pytest.mark.slow) for name in [*CHAINS][1:])])
def test_from_urdf_to_messages(robot, tmp_path):
    file = scenario_file(robot, tmp_path)
    words = ["--scenarios", str(file), "--policies", "qp", "--out", str(tmp_path / "out"), "--no-report"]
    assert main(["evaluate", *words, "--export", "csv", "joint-trajectory", "mcap"]) == 0
    written = {one.suffix: one for one in (tmp_path / "out" / "export" / robot).iterdir()}
    names, times, q, qdot = arrays(written[".json"])
    arm = ikgym.scenarios.load(file).arm
    played_names, played_times, played_q, hardest = played(written[".csv"])
    assert names == played_names == list(arm.joint_names)
    assert (np.diff(times) > 0).all()
    np.testing.assert_array_equal(q[0], played_q[0])
    assert not qdot[[0, -1]].any()
    assert ((arm.lower <= q) & (q <= arm.upper)).all()

    spline = CubicHermiteSpline(times, q, qdot)
    fine = np.arange(0.0, played_times[-1], 1e-4)
    expected = np.column_stack([np.interp(fine, played_times, column) for column in played_q.T])
    np.testing.assert_allclose(spline(fine), expected, rtol=0, atol=1e-5)
    ends = np.abs(np.vstack([spline(times[:-1] + 1e-9, 2), spline(times[1:] - 1e-9, 2)]))
    assert ends.max() <= 1.1 * hardest
    assert ends[-1].max() <= 0.05 * hardest
    with Reader(written[".mcap"]) as reader:
        assert reader.message_count == 1
