"""Paths among obstacles: starts that are clear, and what is said where none leads along."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import baselines
from baselines.paths import retime, survey
from baselines.paths.motion import ideal, path_duration, play_from
from baselines.paths.starts import starts
from baselines.paths.survey import branch_of, follows
from baselines.paths.timing import Timing
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles import Box
from ikgym.obstacles.solids import closest
from tests.bodied import AROUND, POST, blocked, crowd


def quick(obstacles):
    """The whole path among obstacles, in few steps."""
    return crowd(None, obstacles).replace(dt=4e-3)


def distances(scenario, q):
    return closest(scenario.arm, q, scenario.obstacle_rows(1), scenario.surroundings.checked).distances


def test_starts_are_clear_and_the_clearance_is_that_of_the_motion():
    free = quick(AROUND)
    every = starts(ideal(free))
    elbow = free.arm.joint_points(every[0])[3, 1]
    scenario = free.replace(obstacles=[*free.obstacles, Box("beam", elbow, [0.1, 0.1, 0.1])])
    assert (distances(scenario, every) <= 0.0).any()
    found = starts(ideal(scenario))
    assert len(found) > 1
    assert (distances(scenario, found) > 0.0).all()
    surveyed = survey(scenario)
    best, driven = surveyed.best, retime(surveyed).scenario
    assert best.whole
    assert best.contact.clearance > 0.0
    assert not best.contact.touched
    assert driven.obstacles == scenario.obstacles
    np.testing.assert_array_equal(driven.start, best.start)
    tracking = baselines.track(driven, "qp")
    assert tracking.position_error.max() < 1e-3
    rows = scenario.obstacle_rows(len(tracking.q) + 1)[1:]
    met = closest(scenario.arm, tracking.q, rows, scenario.surroundings.checked)
    assert best.contact.clearance == pytest.approx(met.distances.min(), abs=1e-4)
    then = met.distances[round(best.contact.time / scenario.dt) - 1]
    assert then == pytest.approx(best.contact.clearance, abs=1e-4)


def test_a_path_that_no_start_leads_along_clear():
    scenario = quick((AROUND[0], POST.replace(position=[0.52, 0.13, 0.3], size=[0.1, 0.1, 0.5])))
    found = survey(scenario)
    assert not found.best.whole
    assert not found.drivable
    body, other = found.best.contact.pair
    assert other == "post"
    assert found.best.contact.clearance < 0.01
    message = (
        f"no start reaches all of it and keeps clear. .*; '{body}' and 'post' .* at {found.best.contact.time:.3g} s"
    )
    with pytest.raises(InvalidInputError, match=message):
        retime(found)


def test_a_start_from_which_bodies_touch():
    """The path of another solver: `qp` keeps clear."""
    scenario = blocked(None)
    motion = play_from(ideal(scenario), scenario.start_of()[None])
    stopped = dataclasses.replace(motion, stopped=np.where(np.arange(len(motion.stopped)) >= 900, 1.0, 0.0)[:, None])
    contact = branch_of(scenario, stopped, Timing.uniform(path_duration(scenario), 1.0)).contact
    assert contact.touched
    assert contact.time == pytest.approx(901 * scenario.dt)
    assert contact.clearance == motion.clearance[:901].min()
    assert not follows(stopped, (1.0, 1.0))


def test_a_first_pose_that_is_not_clear():
    position = crowd().frames(crowd().trajectory, 1)[0, 9:]
    scenario = crowd(None, (Box("block", position, [0.1, 0.1, 0.1]),))
    with pytest.raises(InvalidInputError, match=r"touches nothing, got none among \d+; .* and 'block' overlap by"):
        survey(scenario)
