"""The table `drift`: how far the posture moves in circles that are driven one after the other."""

from __future__ import annotations

import numpy as np

import baselines
from baselines.episodes import rollout
from docs.keeping import Line, lines
from ikgym import scenarios

#: Circles in a row, each of which begins where the last one ended.
CIRCLES = 5


def measure() -> list[Line]:
    """The table, one line a scenario and policy, as its lines say."""
    return [_line(one["scenario"], one["policy"]) for one in lines("drift")]


def _line(name: str, policy: str) -> Line:
    scenario = scenarios.get(name)
    q, drifts, error = scenario.start_of(0), [], 0.0
    for _ in range(CIRCLES):
        here = scenario.replace(start=np.clip(q, scenario.arm.lower, scenario.arm.upper))
        episode = rollout(here, baselines.make(policy, here), 0, timed=False)
        drifts.append(float(np.abs(episode.q[-1] - q).max()))
        q, error = episode.q[-1], 1e3 * float(episode.position_error.max())
    drift = {f"circle_{i}_rad": one for i, one in enumerate(drifts, 1)}
    return {"scenario": name, "policy": policy, **drift, "last_error_mm": error}
