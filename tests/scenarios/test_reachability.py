"""Which poses of a path an arm cannot take."""

import numpy as np
import pytest

import ikgym
from ikgym.scenarios import gaps
from ikgym.trajectories import FixedOrientation, PathTrajectory, Quintic, paths

PANDA = ikgym.arms.get("panda")


def out_to(x, *, task="pose", steps=2000):
    """A path from in front of a Panda away from it, the tool downwards."""
    path = paths.Line(np.array([0.5, 0.0, 0.4]), np.array([x, 0.0, 0.4]))
    orientation = FixedOrientation(np.diag([1.0, -1.0, -1.0])) if task != "position" else None
    trajectory = PathTrajectory(path, Quintic(0.5, 2.0), orientation)
    return ikgym.Scenario("out", PANDA, ikgym.tasks.get(task), trajectory, steps=steps)


def test_nothing_is_missed_within_reach():
    assert gaps(out_to(0.6)) == ()
    assert gaps(ikgym.scenarios.get("panda-raster")) == ()
    assert gaps(ikgym.scenarios.get("panda-glue")) == ()


def test_how_far_when_and_where():
    scenario = out_to(1.0)
    missed = gaps(scenario, 50)
    worst = max(missed, key=lambda gap: gap.distance)
    assert worst.position == pytest.approx((1.0, 0.0, 0.4), abs=1e-3)
    assert [gap.time for gap in missed] == sorted(gap.time for gap in missed)
    assert missed[-1].time == pytest.approx(scenario.steps * scenario.dt)
    # Where the path leaves the reach, and no farther off than the last pose that was within it.
    first = missed[0]
    assert 0.7 < first.position[0] < 0.9
    assert 0.0 < first.distance < 0.05
    assert worst.distance <= 1.0 - first.position[0] + 0.05


def test_within_the_limits_of_the_joints():
    scenario = ikgym.scenarios.get("panda-line")
    start = scenario.start_of()
    narrow = PANDA.replace(name="narrow", lower=start - 0.01, upper=start + 0.01, home=start)
    assert len(gaps(scenario.replace(arm=narrow, model=narrow))) > 100


def test_a_free_orientation_is_not_looked_for():
    edge = 0.83  # farther out than with the tool downwards
    assert gaps(out_to(edge))
    assert not gaps(out_to(edge, task="position"))
    assert not gaps(out_to(edge, task="axis"))
    assert all(gap.angle == 0.0 for gap in gaps(out_to(1.2, task="position")))
