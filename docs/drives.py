"""The table `drives`: costs on an arm with masses, friction and servos, predicted by plants that a log identified.

``python -m docs.measure drives --bench FOLDER``. The folder is a test bench, which is no part of this project: its
module ``plant`` has ``Torque(servo, late=, payload=)`` with ``begin(q)``, ``move(command, dt, k)`` and ``state``, and
``use(plant)``, which puts such an arm below the commanded velocities of all episodes, or None for the scenario's plant.
The column `again` is the true cost in as many other episodes.
"""

from __future__ import annotations

import importlib
import itertools
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

import baselines
import ikgym
from baselines.episodes import rollouts
from baselines.evaluation.metrics import lacks_margin, lost
from baselines.identification.excitation import excite
from baselines.identification.log import Log
from baselines.identification.report import Identified, identify
from baselines.registry import parse_policy
from docs.keeping import RESULTS, Line

POLICIES = (
    *("qp", "qp:gain=0.3", "qp:gain=0.1", "sns", "sns:gain=0.3", "dls", "dls:gain=0.3", "dls:gain=0.1", "null_space"),
    *("null_space:gain=0.3", "moore_penrose:gain=0.3", "mfac", "rhc:iterations=1", "rhc_foresight"),
    *("predicted", "predicted:policy=qp,gain=0.3"),
)
SERVOS, LATE, PAYLOADS = ("velocity", "position", "stiff"), (0, 2), (0.0, 2.0)
SCENARIO, PERIOD, STEPS, SECONDS, EPISODES = "panda-random", 0.002, 600, 30.0, 8


def record(arm: ikgym.Arm, servo: Any) -> Log:
    """The log of one motion that excites an arm of the bench."""
    _, command = excite(arm, SECONDS, PERIOD)
    servo.begin(np.array(arm.home)[None])
    q = []
    for k, row in enumerate(command):
        q.append(servo.state[0][0].copy())
        servo.move(row[None], PERIOD, k)
    return Log(PERIOD, np.array(q), command)


def plants(found: Identified) -> dict[str, ikgym.Plant]:
    """The plants that predict: ideal, with one lag and delay for all joints, identified, and that at its margin."""
    lags = [joint.lag for joint in found.joints]
    delay, constant, gain = (
        float(np.median([getattr(one, key) for one in lags])) for key in ("delay", "time_constant", "gain")
    )
    bandwidth = 1.0 / (2.0 * math.pi * constant) if constant > 0.0 else math.inf
    lag = ikgym.Plant(command_delay=delay, bandwidth=bandwidth, gain=gain)
    identified = found.plant.plant
    return {"ideal": ikgym.Plant(), "lag": lag, "identified": identified, "later": identified.at_margin()}


def play(scenario: ikgym.Scenario, policy: str, first: int = 0) -> tuple[float, float]:
    """The mean stage cost of validation episodes from a first one on, and their largest position error in [mm]."""
    name, parameters = parse_policy(policy)
    seeds = ikgym.scenarios.seeds("validation", first + EPISODES)[first:]
    played = rollouts(scenario, baselines.make(name, scenario, **parameters), seeds)
    cost = np.mean([one.tracking_cost.mean() + one.velocity_cost.mean() for one in played])
    return float(cost), 1e3 * max(float(one.position_error.max()) for one in played)


def measure(bench: Path | None) -> list[Line]:
    """The table, measured on the test bench in a folder.

    Raises:
        SystemExit: No folder is given.
    """
    if bench is None:
        raise SystemExit("drives: this table needs --bench FOLDER, see docs/drives.py.")
    sys.path.insert(0, str(bench.resolve()))
    return _measure(importlib.import_module("plant"))


def _measure(bench: Any) -> list[Line]:
    usual = ikgym.scenarios.get(SCENARIO).replace(dt=PERIOD, steps=STEPS)
    table: list[Line] = []
    for kind, late, payload in itertools.product(SERVOS, LATE, PAYLOADS):
        servo = {"late": late, "payload": payload}
        known = plants(identify(record(usual.arm, bench.Torque(kind, **servo)), usual.arm))
        for policy in POLICIES:
            bench.use(None)
            seen = {name: play(usual.replace(plant=plant), policy) for name, plant in known.items()}
            bench.use(bench.Torque(kind, **servo))
            cost, error = play(usual, policy)
            again, _ = play(usual, policy, EPISODES)
            case: Line = {"servo": kind, "late": late, "payload_kg": payload, "policy": policy, "true_cost": cost}
            case["again"] = again
            predicted = {name: seen[name][0] for name in ("ideal", "lag", "identified")}
            errors = {"error_mm": error, "predicted_mm": seen["identified"][1], "later_mm": seen["later"][1]}
            warned = lacks_margin(1e-3 * errors["predicted_mm"], 1e-3 * errors["later_mm"])
            table.append(case | predicted | errors | {"warning": "yes" if warned else "no"})
            print(table[-1], file=sys.stderr, flush=True)
    bench.use(None)
    return table


def predictions() -> list[tuple[str, ...]]:
    """One line per arm of the table: how well costs are predicted of the policies that are not lost on it."""
    known = ("ideal", "lag", "identified")
    heads = (*(f"{name}, 20 %" for name in known), *(f"{name}, ρ" for name in known), "true, ρ")
    out = [("servo", "late", "payload [kg]", "policies", *heads)]
    table = pd.read_csv(RESULTS / "drives.csv")
    table = table[[not lost(1e-3 * error, None) for error in table["error_mm"]]]
    for arm, rows in table.groupby(["servo", "late", "payload_kg"], sort=False):
        near = [str(sum(abs(rows[name] / rows["true_cost"] - 1.0) <= 0.2)) for name in known]
        order = rows[["true_cost", *known, "again"]].corr(method="spearman")["true_cost"]
        servo, late, payload = arm  # type: ignore[misc]  # by three columns
        head = (str(servo), str(late), f"{payload:g}", str(len(rows)))
        out.append((*head, *near, *(f"{order[name]:.2f}" for name in (*known, "again"))))
    return out
