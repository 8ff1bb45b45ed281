"""The first calls of a loop, and how long they take."""

from __future__ import annotations

import time
import warnings

import numpy as np
import pytest

from baselines import Controller, Drives, Guards
from baselines.solvers.quadratic_program.qp import QuadraticProgram
from ikgym.exceptions import InvalidInputError
from tests.baselines.controller.circles import circle


def commands(controller, scenario, steps=20):
    nominal, q, out = scenario.nominal(0, controller.ahead), np.array(scenario.start), []
    for k in range(steps):
        out.append(controller.step(q, None, nominal[k + 1 :][: controller.ahead]))
        q = q + scenario.dt * out[-1]
    return np.array(out)


@pytest.mark.filterwarnings("ignore:predicted does not keep")  # the machine may be busy
def test_a_warm_controller_is_like_a_fresh_one():
    scenario = circle("panda", 4e-3)
    warm = Controller(scenario)
    commands(warm, scenario, 7)
    timing = warm.warm_up(10)
    assert 0.0 < timing.p50 <= timing.p99
    assert warm.drives is None
    np.testing.assert_array_equal(commands(warm, scenario), commands(Controller(scenario), scenario))


def test_a_period_that_is_not_kept_is_warned_of(monkeypatch):
    scenario, fast = circle("panda", 4e-3), QuadraticProgram.act

    def slow(policy, batch, memory):
        time.sleep(6e-3)
        return fast(policy, batch, memory)

    monkeypatch.setattr(QuadraticProgram, "act", slow)
    with pytest.warns(RuntimeWarning, match="qp does not keep the control period of 4 ms: 99 % of its calls take"):
        assert Controller(scenario, drives=Drives()).warm_up(5).p50 > 6e-3
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        Controller(scenario.replace(dt=0.1), drives=Drives()).warm_up(5)


@pytest.mark.filterwarnings("ignore:.* does not keep the control period")  # the machine may be busy
def test_calls_that_fail_are_not_timed(monkeypatch):
    """Nor those of a stop: where the reference cannot be followed from its start there is nothing to time."""
    scenario = circle("panda", 4e-3)
    with pytest.raises(InvalidInputError, match=r"period 1: path_error\. The arm starts 0\.\d+ m and"):
        Controller("varga7-fast", drives=Drives()).warm_up(3)
    assert Controller("varga7-fast", drives=Drives(), guards=Guards(position_error=None)).warm_up(3).p50 > 0.0

    def failing(policy, batch, memory):
        raise np.linalg.LinAlgError("singular")

    monkeypatch.setattr(QuadraticProgram, "act", failing)
    with pytest.raises(InvalidInputError, match="qp is stopped in period 1: policy"):
        Controller(scenario, drives=Drives()).warm_up(3)
