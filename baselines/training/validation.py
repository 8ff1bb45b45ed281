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
import numpy.typing as npt

from baselines import registry
from baselines.agents.files import AgentFile
from baselines.agents.policy import Agent
from baselines.episodes import play, rollouts
from baselines.evaluation.metrics import lost
from baselines.files import write
from baselines.fingerprints import fingerprint
from baselines.policy import Problem
from baselines.recording import add_up
from baselines.spec import parse_policy
from baselines.statistics import geometric_mean
from ikgym import scenarios, tasks
from ikgym.kernels.outcome import observation
from ikgym.kernels.simulation import Outcome
from ikgym.scenarios import Preview, Scenario
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

    def to_json(self) -> dict[str, Any]:
        """The fields by name."""
        return dataclasses.asdict(self)


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
    policy = bound(agent, scenario)
    return score(policy, scenario, episodes, policy.preview)


def score(policy: Any, scenario: Scenario, episodes: int, preview: Preview) -> Score:
    """Plays episodes of the validation split with a policy, all of them side by side.

    Args:
        policy: Any object with the `predict` of Stable-Baselines3 for observations of the environment.
        scenario: The scenario.
        episodes: Number of episodes; a deterministic scenario has one.
        preview: Steps ahead that the policy is shown.
    """
    seeds, state = validation_seeds(scenario, episodes), None
    rows, starting = len(seeds), np.ones(len(seeds), dtype=np.bool_)

    def act(out: Outcome) -> npt.NDArray[Any]:
        nonlocal state
        action, state = policy.predict(observation(out), state, starting, deterministic=True)
        starting[:] = False
        actions: npt.NDArray[Any] = action
        return actions

    costs, errors, angles = np.empty((rows, scenario.steps)), np.zeros(rows), np.zeros(rows)
    for k, out in enumerate(play(scenario, seeds, act, preview=preview)):
        costs[:, k] = out.cost
        errors = np.maximum(errors, out.position_error)
        if scenario.task.has_orientation:
            angles = np.maximum(angles, out.orientation_error)
    total, reference = add_up(costs), reference_costs(fingerprint(scenario), seeds)
    ratios = total if reference is None else total / reference
    return Score(
        episodes=rows,
        cost=geometric_mean(total.tolist()),
        cost_ratio=None if reference is None else geometric_mean(ratios.tolist()),
        worst=float(ratios.max()),
        lost=float(np.mean([lost(distance, angle) for distance, angle in zip(errors, angles, strict=True)])),
        position_error_max_mm=1e3 * float(errors.mean()),
        orientation_error_max_mrad=1e3 * float(angles.mean()) if scenario.task.has_orientation else None,
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
    costs = [float(np.sum(e.cost)) for e in episodes]
    return {
        "scenario": scenario.name,
        "task": scenario.task.name,
        "fingerprint": fingerprint(scenario),
        "policy": POLICY,
        "seeds": list(seeds),
        "costs": [float(f"{cost:.{DIGITS}g}") for cost in costs],
    }


if __name__ == "__main__":
    _scenario, _seeds = scenarios.get(SCENARIO), scenarios.seeds("validation", EPISODES)
    _found = [record_of(_scenario.replace(task=tasks.get(task)), _seeds) for task in TASKS]
    write(FILE, (json.dumps(_found, indent=1) + "\n").encode())
