"""The control loop: what a step costs beside the `predict` of its policy."""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np

import ikgym
from baselines import Controller, Drives
from benchmarks.measuring import FULL, Effort
from benchmarks.table import Table

#: The rows: policy, scenario and drives.
LOOPS: dict[str, tuple[str, str, Drives | str]] = {
    "`qp`, perfect drives": ("qp", "panda-circle", Drives()),
    "`qp`, drives given": ("qp", "panda-circle", Drives(2, 0.02)),
    "`qp`, drives identified": ("qp", "panda-circle", "identify"),
    "`rhc_foresight`, perfect drives": ("rhc_foresight", "varga7-pose-random", Drives()),
}
#: Turns of `effort.steps` calls of each.
TURNS = 10


def tables(effort: Effort = FULL) -> list[Table]:
    """Medians of `predict` and of :meth:`Controller.step`, and the 99th percentile of the latter."""
    rows: dict[str, tuple[float | None, ...]] = {}
    for name, loop in LOOPS.items():
        predict, step = measured(*loop, effort.steps, TURNS if effort is FULL else 1)
        rows[name] = np.median(predict), np.median(step), np.percentile(step, 99)
    note = f"One call, along {TURNS} times {effort.steps:,} steps of `panda-circle` or `varga7-pose-random`."
    return [Table("Control loop", note, ("`predict` [µs]", "`step` [µs]", "`step`, p99 [µs]"), rows)]


def measured(policy: str, scenario: str, drives: Drives | str, steps: int, turns: int) -> tuple[Any, Any]:
    """Durations of `predict`, and of steps on the same measurements, in [µs]; they take turns."""
    which = ikgym.scenarios.get(scenario)
    controller = Controller(which, policy, drives)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # one call says little of the period; the table says it all
        controller.warm_up(1)
    predict, step = [], []
    for _ in range(turns):
        durations, seen = _steps(controller, which, steps)
        step += durations
        predict += _predictions(controller.policy, seen)
    return 1e-3 * np.array(predict), 1e-3 * np.array(step)


def _steps(controller: Controller, scenario: ikgym.Scenario, steps: int) -> tuple[list[int], list[Any]]:
    """Durations of steps on a perfect arm in [ns], and what its policy saw."""
    controller.reset()
    ahead, durations, observations = controller.ahead, [], []
    nominal, q, qdot = scenario.nominal(0, ahead), np.array(scenario.start_of(0)), np.zeros(scenario.joints)
    for k in range(min(steps, scenario.steps)):
        here = slice(k + 1, k + 1 + ahead)
        pose = scenario.task.coordinates(*scenario.arm.forward(q))
        begin = time.perf_counter_ns()
        command = controller.step(q, pose, nominal[here])
        durations.append(time.perf_counter_ns() - begin)
        left = np.array([1e6])
        observations.append({"q": q, "qdot": qdot, "pose": pose, "nominal": nominal[here], "remaining": left})
        q, qdot = q + scenario.dt * command, command
    return durations, observations


def _predictions(policy: Any, observations: list[Any]) -> list[int]:
    durations, state = [], None
    for observation in observations:
        begin = time.perf_counter_ns()
        _, state = policy.predict(observation, state)
        durations.append(time.perf_counter_ns() - begin)
    return durations
