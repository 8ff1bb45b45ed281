"""The table `rivals`: solvers of other projects beside ours on the paths of real arms, by default and tuned.

`rivals_paths.csv` has a line for each path and policy, and the table its sums. Settings are tuned with the same trials
on the same validation episodes, see `docs/rivals.toml`. A policy is timed with its checks and conversions.
"""

from __future__ import annotations

import itertools
import time
from typing import Any

import numpy as np
import tqdm

import baselines
import ikgym
from baselines.registry import parse_policy
from baselines.status import Status
from docs.keeping import Line, keep, lines

ARMS = ("panda", "iiwa14", "tiago")
PATHS = ("circle", "edge", "fast", "glue", "lemniscate", "line", "raster", "singular", "square", "turn")
#: A line of `rivals_paths.csv` counts as the smallest error within this factor, and within so many [mm].
FACTOR, DISTANCE = 1.05, 1e-3
HELD = ("stop", "velocity_limit", "acceleration_limit")


def line(path: str, policy: str) -> Line:
    """One path and policy."""
    scenario = ikgym.scenarios.get(path)
    name, parameters = parse_policy(policy)
    solver = baselines.make(name, scenario, **parameters)
    env: Any = ikgym.RedundantIKEnv(scenario, preview=solver.preview)
    (seen, _), state, errors, held, missing = env.reset(seed=0), None, [], np.zeros(3, dtype=np.int64), 0
    spent = np.empty(scenario.steps)
    for k in range(scenario.steps):
        begin = time.perf_counter()
        action, state = solver.predict(seen, state)
        spent[k] = time.perf_counter() - begin
        seen, *_, info = env.step(action)
        errors.append((info["position_error"], info["orientation_error"]))
        held += np.asarray(info["at_limit"]) > 0
        missing += int(solver.report(state).status[0] == Status.DIVERGED)
    position, orientation = 1e3 * np.max(errors, axis=0)
    return {
        **{"path": path, "policy": policy, "position_mm": float(position), "orientation_mrad": float(orientation)},
        **{f"steps_held_by_{name}": int(steps) for name, steps in zip(HELD, held, strict=True)},
        **{"steps_without_solution": missing, "time_p50_us": 1e6 * float(np.median(spent[1:]))},
    }


def sums(paths: list[Line]) -> list[Line]:
    """The table, from the lines of the paths; lines without a time are not timed."""
    best: dict[str, float] = {}
    for one in paths:
        best[one["path"]] = min(best.get(one["path"], np.inf), float(one["position_mm"]))
    out, pink = [], {one["path"]: float(one["time_p50_us"]) for one in paths if one["policy"] == "pink"}
    for policy in dict.fromkeys(one["policy"] for one in paths):
        some = [one for one in paths if one["policy"] == policy]
        near = [
            float(one["position_mm"]) <= max(FACTOR * best[one["path"]], best[one["path"]] + DISTANCE) for one in some
        ]
        free = [not any(int(one[f"steps_held_by_{name}"]) for name in HELD) for one in some]
        times = {one["path"]: float(one["time_p50_us"]) for one in some if one["time_p50_us"]}
        out.append(
            {
                **{"policy": policy, "paths": len(some), "smallest_position_error": sum(near)},
                **{"without_a_limit": sum(free)},
                **{"without_solution": sum(int(one["steps_without_solution"]) > 0 for one in some)},
                **{"time_p50_us": float(np.median(list(times.values()))) if times else None},
                **{"times_pink": float(np.median([times[path] / pink[path] for path in times])) if times else None},
            }
        )
    return out


def measured() -> list[Line]:
    """The table; the policies are those of its lines."""
    policies, names = [one["policy"] for one in lines("rivals")], itertools.product(ARMS, PATHS)
    cases = list(itertools.product([f"{arm}-{path}" for arm, path in names], policies))
    paths = [line(*case) for case in tqdm.tqdm(cases, desc="rivals")]
    keep("rivals_paths", paths)
    return sums(paths)
