"""Counts of what a policy does in a step: kinematics, factorisations, measured poses.

Compiled kernels cannot be watched. With compilation switched off they are Python functions, and those that are costly
on a real arm are replaced by functions that count and then call the original. That takes a process of its own, in which
nothing was compiled.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import ikgym
from baselines.policy import SolverPolicy
from baselines.registry import get
from ikgym.exceptions import InvalidInputError
from ikgym.simulator import Observation

#: The functions that are counted; a decomposition counts as a factorisation.
COUNTED: Mapping[str, tuple[str, ...]] = {
    "forward_kinematics": ("ikgym.kinematics.forward",),
    "jacobians": ("ikgym.kinematics.forward_and_jacobian",),
    "factorisations": (
        "ikgym.linear_algebra.cholesky",
        "baselines.solvers.linear_algebra.ldl",
        "baselines.solvers.linear_algebra.orthogonal_columns",
        "baselines.solvers.resolved_rate.gram_schmidt.orthonormal_rows",
        "baselines.solvers.receding_horizon.lagrange.factorise",
    ),
}


@dataclasses.dataclass(frozen=True)
class Counts:
    """Operations of one step of a policy.

    Args:
        forward_kinematics: Evaluations of the model's forward kinematics alone.
        jacobians: Evaluations of its Jacobian, with the forward kinematics that come with it.
        factorisations: Matrices factorised, decomposed or inverted.
        measurements: 1 if the action depends on the measured pose, else 0.
    """

    forward_kinematics: int
    jacobians: int
    factorisations: int
    measurements: int


def count(scenario: str, policy: str, steps: int = 4, **parameters: Any) -> list[Counts]:
    """Operations of a policy in the first steps of an episode.

    Args:
        scenario: The name of a scenario.
        policy: The name of a policy.
        steps: How many steps; each takes about a thousand times as long as compiled.
        **parameters: The policy's.

    Raises:
        InvalidInputError: The policy or the scenario is refused, as the process reports.
    """
    given = json.dumps({"scenario": scenario, "policy": policy, "parameters": parameters, "steps": steps})
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", __name__]
    done = subprocess.run(command, input=given, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InvalidInputError(f"Counting {policy} on {scenario} failed: {done.stderr.strip().splitlines()[-1]}")
    return [Counts(*step) for step in json.loads(done.stdout)]


def _counters() -> dict[str, int]:
    """Replaces the counted functions in every module that holds them; the dictionary grows as they are called."""
    counts = dict.fromkeys(COUNTED, 0)
    for kind, functions in COUNTED.items():
        for function in functions:
            module, _, name = function.rpartition(".")
            original = getattr(importlib.import_module(module), name)
            counting = _counting(original, counts, kind)
            for other in list(sys.modules.values()):
                if getattr(other, name, None) is original:
                    setattr(other, name, counting)
    return counts


def _counting(function: Callable[..., Any], counts: dict[str, int], kind: str) -> Callable[..., Any]:
    def counting(*arguments: Any) -> Any:
        counts[kind] += 1
        return function(*arguments)

    return counting


def _steps(policy: SolverPolicy, scenario: ikgym.Scenario, counts: dict[str, int]) -> list[tuple[int, ...]]:
    env = ikgym.RedundantIKEnv(scenario, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    state, steps = None, []
    for _ in range(scenario.steps):
        counts.update(dict.fromkeys(counts, 0))
        action, after = policy.predict(observation, state)
        steps.append((*counts.values(), int(_measures(policy, observation, state))))
        state = after
        observation, *_ = env.step(action)
    return steps


def _measures(policy: SolverPolicy, observation: Observation, state: Any) -> bool:
    """Whether another measured pose changes the action or the state."""
    elsewhere = {**observation, "pose": 0.999 * observation["pose"]}
    ours, theirs = policy.predict(observation, state), policy.predict(elsewhere, state)
    return any((a != b).any() for a, b in zip((ours[0], *ours[1]), (theirs[0], *theirs[1]), strict=True))


def _main() -> None:
    given = json.load(sys.stdin)
    scenario = ikgym.scenarios.get(given["scenario"]).replace(steps=given["steps"])
    with np.errstate(all="ignore"):  # as compiled code does
        policy = get(given["policy"]).for_scenario(scenario, **given["parameters"])
        steps = _steps(policy, scenario, _counters())
    json.dump(steps, sys.stdout)


if __name__ == "__main__":
    _main()
