"""The score of an agent on episodes of the validation split, which are used neither for training nor for publication.

``python -m baselines.training.validation`` computes the reference costs anew, in some minutes.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines import registry
from baselines.agents.files import AgentFile
from baselines.agents.policy import Agent
from baselines.episodes import rollouts
from baselines.evaluation.metrics import lost
from baselines.files import write
from baselines.fingerprints import fingerprint
from baselines.policy import Problem
from baselines.policy.protocol import Policy
from baselines.recording import add_up
from baselines.spec import parse_policy
from baselines.statistics import geometric_mean
from ikgym import scenarios, tasks
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: The file of the reference costs, the reference policy, and the scenario, tasks and number of episodes.
FILE = pathlib.Path(__file__).with_name("validation_reference.json")
#: All initial guesses are tried in the first call: not in real time, but at a lower cost.
POLICY = "rhc_foresight:horizon=1501,move_blocks=48,starts=64,start_steps=0,recovery_steps=0"
SCENARIO, TASKS, EPISODES = "varga7-random", ("skew", "pose"), 64
#: Digits of a cost in the file.
DIGITS = 7


@dataclasses.dataclass(frozen=True)
class Score:
    """The score of an agent on the validation split.

    Args:
        episodes: Number of episodes.
        cost: Geometric mean of their costs.
        cost_ratio: Geometric mean of their costs over those of the reference; None where there is no reference.
        worst: Largest of these ratios; of the costs where there is no reference.
        lost: Share of the episodes in which the arm lost track, see :func:`baselines.evaluation.metrics.lost`.
        position_error_max_mm: Mean over the episodes of their largest position error, in [mm].
        orientation_error_max_mrad: The same of the orientation, in [mrad]; None where the task has none.
    """

    episodes: int
    cost: float
    cost_ratio: float | None
    worst: float
    lost: float
    position_error_max_mm: float
    orientation_error_max_mrad: float | None = None


def validation_seeds(scenario: Scenario, episodes: int) -> tuple[int, ...]:
    """The first seeds of the validation split; one where the scenario is deterministic."""
    random = scenario.random or scenario.plant.random
    return scenarios.seeds("validation", episodes if random else 1)


def bound(agent: AgentFile, scenario: Scenario) -> Agent:
    """An agent as a policy for a scenario.

    Raises:
        IkgymError: The scenario does not fit the agent.
    """
    return Agent(Problem.of(scenario), given=agent)


def validate(agent: AgentFile, scenario: Scenario, episodes: int) -> Score:
    """The score of an agent, see :func:`score`."""
    return score(bound(agent, scenario), scenario, episodes)


def score(policy: Policy, scenario: Scenario, episodes: int) -> Score:
    """Plays episodes of the validation split with a policy; a deterministic scenario has one."""
    seeds = validation_seeds(scenario, episodes)
    played = rollouts(scenario, policy, seeds)
    total, reference = np.array([add_up(one.cost) for one in played]), reference_costs(fingerprint(scenario), seeds)
    ratios = total if reference is None else total / reference
    errors = [float(one.position_error.max()) for one in played]
    angles = [float(np.nan_to_num(one.orientation_error).max()) for one in played]
    return Score(
        episodes=len(seeds),
        cost=geometric_mean(total.tolist()),
        cost_ratio=None if reference is None else geometric_mean(ratios.tolist()),
        worst=float(ratios.max()),
        lost=float(np.mean([lost(*both) for both in zip(errors, angles, strict=True)])),
        position_error_max_mm=1e3 * float(np.mean(errors)),
        orientation_error_max_mrad=1e3 * float(np.mean(angles)) if scenario.task.has_orientation else None,
    )


def reference_costs(digest: str, seeds: Sequence[int]) -> FloatArray | None:
    """The costs of the reference policy, one a seed, for a scenario with this fingerprint; None if they are unknown."""
    known: dict[int, float] = {}
    for record in _records():
        if record["fingerprint"] == digest:
            known.update(zip(record["seeds"], record["costs"], strict=True))
    return np.array([known[seed] for seed in seeds]) if known.keys() >= set(seeds) else None


@functools.cache
def _records() -> list[dict[str, Any]]:
    content: list[dict[str, Any]] = json.loads(FILE.read_text(encoding="utf-8"))
    return content


def record_of(scenario: Scenario, seeds: Sequence[int]) -> dict[str, Any]:
    """The costs of the reference policy on some episodes, as the file has them."""
    name, parameters = parse_policy(POLICY)
    episodes = rollouts(scenario, registry.make(name, scenario, **parameters), seeds)
    return {
        "scenario": scenario.name,
        "task": scenario.task.name,
        "fingerprint": fingerprint(scenario),
        "policy": POLICY,
        "seeds": list(seeds),
        "costs": [float(f"{one.cost.sum():.{DIGITS}g}") for one in episodes],
    }


if __name__ == "__main__":
    _scenario, _seeds = scenarios.get(SCENARIO), scenarios.seeds("validation", EPISODES)
    _found = [record_of(_scenario.replace(task=tasks.get(task)), _seeds) for task in TASKS]
    write(FILE, (json.dumps(_found, indent=1) + "\n").encode())
