"""Steps that follow from a path, and steps that cut it off."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines.cli import main
from ikgym.trajectories import Sinusoid, through

PANDA = ikgym.arms.get("panda")
HOME = PANDA.forward(PANDA.home)[1]
POINTS = HOME + np.array([[0, 0, 0], [0, 0.1, 0], [0, 0.1, 0.1]])


def along(trajectory, **changes):
    given = {"dt": 0.004, **changes}
    return ikgym.Scenario("mine", PANDA, ikgym.tasks.get("position"), trajectory, start=PANDA.home, **given)


@pytest.mark.parametrize("path", [through(POINTS, times=[0, 1, 2.2]), through(POINTS, speed=0.1, acceleration=1.0)])
@pytest.mark.parametrize("held", [1, 3, (2, 5, 1)])
def test_a_path_needs_no_steps(path, held):
    scenario = along(path, iterations_per_point=held)
    last = 0.004 * scenario.points()[-1]
    assert path.duration + 0.25 <= last < path.duration + 0.25 + 0.009
    assert scenario.cut_off == 0
    assert along(path, iterations_per_point=held, steps=700).steps == 700


def test_what_has_no_end_has_1000_steps():
    scenario = along(Sinusoid(np.full(7, 0.1), 1.0, PANDA.home))
    assert (scenario.steps, scenario.cut_off) == (1000, 0)
    assert ikgym.scenarios.get("panda-random").cut_off == 0  # whose trajectory is drawn


def test_a_file_like_another_one_plays_its_own_path(tmp_path):
    (tmp_path / "points.csv").write_text("t,x,y,z\n0,0.5,0,0.4\n4,0.5,0.1,0.4\n", encoding="utf-8")
    text = 'name = "mine"\nlike = "panda-circle"\ntask = "position"\n[trajectory]\nkind = "csv"\nfile = "points.csv"\n'
    (tmp_path / "mine.toml").write_text(text, encoding="utf-8")
    scenario = ikgym.scenarios.load(tmp_path / "mine.toml")
    assert scenario.steps == 4250
    scenario.save(tmp_path / "again.toml")
    assert ikgym.scenarios.load(tmp_path / "again.toml").steps == 4250


def test_a_path_that_is_cut_off_is_warned_of(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scenario = along(through(POINTS, times=[0, 1, 2.2]), steps=500)
    assert scenario.cut_off == pytest.approx(0.2)
    scenario.save("mine.toml")
    assert main(["scenarios", "mine.toml"]) == 0
    assert "2.2 s, the episode 2 s: 0.2 s are cut off" in capsys.readouterr().out
    assert main(["evaluate", "--scenarios", "mine.toml", "--policies", "dls"]) == 0
    warned = "warning: mine: the last 0.2 s of the path are cut off, since 500 steps take 2 s"
    assert warned in capsys.readouterr().err
    assert main(["evaluate", "--scenarios", "mine.toml", "--policies", "dls", "--steps", "5"]) == 0  # as is wanted
    scenario.replace(steps=None).save("mine.toml")
    assert main(["evaluate", "--scenarios", "mine.toml", "--policies", "dls"]) == 0
    assert "warning" not in capsys.readouterr().err
