"""Obstacles that move or are drawn, as a camera hands them to the loop."""

from __future__ import annotations

import numpy as np
import pytest

import ikgym
from baselines import Controller, Drives
from ikgym.exceptions import InvalidInputError
from ikgym.obstacles import Capsule


def person(y):
    return Capsule("person", [0.1, y, 0.0], [0.1, y, 1.6], 0.2)


@pytest.mark.parametrize("drives", ["identify", Drives()])
def test_a_person_who_moves(drives):
    """As objects or as rows; far away the person does not matter, close by they do."""
    scenario = ikgym.scenarios.get("panda-person")
    controller = Controller(scenario, drives=drives)
    reference, q, made = scenario.nominal(0, controller.ahead), scenario.start_of(), {}
    for name, shown in {
        "far": [person(5.0)],
        "rows": person(5.0).numbers()[None],
        "near": [person(0.45)],
    }.items():
        controller.reset()
        made[name] = [controller.step(q, None, reference[1 : 1 + controller.ahead], obstacles=shown) for _ in range(3)]
        assert controller.stopped is None
    np.testing.assert_array_equal(made["far"], made["rows"])
    assert (np.array(made["far"]) != made["near"]).any()


@pytest.mark.parametrize("name", ["panda-person", "panda-clutter-random"])
def test_warm_up_shows_the_obstacles_of_the_scenario(name):
    controller = Controller(name, drives=Drives())
    assert controller.warm_up(3).p50 > 0.0


@pytest.mark.parametrize(
    ("shown", "message"),
    [
        (None, "obstacles: expected 1, since those of the scenario move or are drawn, got None"),
        ([], r"obstacles: expected shape \(1, 16\), got \(0, 16\)"),
        ([person(1.0)] * 2, r"obstacles: expected shape \(1, 16\), got \(2, 16\)"),
        (["person"], "obstacles: expected an array of real numbers"),
    ],
)
def test_obstacles_that_are_missing_or_none(shown, message):
    scenario = ikgym.scenarios.get("panda-person")
    controller = Controller(scenario, drives=Drives())
    with pytest.raises(InvalidInputError, match=message):
        controller.step(scenario.start_of(), None, scenario.nominal()[1:2], obstacles=shown)


def test_obstacles_that_are_not_finite_stop_the_arm():
    scenario = ikgym.scenarios.get("panda-person")
    controller = Controller(scenario, drives=Drives())
    controller.step(scenario.start_of(), None, scenario.nominal()[1:2], obstacles=np.full((1, 16), np.nan))
    assert controller.stopped.label == "not_finite"
