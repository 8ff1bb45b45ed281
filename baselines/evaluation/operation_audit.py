"""Counts what policies do, by running them without compilation: what their statements of operations are held against.

Compiled kernels cannot be watched. Switched off, they are Python functions, and those that cost something on a real arm
are replaced by ones that count before they go on. That takes a process of its own, in which nothing was compiled.
"""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

import ikgym
from baselines.policy import Operations, SolverPolicy
from baselines.registry import get, resolve
from ikgym.exceptions import InvalidInputError
from ikgym.simulator import Observation

#: The functions that are counted, by what they are; a decomposition counts as a factorisation.
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
class Audited:
    """What the steps of a policy took, one after the other.

    Args:
        counted: What was seen to happen, in the order of :class:`Operations`.
        stated: What the policy says.
    """

    counted: list[tuple[int, ...]]
    stated: list[tuple[int, ...]]

    @property
    def agrees(self) -> bool:
        """Whether the policy says in each step what was seen."""
        return self.counted == self.stated

    def total(self, name: str) -> int:
        """How often it was counted in all steps together.

        Args:
            name: One of the fields of :class:`Operations`.
        """
        return sum(step[Operations._fields.index(name)] for step in self.counted)


def audit(scenario: str, policies: Sequence[tuple[str, Mapping[str, Any]]], steps: int = 4) -> list[Audited]:
    """Counts the operations of policies in the first steps of an episode.

    Args:
        scenario: The name of a scenario.
        policies: Their names, or places such as "package.module:Class", and their parameters.
        steps: How many steps; each takes about a thousand times as long as compiled.

    Raises:
        InvalidInputError: A policy or the scenario is refused, as the process says.
    """
    given = json.dumps({"scenario": scenario, "policies": [(name, dict(p)) for name, p in policies], "steps": steps})
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", __name__]
    done = subprocess.run(command, input=given, env=environment, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InvalidInputError(f"The audit of {scenario} failed: {done.stderr.strip().splitlines()[-1]}")
    return [Audited(*[[tuple(step) for step in part] for part in parts]) for parts in json.loads(done.stdout)]


def _counters() -> dict[str, int]:
    """Replaces what is counted wherever a module has it by name; what comes back goes up as it is called."""
    counts = dict.fromkeys(COUNTED, 0)
    for kind, places in COUNTED.items():
        for place in places:
            module, _, name = place.rpartition(".")
            original = getattr(importlib.import_module(module), name)
            watched = _watched(original, counts, kind)
            for other in list(sys.modules.values()):
                if getattr(other, name, None) is original:
                    setattr(other, name, watched)
    return counts


def _watched(function: Callable[..., Any], counts: dict[str, int], kind: str) -> Callable[..., Any]:
    def counting(*arguments: Any) -> Any:
        counts[kind] += 1
        return function(*arguments)

    return counting


def _count(policy: SolverPolicy, scenario: ikgym.Scenario, counts: dict[str, int]) -> Audited:
    env = ikgym.RedundantIKEnv(scenario, preview=policy.preview)
    observation, _ = env.reset(seed=0)
    state, audited = None, Audited([], [])
    for _ in range(scenario.steps):
        counts.update(dict.fromkeys(counts, 0))
        action, after = policy.predict(observation, state)
        audited.counted.append((*counts.values(), int(_measures(policy, observation, state))))
        audited.stated.append(tuple(int(number[0]) for number in policy.operations(after)))
        state = after
        observation, *_ = env.step(action)
    return audited


def _measures(policy: SolverPolicy, observation: Observation, state: Any) -> bool:
    """Whether anything comes out differently where another pose has been measured."""
    elsewhere = {**observation, "pose": 0.999 * observation["pose"]}
    ours, theirs = policy.predict(observation, state), policy.predict(elsewhere, state)
    return any((a != b).any() for a, b in zip((ours[0], *ours[1]), (theirs[0], *theirs[1]), strict=True))


def _main() -> None:
    given = json.load(sys.stdin)
    scenario = ikgym.scenarios.get(given["scenario"]).replace(steps=given["steps"])
    with np.errstate(all="ignore"):  # as compiled code does
        kinds = [(resolve if ":" in name else get)(name) for name, _ in given["policies"]]
        named = zip(kinds, given["policies"], strict=True)
        policies = [kind.for_scenario(scenario, **parameters) for kind, (_, parameters) in named]
        counts = _counters()
        told = [_count(policy, scenario, counts) for policy in policies]
    json.dump([(audited.counted, audited.stated) for audited in told], sys.stdout)


if __name__ == "__main__":
    _main()
