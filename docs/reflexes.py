"""The table `reflexes`: the control loop on a mock arm that refuses commands, with limits of jerk and without.

Each run has its drives: a lag of 5 to 40 ms for each joint, and a delay of 0 to 3 periods. Messages are late by 10 % of
a period (standard deviation), one of 1,000 is lost, and encoders have a noise of 1e-5 rad. Drives are identified in the
run. Errors are those of the tool after the first second.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import math

import numpy as np

import ikgym
from baselines import Controller
from baselines.controller import MockArm
from baselines.paths.retiming import retime
from docs.keeping import WORK, Line, lines
from ikgym.plant import Plant
from ikgym.validation import FloatArray

NOISE, JITTER, LOST = 1e-5, 0.1, 1e-3
#: Errors count from then on, in [s].
FIRST = 1.0


@dataclasses.dataclass(frozen=True)
class Run:
    """The result of a run: how long it lasted in [s], what stopped it (empty if nothing did), and errors in [m]."""

    seconds: float
    stopped: str
    largest: float = math.nan
    rms: float = math.nan


def scenario_of(arm: str, path: str) -> ikgym.Scenario:
    """The motion of an arm at 1 kHz: a path of the Panda's, as it is in the catalogue, or as fast as the arm can."""
    name, _, retimed = path.partition(", ")
    scenario = ikgym.scenarios.get(f"panda-{name}").replace(arm=ikgym.arms.get(arm), name=path)
    return retime(scenario, fastest=True, reserve=0.15).scenario if retimed else scenario


def drive(scenario: ikgym.Scenario, seed: int, seconds: float, *, jerk: bool) -> Run:
    """One run of the control loop on the mock arm."""
    rng, n = np.random.default_rng(seed), scenario.joints
    lag, delay = rng.uniform(0.005, 0.04, n), int(rng.integers(4))
    plant = Plant(bandwidth=tuple(1.0 / (2.0 * np.pi * lag)), command_delay=delay, q_noise=NOISE)
    steps = round(seconds / scenario.dt)
    arm = MockArm(scenario.replace(plant=plant, steps=steps), real_time=False, jitter=JITTER, lost=LOST, seed=seed)
    controller = Controller(scenario.replace(jerk_limit=None if jerk else np.inf))
    reference = reference_of(scenario, steps + controller.ahead + 1)
    ahead, state, visited = controller.ahead, arm.read(), []
    for k in range(steps):
        report = {"commanded": state.commanded, "commanded_acceleration": state.commanded_acceleration}
        arm.write(controller.step(state.q, None, reference[k + 1 : k + 1 + ahead], **report))
        state = arm.read()
        visited.append(state.q)
        reason = state.reflex or controller.stopped
        if reason is not None:
            return Run(k * scenario.dt, reason.name.lower())
    first = round(FIRST / scenario.dt)
    positions = scenario.arm.forward(np.array(visited[first:]))[1]
    errors = np.linalg.norm(positions - reference[first + 1 : steps + 1, -3:], axis=1)
    return Run(seconds, "", float(errors.max()), float(np.sqrt(np.mean(errors**2))))


def reference_of(scenario: ikgym.Scenario, points: int) -> FloatArray:
    """The path, which ends where it begins, over and over; once, and then a rest, if it is retimed. Shape (points, m).

    A retimed path is as fast as the arm can from its start, and no faster than that from where the first round ends.
    """
    once = scenario.nominal(0)
    if "retimed" in scenario.name:
        once = np.concatenate([once, np.repeat(once[-1:], points, axis=0)])
    rows: FloatArray = np.tile(once, (-(-points // len(once)), 1))
    return rows[:points]


def measure() -> list[Line]:
    """The table, one line an arm, a path and whether jerk is limited, with as many runs as its lines say.

    Runs are made line by line in turn; those of a measurement that was killed are read from its file.
    """
    table, file = lines("reflexes"), WORK / "reflexes-runs" / "runs.jsonl"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    runs = {(line, seed): Run(**run) for line, seed, run in map(json.loads, file.read_text().splitlines())}
    scenarios = [scenario_of(one["arm"], one["path"]) for one in table]
    for seed, (line, one) in itertools.product(range(max(int(one["runs"]) for one in table)), enumerate(table)):
        if seed < int(one["runs"]) and (line, seed) not in runs:
            run = drive(scenarios[line], seed, float(one["seconds"]), jerk=one["jerk"] == "limited")
            with file.open("a") as out:
                out.write(json.dumps([line, seed, dataclasses.asdict(run)]) + "\n")
            runs[line, seed] = run
    return [_line(one, [runs[line, seed] for seed in range(int(one["runs"]))]) for line, one in enumerate(table)]


def _line(one: Line, runs: list[Run]) -> Line:
    reasons = sorted({run.stopped for run in runs if run.stopped})
    whole = [run for run in runs if not run.stopped]
    errors = {
        "error_rms_mm": 1e3 * float(np.sqrt(np.mean([run.rms**2 for run in whole]))) if whole else None,
        "error_max_mm": 1e3 * max(run.largest for run in whole) if whole else None,
    }
    return {**one, "stopped": len(runs) - len(whole), "by": " ".join(reasons), **errors}
