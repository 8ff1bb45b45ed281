"""What joints are called: kept in copies and files, no part of what an arm does."""

from __future__ import annotations

import pickle

import pytest

import ikgym
from baselines.fingerprints import fingerprint
from baselines.solvers.rivals.model_files import urdf
from ikgym.exceptions import InvalidInputError

ARM = ikgym.arms.get("planar2")
NAMES = ("hip", "knee")


def test_numbered_if_left_out():
    assert ARM.joint_names == ("joint_1", "joint_2")
    assert ARM.replace(joint_names=NAMES).replace(name="leg").joint_names == NAMES
    assert pickle.loads(pickle.dumps(ARM.replace(joint_names=list(NAMES)))).joint_names == NAMES


@pytest.mark.parametrize("names", ["ab", ("a",), ("a", "a"), ("a", ""), ("a", 1), {"a": 1, "b": 2}, None])
def test_bad_names(names):
    with pytest.raises(InvalidInputError, match="joint_names of arm 'planar2': expected 2 different texts, got"):
        ARM.replace(joint_names=names)


def test_from_a_urdf_file(tmp_path):
    file = tmp_path / "panda.urdf"
    file.write_text(urdf(ikgym.arms.get("panda")), encoding="utf-8")
    arm = ikgym.arms.from_urdf(file)
    assert arm.joint_names == tuple(f"joint{i}" for i in range(1, 8))


def test_in_files_of_scenarios_and_not_in_their_digests(tmp_path):
    scenario = ikgym.scenarios.get("planar2-bent")
    renamed = scenario.replace(arm=scenario.arm.replace(name="leg", joint_names=NAMES))
    renamed.save(tmp_path / "leg.toml")
    again = ikgym.scenarios.load(tmp_path / "leg.toml")
    assert again.arm.joint_names == NAMES
    assert fingerprint(again) == fingerprint(renamed)
    plain = scenario.replace(arm=scenario.arm.replace(name="leg"))
    assert fingerprint(plain) == fingerprint(renamed)
    plain.save(tmp_path / "plain.toml")
    assert "joint_names" not in (tmp_path / "plain.toml").read_text(encoding="utf-8")
    text = (tmp_path / "leg.toml").read_text(encoding="utf-8")
    (tmp_path / "bad.toml").write_text(text.replace('"knee"', '"hip"'), encoding="utf-8")
    with pytest.raises(InvalidInputError, match="expected 2 different texts"):
        ikgym.scenarios.load(tmp_path / "bad.toml")
