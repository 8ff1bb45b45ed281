"""The command ``ikgym path``."""

from __future__ import annotations

import dataclasses
import importlib
import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

import baselines
import ikgym
from baselines.cli import main
from baselines.cli.commands import path
from baselines.cli.parsing import EpisodeOptions
from baselines.controller import StopReason
from baselines.paths import retiming
from baselines.paths.late import Loop
from baselines.paths.starts import starts
from tests.baselines.evaluation.test_export import interpolated
from tests.robots import FOLDER, ROBOTS


@pytest.fixture(autouse=True)
def called_by_its_name(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "argv", ["ikgym"])
    monkeypatch.setenv("COLUMNS", "140")
    monkeypatch.chdir(tmp_path)
    Path("weld.csv").write_text("x, y, z\n0.45, -0.1, 0.4\n0.5, 0, 0.4\n0.45, 0.1, 0.4\n")


module = importlib.import_module("baselines.paths.survey")  # a function has that name
WELD = ("path", "weld.csv", "--arm", "panda", "--dt", "0.02")


def command(robot, *more):
    base, tip, *_ = ROBOTS[robot]
    arm = ["--arm", str(FOLDER / f"{robot}.urdf"), "--base", base, "--tip", tip]
    return ["path", str(FOLDER / f"{robot}.csv"), *arm, "--speed", "0.2", "--corner-radius", "0.03", *more]


@pytest.mark.parametrize("robot", ["ur10", *(pytest.param(name, marks=pytest.mark.slow) for name in [*ROBOTS][1:])])
def test_arms_that_are_not_in_the_catalogue(robot, capsys):
    limits = ("--acceleration", "5") if robot != "pr2" else ()
    assert main(command(robot, "--retime", "out.toml", *limits)) == 0
    text = capsys.readouterr().out
    assert "fastest 0.146 m/s, 0.2 m/s was asked, but its bends of 0.03 m allow no more with 1 m/s²" in text
    assert ("acceleration limits are not stated" in text) == (not limits)
    assert ("all limits hold" if limits else "velocities hold, accelerations come to") in text
    assert "It can be driven as it is: qp follows within 0.0" in text
    scenario = ikgym.scenarios.load("out.toml")
    assert any(name in text for name in scenario.arm.joint_names)
    tracking = baselines.track(scenario, "qp")
    assert tracking.position_error.max() < 5e-5
    assert tracking.orientation_error.max() < 5e-4
    np.testing.assert_allclose(tracking.nominal[-1], scenario.nominal()[-1])


@pytest.mark.slow
def test_accelerations_that_the_control_loop_does_not_allow_are_named(capsys):
    """Without stated limits, also where the motion is not retimed: its sibling has limits, and no such line."""
    assert main(["path", "iiwa14-fast", "--reserve", "0"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "velocities alone are checked" in text
    assert re.search(r"Controller allows \d+\.\d+ rad/s² at joint_a\d, and may lose the path", text)
    assert re.search(r"Controller stops after 0\.\d+ s \(PATH_ERROR\)", text)
    assert main(["path", "iiwa14-fast"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "those of Controller are kept" in text
    assert "Controller allows" not in text
    assert re.search(r"2 periods of delay, Controller follows within [\d.]+ mm", text)


def test_a_motion_near_its_limits_is_played_on_drives_that_lag(monkeypatch, capsys):
    """Also where it is driven as asked; the verdict says what stops it."""
    assert main([*WELD, "--bodies", "off", "--speed", "0.2"]) == 0
    assert "2 periods of delay" not in capsys.readouterr().out
    monkeypatch.setattr(path, "HARD", 0.0)
    assert main([*WELD, "--bodies", "off", "--speed", "0.2", "--retime", "weld.toml"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "It can be driven as it is" in text
    said = (
        r"a lag of 20 ms and 2 periods of delay, Controller follows within ([\d.]+) mm\. Slower drives were not tried\."
    )
    usual = float(re.search(said, text)[1])
    monkeypatch.setattr(path, "HARD", 1.0)
    weld = ikgym.scenarios.load("weld.toml")
    weld.replace(name="slow", plant=ikgym.Plant(bandwidth=4.0, command_delay=3)).save("slow.toml")
    assert main(["path", "slow.toml"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    slow = re.search(r"On the drives that the plant states, Controller follows within ([\d.]+) mm\.$", text)
    assert float(slow[1]) != usual
    monkeypatch.setattr(path, "HARD", 0.0)
    monkeypatch.setattr(path, "play_late", lambda *_: Loop(0.03, StopReason.PATH_ERROR, 0.28))
    assert main([*WELD, "--bodies", "off", "--speed", "0.2"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "Controller stops after 0.28 s (PATH_ERROR): begin with a slower motion, or keep more in reserve" in text


def test_a_path_that_is_too_fast_from_a_branch_of_ones_own_choice(capsys, monkeypatch):
    known, survey = [], path.survey
    monkeypatch.setattr(
        path,
        "survey",
        lambda scenario, **more: known[0] if known else known.append(survey(scenario, **more)) or known[0],
    )
    words = [*WELD, "--bodies", "off", "--speed", "3", "--tool-acceleration", "30", "--retime", "slow.toml", "--branch"]
    assert main([*words, "2"]) == 0
    text = capsys.readouterr().out
    assert "It cannot be driven in 0.358 s, but in " in text
    assert "with a lag of 20 ms and 2 periods of delay, Controller" in text
    assert "Controller allows" not in text
    assert "% panda_joint" in text
    scenario, lines = ikgym.scenarios.load("slow.toml"), text.splitlines()
    assert f"slow.toml: {scenario.steps} steps of 0.02 s" in text
    second = next(line for line in lines if line.startswith("2  all")).split()[-7:]
    np.testing.assert_allclose(scenario.start, np.array(second, dtype=np.float64), atol=0.0501)
    assert f"start = [{', '.join(f'{x:.4g}' for x in np.round(scenario.start, 4) + 0.0)}]" in lines
    assert main([*words, "99"]) == 2
    assert "--branch: expected" in capsys.readouterr().err


def test_a_path_out_of_reach(capsys):
    assert main(["path", "panda-edge", "--retime", "edge.toml"]) == 2
    out, err = capsys.readouterr()
    # The farthest point of the circle is 4 % of the reach out of reach.
    assert "It cannot be driven: no start reaches all of it. The farthest misses poses from 1.5 s on, at (0.7" in out
    assert re.search(r"and by up to 0\.0[2-5]\d* m", " ".join(out.split()))
    assert "--retime: the path cannot be driven, edge.toml is not written" in err
    assert not Path("edge.toml").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["path"], "FILE"),
        (["path", "nowhere.toml"], "nowhere.toml"),
        (["path", "panda-fast", "--speed", "0.1"], "--speed has no effect without a CSV file"),
        (["path", "panda-fast", "--retime", "out.csv"], "--retime: expected a file that ends in .toml"),
        (["path", "panda-random", "--retime", f"{'x' * 250}.toml"], "File name too long"),  # before it is followed
        (["path", "panda-random", "--retime", str(FOLDER / "ur10.csv" / "x.toml")], "Cannot write into"),
        (["path", "panda-random"], "the same at every reset"),
        (["path", str(FOLDER / "ur10.csv"), "--speed", "0.1"], "--arm: expected the name of an arm or FILE.urdf"),
        (["path", str(FOLDER / "ur10.csv"), "--arm", "panda"], "speed: expected a number, or times of the waypoints"),
        (["path", str(FOLDER / "ur10.csv"), "--arm", "panda", "--speed", "-1"], "--speed"),
        (command("ur10", "--acceleration", "1", "2"), "--acceleration"),
        (command("ur10", "--acceleration"), "--acceleration: expected a value, got none"),
        ([*WELD, "--speed", "0.2", "--tip", "nonsense"], "--tip has no effect without a URDF file"),
        ([*WELD, "--speed", "0.2", "--base", "nonsense"], "--base has no effect without a URDF file"),
        ([*WELD, "--speed", "0.2", "--tool", "0", "0", "1"], "--tool has no effect without a URDF file"),
        (
            [*WELD, "--speed", "0.2", "--tool-acceleration", "0"],
            "--tool-acceleration: expected a finite number above 0",
        ),
        ([*WELD[:-1], "10", "--speed", "0.2"], "dt: expected a control period of at most a tenth of the path's"),
        ([*WELD, "--speed", "0.2", "--reserve", "1"], "--reserve: expected"),
    ],
)
def test_bad_input(words, message, capsys):
    assert main(words) == 2
    assert message in capsys.readouterr().err


def test_obstacles_of_a_file(capsys):
    box = '[[obstacles]]\nkind = "box"\nname = "block"\nposition = [0.5, 0.0, 0.4]\nsize = [0.1, 0.1, 0.1]\n'
    Path("cell.toml").write_text(box)
    words = [*WELD, "--speed", "0.5", "--obstacles", "cell.toml"]
    assert main(words) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert re.search(r" clearance .* mm: link\w+, block", text)
    assert re.search(
        r"It cannot be driven: no start reaches all of it and keeps clear\..* 'link\w+' and 'block' are .* mm apart at"
        r" .* A search for joint motions along the whole path gets as far as [\d.]+ s\.",
        text,
    )
    assert main([*words, "--bodies", "off"]) == 0
    text = capsys.readouterr().out
    assert "clearance" not in text
    assert "It can be driven" in text
    Path("cell.toml").write_text(box.replace("size", "sizes"))
    assert main(words) == 2
    assert "cell.toml" in capsys.readouterr().err


@pytest.fixture
def worse_qp(monkeypatch):
    """A `qp` that errs by half a millimetre more, as near a singularity, and one start."""
    whole = module.play_from

    def worse(scenario, starts, solver="qp"):
        motion = whole(scenario, starts, solver)
        more = 5e-4 if solver == "qp" else 0.0
        return dataclasses.replace(motion, position_error=motion.position_error + more)

    monkeypatch.setattr(module, "play_from", worse)
    monkeypatch.setattr(module, "starts", lambda scenario: starts(scenario)[:1])


def test_another_solver_is_tried_before_a_singularity_is_blamed(worse_qp, monkeypatch, capsys):
    words = command("ur10", "--acceleration", "20", "--dt", "0.02", "--retime", "out.toml")
    assert main(words) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "sns follows within 0.0" in text
    assert "(where qp does not: a stop or a singularity is near)" in text
    assert "Play it with sns" in text
    scenario = ikgym.scenarios.load("out.toml")
    assert scenario.policy == "sns"
    assert EpisodeOptions().policies(scenario) == ("sns",)
    assert EpisodeOptions(policy=("dls",)).policies(scenario) == ("dls",)
    monkeypatch.setattr(retiming, "OTHERS", ())
    assert main(words) == 0
    assert "follow_nominal follows within" in " ".join(capsys.readouterr().out.split())
    monkeypatch.setattr(path, "plan", lambda found, fastest: None)
    assert main(words) == 0
    assert "(no closer, nor do sns and rhc_foresight: a stop or" in " ".join(capsys.readouterr().out.split())
    assert ikgym.scenarios.load("out.toml").policy is None


def test_a_motion_along_the_whole_path_where_no_start_branch_leads_to_its_end(capsys):
    """A tool between two boxes: `qp` is stopped by a joint limit or a box from every start."""
    assert main(["path", "cppflow-panda-flappy_bird", "--retime", "way.toml"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "It can be driven as it is: follow_nominal follows within" in text
    assert "(a joint motion planned along the whole path: no solver follows it from any start branch)" in text
    scenario = ikgym.scenarios.load("way.toml")
    tracking = baselines.track(scenario, scenario.policy)
    assert tracking.position_error.max() < 5e-5
    assert scenario.arm.clearance(tracking.q, scenario.obstacles)[0].min() > 0.0


def test_a_free_rotation_is_suggested_where_it_helps(capsys):
    """The tool has to turn by more than the last joint can, next to a base that it cannot go around."""
    turns = [(0.0, 1.0), (0.8, 0.6), (1.0, 0.0), (0.8, -0.6), (0.0, -1.0), (-0.8, -0.6), (-1.0, 0.0)]
    lines = [f"{0.4 + 0.02 * i}, 0.1, 0.4, 0, {c}, {s}, 0" for i, (s, c) in enumerate(turns)]
    Path("weld.csv").write_text("\n".join(["x, y, z, qw, qx, qy, qz", *lines]))
    assert main([*WELD, "--bodies", "off", "--speed", "0.1"]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "It cannot be driven: no start reaches all of it" in text
    assert re.search(
        r"It can, in [\d.]+ s, if the tool may turn about its z axis: --task axis, or task = \"axis\"", text
    )
    assert main([*WELD, "--bodies", "off", "--speed", "0.1", "--task", "axis"]) == 0
    assert "It can be driven as it is" in capsys.readouterr().out


@pytest.mark.parametrize("width", [80, 100])
def test_tables_fit_the_terminal(width, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(width))
    assert main(command("ur10", "--acceleration", "20")) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(len(line) for line in lines if not line.startswith("start = ")) <= width


ROOM = '[[obstacles]]\nkind = "box"\nname = "block"\nposition = [0.55, 0, 0.25]\nsize = [0.2, 0.2, 0.2]\n'
JOINTS = "".join(
    f'<link name="l{i}">{{}}</link><joint name="j{i}" type="revolute"><parent link="l{i - 1}"/><child link="l{i}"/>'
    f'<origin xyz="0 0 {z}"/><axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="2" effort="1"/></joint>'
    for i, (z, axis) in enumerate([(0.3, "0 0 1"), (0.0, "0 1 0"), (0.4, "0 1 0"), (0.3, "0 0 1")], 1)
)
BALL = '<collision><geometry><{} radius="0.04"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="package://parts/rod.stl"/></geometry></collision>'


def arm_file(*shapes):
    """A URDF file of an arm whose four links have these shapes."""
    Path("mine.urdf").write_text(f'<robot name="mine"><link name="l0"/>{JOINTS.format(*shapes)}</robot>')


def test_no_verdict_about_links_that_were_not_looked_at(capsys, tmp_path):
    """A file without shapes, or with meshes, was driven through the obstacle."""
    Path("room.toml").write_text(ROOM)
    words = ["path", "weld.csv", "--arm", "mine.urdf", "--speed", "0.1", "--dt", "0.02", "--obstacles", "room.toml"]
    arm_file("", "", "", "")
    assert main(words) == 2
    assert "got none on 'l1', 'l2', 'l3', 'l4'. 'l1': it has no shape." in capsys.readouterr().err
    arm_file(BALL.format("sphere"), MESH, MESH, MESH)
    assert main(words) == 2
    assert "got none on 'l2', 'l3', 'l4'. 'l2': its mesh 'package://parts/rod.stl' was not" in capsys.readouterr().err
    folder = tmp_path / "elsewhere" / "parts"
    folder.mkdir(parents=True)
    trimesh.creation.capsule(0.3, 0.05).export(folder / "rod.stl")
    assert main([*words, "--packages", "elsewhere"]) == 2
    assert "'l4' and 'block' overlap" in capsys.readouterr().err
    assert main(["arms", "mine.urdf", "--packages", "elsewhere"]) == 0
    said = re.sub(r"\s+", " ", capsys.readouterr().out)
    assert re.search(r"around meshes, in times the volume of the hull: l2 1\S*, l3 1\S*, l4 1", said)
    arm_file("", "", "", "")
    assert main([*words, "--bodyless", "l1", "l2", "l3", "l4"]) == 2
    assert "expected an arm with bodies" in capsys.readouterr().err


def test_an_arm_that_cannot_be_looked_at_is_said_not_to_be(capsys):
    arm_file(BALL.format("sphere"), "", "", "")
    assert main(["path", "weld.csv", "--arm", "mine.urdf", "--speed", "0.1", "--dt", "0.02"]) == 0
    said = re.sub(r"\s+", " ", capsys.readouterr().out)
    assert "bodies, which do not count here: 1 on the arm" in said
    assert "NOT LOOKED AT: 'l2': it has no shape; 'l3'" in said


def test_without_obstacles_no_package_for_meshes_is_needed(capsys, monkeypatch):
    arm_file(BALL.format("sphere"), MESH, MESH, MESH)
    monkeypatch.setitem(sys.modules, "trimesh", None)
    assert main(["path", "weld.csv", "--arm", "mine.urdf", "--speed", "0.1", "--dt", "0.02"]) == 0
    assert "NOT LOOKED AT: 'l2': its mesh" in re.sub(r"\s+", " ", capsys.readouterr().out)
    assert main(["arms", "mine.urdf"]) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "room.toml: obstacles: expected tables [[obstacles]], got no such key."),
        (ROOM.replace("obstacles", "obstacle"), "Did you mean 'obstacles'?"),
        ("obstacles = []\n", None),
    ],
)
def test_a_file_without_obstacles_is_no_free_space(text, message, capsys):
    Path("room.toml").write_text(text)
    assert main([*WELD, "--speed", "0.1", "--obstacles", "room.toml"]) == (0 if message is None else 2)
    assert message is None or message in capsys.readouterr().err


def shares(scenario, jerk):
    """The largest shares of the limits of velocity, acceleration and jerk in the motion of `qp`, from rest on."""
    qdot = baselines.track(scenario, "qp").qdot
    rest = np.zeros((1, qdot.shape[1]))
    changes = np.diff(qdot, axis=0, prepend=rest)
    steps, arm, dt = np.diff(changes, axis=0, prepend=rest), scenario.arm, scenario.dt
    return [
        float((np.abs(values) / limit).max())
        for values, limit in (
            (qdot, arm.velocity_limit),
            (changes, dt * arm.acceleration_limit),
            (steps, dt * dt * jerk),
        )
    ]


@pytest.mark.parametrize(
    ("name", "jerk"),
    [
        ("panda-line", ["2000"]),
        *(
            pytest.param(
                f"panda-{name}", ["7500", "3750", "5000", "6250", "7500", "10000", "10000"], marks=pytest.mark.slow
            )
            for name in ("circle", "square", "lemniscate", "line", "glue", "turn", "raster", "fast")
        ),
    ],
)
def test_a_stated_jerk_is_kept_by_the_retimed_path(name, jerk, capsys):
    """Between samples, too, at 10 kHz; at most 1.3 times as slow as without, at the Panda's limits."""
    seconds, used, limit = [], [], np.array(jerk, dtype=float)
    for limits in ([], ["--jerk", *jerk]):
        assert main(["path", name, "--fastest", "--retime", "out.toml", *limits]) == 0
        scenario = ikgym.scenarios.load("out.toml")
        seconds.append(scenario.trajectory.times[-1])
        used.append(shares(scenario, limit))
    assert capsys.readouterr().err == ""
    np.testing.assert_array_equal(scenario.jerk_limit, np.broadcast_to(limit, 7))
    assert used[0][2] > 1.1
    assert max(used[1]) <= 1.0 + 1e-4
    arm = scenario.arm
    baselines.track(scenario, "qp").to_joint_trajectory("out.json")
    points = json.loads(Path("out.json").read_text())["points"]
    limits = arm.velocity_limit, arm.acceleration_limit, limit
    for values, most in zip(interpolated(points, scenario.dt, accelerations=False), limits, strict=True):
        assert (np.abs(values) <= (1.0 + 1e-4) * most).all()
    q = np.array([point["positions"] for point in points])
    assert (arm.lower <= q).all()
    assert (q <= arm.upper).all()
    assert seconds[1] <= 1.3 * seconds[0]
