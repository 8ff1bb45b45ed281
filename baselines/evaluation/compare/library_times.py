"""Times of the libraries of other projects alone, without the checks and conversions of their policies."""

from __future__ import annotations

import dataclasses
import time

import numpy as np

import ikgym
from baselines import registry
from baselines.evaluation.metrics import Row
from baselines.solvers.rivals.base import Rival
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Steps in which a library is timed.
STEPS = 500


def with_library_times(row: Row, scenario: Scenario) -> Row:
    """The row with the median and the 99th percentile of the library's calls; other rows as they are."""
    policy = registry.make(row.policy, scenario, **row.parameters)
    if not isinstance(policy, Rival):
        return row
    spent = 1e6 * library_times(policy, scenario, STEPS)
    return dataclasses.replace(
        row, **dict(zip(("time_p50_us", "time_p99_us"), np.percentile(spent, (50, 99)), strict=True))
    )


def library_times(policy: Rival, scenario: Scenario, steps: int) -> FloatArray:
    """Durations in [s] of the library's calls in the first steps of an episode. Shape (k,)."""
    env = ikgym.RedundantIKEnv(scenario, preview=1)
    (observation, _), call = env.reset(seed=0), policy.make_step()
    start, spent = observation["q"].copy(), np.empty(min(steps, scenario.steps))
    for k in range(len(spent)):
        q, qdot, pose, nominal = (observation[key] for key in ("q", "qdot", "pose", "nominal"))
        seen = policy.target(q, qdot, start, pose, nominal[0])
        begin = time.perf_counter()
        found = call(seen)
        spent[k] = time.perf_counter() - begin
        wanted = np.zeros(len(q)) if found is None else found / scenario.velocity_limit
        observation, *_ = env.step(np.clip(wanted, -1.0, 1.0).astype(np.float32))
    return spent
