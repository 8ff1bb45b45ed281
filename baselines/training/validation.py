"""The score of an agent on episodes of the validation split, used neither for training nor for publication."""

from __future__ import annotations

import dataclasses

import numpy as np

from baselines.agents.files import AgentFile
from baselines.agents.policy import Agent
from baselines.episodes import rollouts
from baselines.evaluation.metrics import lost
from baselines.oracle import best_known
from baselines.policy import Problem
from baselines.policy.protocol import Policy
from baselines.recording import add_up
from baselines.statistics import geometric_mean
from ikgym import scenarios
from ikgym.scenarios import Scenario


@dataclasses.dataclass(frozen=True)
class Score:
    """The score of an agent on the validation split.

    Args:
        episodes: Number of episodes.
        cost: Geometric mean of their costs.
        cost_ratio: Geometric mean of their cost ratios; None where a best known cost is missing.
        worst: Largest of these ratios; of the costs where there are none.
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


def validated(policy: Policy, scenario: Scenario, episodes: int) -> Score:
    """Plays episodes of the validation split with a policy; a deterministic scenario has one."""
    seeds = validation_seeds(scenario, episodes)
    played = rollouts(scenario, policy, seeds)
    total, known = np.array([add_up(one.cost) for one in played]), best_known.costs(scenario, seeds)
    complete = None not in known
    ratios = total / np.array(known, dtype=np.float64) if complete else total
    errors = [float(one.position_error.max()) for one in played]
    angles = [float(np.nan_to_num(one.orientation_error).max()) for one in played]
    return Score(
        episodes=len(seeds),
        cost=geometric_mean(total.tolist()),
        cost_ratio=geometric_mean(ratios.tolist()) if complete else None,
        worst=float(ratios.max()),
        lost=float(np.mean([lost(*both) for both in zip(errors, angles, strict=True)])),
        position_error_max_mm=1e3 * float(np.mean(errors)),
        orientation_error_max_mrad=1e3 * float(np.mean(angles)) if scenario.task.has_orientation else None,
    )
