"""`ikgym arms` on URDF files: what is in them, and how to choose among several tips."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import ikgym
from baselines.cli import main
from baselines.solvers.rivals.model_files import urdf

ROBOTS = Path(__file__).parents[2] / "robots"
#: Chains of the robots, the number of links that can be the tip, and one that comes before all others of its length.
CHAINS = {
    "ur10": ("base_link", "tool0", 6, 2),
    "ur10_rail": ("world", "tool0", 7, 3),
    "baxter": ("torso", "left_gripper", 7, 27),
    "pr2": ("base_link", "r_gripper_tool_frame", 8, 25),
}


@pytest.fixture(autouse=True)
def _wide(monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")


def printed(capsys, *words):
    assert main(["arms", *map(str, words)]) == 0
    return capsys.readouterr().out


def test_remarks_on_a_file_appear_once(capsys, caplog, tmp_path):
    """Though the file is read again to open the mesh."""
    shape = "<collision><geometry>{}</geometry></collision>"
    shapes = shape.format('<sphere radius="0"/>') + shape.format('<mesh filename="arm.stl"/>')
    joint = '<joint name="turn" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 3"/></joint>'
    text = f'<robot name="small"><link name="base"/><link name="arm">{shapes}</link>{joint}</robot>'
    (tmp_path / "small.urdf").write_text(text, encoding="utf-8")
    for _ in range(2):
        caplog.clear()
        printed(capsys, tmp_path / "small.urdf")
        assert caplog.text.count("radius 0 is left out") == caplog.text.count("scaled to unit length") == 1


@pytest.mark.parametrize("robot", CHAINS)
def test_several_tips_are_shown_and_one_is_asked_for(robot, capsys):
    base, tip, joints, count = CHAINS[robot]
    text = printed(capsys, ROBOTS / f"{robot}.urdf", "--base", base)
    title, _, head, _, first, second, *_ = text.splitlines()
    assert f"{count} links can be the tip; choose one with --tip" in title
    assert head.split() == ["tip", "joints", "kinds", "from", "…", "to"]
    assert tip in {first.split()[0], second.split()[0]}
    assert first.split()[1] == str(joints)
    suggested = re.search(r"--tip (\S+)$", title)[1]
    assert suggested == first.split()[0]
    assert f"{robot}.urdf to {suggested}: {joints} joints" in text


@pytest.mark.parametrize("robot", CHAINS)
def test_a_chain_is_shown_with_names_and_limits(robot, capsys):
    base, tip, joints, _ = CHAINS[robot]
    file = ROBOTS / f"{robot}.urdf"
    text = printed(capsys, file, "--base", base, "--tip", tip, "--tool", 0, -0.1, 0.2, "--acceleration", 3)
    arm = ikgym.arms.from_urdf(file, base=base, tip=tip, tool=[0, -0.1, 0.2])
    assert arm.joints == joints
    for name, lower, limit in zip(arm.joint_names, arm.lower, arm.velocity_limit, strict=True):
        row = next(line for line in text.splitlines() if line.startswith(f"{name} "))
        assert (f" {lower:.4g} " in row) or (np.isinf(lower) and "none" in row)
        assert f" {limit:.4g} " in row
        assert re.search(r" 3 (m|rad)/s²$", row)
    table = tomllib.loads(text.partition("In a scenario file:\n")[2])["arm"]
    assert table == {
        "urdf": str(file),
        "base": base,
        "tip": tip,
        "tool": [0, -0.1, 0.2],
        "acceleration_limit": [3] * joints,
    }


def test_a_file_with_one_tip_needs_no_choice(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("mine.urdf").write_text(urdf(ikgym.arms.get("tiago")), encoding="utf-8")
    text = printed(capsys, "mine.urdf")
    assert text.startswith("mine.urdf: 8 joints, tool at ")
    assert re.search(r"^torso_lift_joint +prismatic +0 m +0\.35 m +0\.07 m/s +none$", text, re.MULTILINE)
    assert "(add acceleration_limit, which no URDF states)" in text
    assert main(["arms", "mine.urdf", "--acceleration", "1", "2"]) == 2
    assert "--acceleration: expected shape (8,), got (2,)" in capsys.readouterr().err


def test_links_that_cannot_be_the_tip_stand_last_with_the_reason(tmp_path, capsys):
    content = (ROBOTS / "baxter.urdf").read_text(encoding="utf-8")
    (tmp_path / "whole.urdf").write_text(content, encoding="utf-8")
    tips = ikgym.arms.tips(tmp_path / "whole.urdf", base="left_gripper_base_link")
    assert [tip.link for tip in tips] == ["l_gripper_l_finger_tip", "l_gripper_r_finger_tip"]
    assert [bool(tip.fault) for tip in tips] == [False, True]
    text = printed(capsys, tmp_path / "whole.urdf", "--base", "left_gripper_base_link")
    assert re.search(r"^l_gripper_r_finger_tip .*cannot be read: joint 'l_gripper_r_finger_joint'", text, re.MULTILINE)
    (tmp_path / "none.urdf").write_text(re.sub(r'velocity="[^"]*"', 'velocity="0"', content), encoding="utf-8")
    text = printed(capsys, tmp_path / "none.urdf")
    assert text.startswith(f"{tmp_path / 'none.urdf'}: no link can be the tip\n")
    assert "expected a velocity limit above 0, got 0; write that of the data sheet" in " ".join(text.split())
