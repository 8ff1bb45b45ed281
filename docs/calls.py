"""The table `calls`: times of one `predict`, and of one step of the control loop with the same measurements.

One thread, on the first steps of `panda-circle`; `rhc_foresight` on `varga7-pose-random`. *Library* is the call of
another project's library alone, which `predict` contains.
"""

from __future__ import annotations

import time
import warnings
from typing import Any

import numpy as np

import ikgym
from baselines import Controller, Drives
from baselines.evaluation.compare.playing import library_times
from baselines.solvers.rivals.base import Rival
from docs.keeping import Line

CIRCLE, PERFECT = "panda-circle", Drives()
#: Policy, scenario, drives of the control loop, and what it knows of them.
CASES: tuple[tuple[str, str, Drives | str, str], ...] = (
    *((policy, CIRCLE, PERFECT, "perfect") for policy in ("dls", "qp", "sns", "pink", "mink")),
    ("qp", CIRCLE, Drives(2, 0.02), "given"),
    ("qp", CIRCLE, "identify", "identified"),
    ("rhc_foresight", "varga7-pose-random", PERFECT, "perfect"),
)


def measure(steps: int = 1000, turns: int = 10) -> list[Line]:
    """The table: medians over some turns along an episode."""
    return [_line(*case, steps, turns) for case in CASES]


def _line(policy: str, name: str, drives: Drives | str, known: str, steps: int, turns: int) -> Line:
    scenario = ikgym.scenarios.get(name).replace(steps=steps)
    controller = Controller(scenario, policy, drives)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a period that one call did not keep
        controller.warm_up(1)
    predict, step = [], []
    for _ in range(turns):
        durations, seen = _steps(controller, scenario)
        step += durations
        predict += _predictions(controller.policy, seen)
    inner: Any = controller.policy
    alone = 1e6 * float(np.median(library_times(inner, scenario, steps))) if isinstance(inner, Rival) else None
    times = {
        "predict_us": 1e-3 * float(np.median(predict)),
        "library_us": alone,
        "step_us": 1e-3 * float(np.median(step)),
    }
    return {"policy": policy, "drives": known, **times}


def _steps(controller: Controller, scenario: ikgym.Scenario) -> tuple[list[int], list[Any]]:
    """Durations of steps on a perfect arm in [ns], and the observations of its policy."""
    controller.reset()
    ahead, durations, observations = controller.ahead, [], []
    nominal, q, qdot = scenario.nominal(0, ahead), np.array(scenario.start_of(0)), np.zeros(scenario.joints)
    for k in range(scenario.steps):
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
