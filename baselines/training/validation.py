"""How good an agent is on episodes of the validation split, on which it is not trained, and no score is published.

``python -m baselines.training.validation --update`` computes the reference costs anew.
"""

from __future__ import annotations

import dataclasses
import functools
import json
import math
import pathlib
import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import tyro

from baselines import registry
from baselines.agents.features import Features
from baselines.agents.protocols import Transform
from baselines.episodes import Act, add_up, rollouts
from baselines.episodes import play as play_episodes
from baselines.evaluation.metrics import lost
from baselines.evaluation.summary import geometric_mean
from baselines.files import write
from baselines.fingerprints import fingerprint
from baselines.policy import SolverPolicy
from baselines.spec import parse_policy
from baselines.training.environment.view import View
from baselines.training.score import Score
from ikgym import scenarios, tasks
from ikgym.outcome import observation
from ikgym.scenarios import Preview, Scenario
from ikgym.simulation import Outcome
from ikgym.validation import FloatArray

#: Where the reference costs are kept, those of which policy, and of which scenario, tasks, and how many episodes.
FILE = pathlib.Path(__file__).with_name("validation_reference.json")
#: All initial guesses are tried in the first call, which takes longer there than real time, and costs less.
POLICY = "rhc_foresight:horizon=1501,move_blocks=48,starts=64,start_steps=0,recovery_steps=0"
SCENARIO, TASKS, EPISODES = "varga7-random", ("skew", "pose"), 64
#: Digits of a cost that are kept.
DIGITS = 7

#: From features of shape (N, f) to the deterministic outputs of an agent's network, of shape (N, n).
Actor = Callable[[Features], npt.NDArray[np.float32]]


def reference_policy(scenario: Scenario) -> SolverPolicy:
    """The policy whose costs are the reference."""
    name, parameters = parse_policy(POLICY)
    return registry.make(name, scenario, **parameters)


def validation_seeds(scenario: Scenario, episodes: int) -> tuple[int, ...]:
    """The first seeds of the validation split; one where the scenario is deterministic."""
    random = scenario.random or scenario.plant.random
    return scenarios.seeds("validation", episodes if random else 1)


def validate(actor: Actor, processing: Transform, scenario: Scenario, episodes: int) -> Score:
    """Plays episodes of the validation split with an agent.

    Args:
        actor: The agent's.
        processing: What the agent sees, and what the outputs of its network mean.
        scenario: What is to be tracked.
        episodes: How many; a deterministic scenario has one.
    """
    seeds = validation_seeds(scenario, episodes)
    return score_of(scenario, seeds, *play(actor, processing, scenario, seeds))


def score_of(
    scenario: Scenario, seeds: Sequence[int], costs: FloatArray, errors: FloatArray, angles: FloatArray
) -> Score:
    """The score of episodes that were played.

    Args:
        scenario: What was tracked.
        seeds: The reset seeds.
        costs: Of the episodes. Shape (N,).
        errors: The largest position errors in [m]. Shape (N,).
        angles: The largest orientation errors in [rad], 0 where the scenario has no orientation. Shape (N,).
    """
    reference = reference_costs(fingerprint(scenario), seeds)
    ratios = costs if reference is None else costs / reference
    return Score(
        episodes=len(seeds),
        cost=geometric_mean(costs.tolist()),
        cost_ratio=None if reference is None else geometric_mean(ratios.tolist()),
        worst=float(ratios.max()),
        lost=float(np.mean([lost(distance, angle) for distance, angle in zip(errors, angles, strict=True)])),
        position_error_max_mm=1e3 * float(errors.mean()),
        orientation_error_max_mrad=1e3 * float(angles.mean()) if scenario.task.has_orientation else None,
    )


def play(actor: Actor, processing: Transform, scenario: Scenario, seeds: Sequence[int]) -> tuple[FloatArray, ...]:
    """Plays episodes in step, as :func:`baselines.episodes.rollouts` does.

    Args:
        actor: The agent's.
        processing: What the agent sees, and what the outputs of its network mean.
        scenario: What is to be tracked.
        seeds: The reset seeds.

    Returns:
        Costs of the episodes, the largest position errors in [m], and the largest orientation errors in [rad], 0
        where the scenario has no orientation. Shapes (N,).
    """
    view, rows = View(processing, scenario), len(seeds)
    starting = np.ones(rows, dtype=np.bool_)

    def act(out: Outcome) -> npt.NDArray[Any]:
        features = view.see(observation(out), starting)
        starting[:] = False
        return view.act(actor(features))

    return played(scenario, seeds, act, view.preview)


def played(scenario: Scenario, seeds: Sequence[int], act: Act, preview: Preview) -> tuple[FloatArray, ...]:
    """What :func:`play` returns, of anybody's actions.

    Args:
        scenario: What is to be tracked.
        seeds: The reset seeds.
        act: Called before each step with what all arms show.
        preview: Steps ahead that they show.
    """
    rows = len(seeds)
    costs, errors, angles = np.empty((rows, scenario.steps)), np.zeros(rows), np.zeros(rows)
    for k, out in enumerate(play_episodes(scenario, seeds, act, preview=preview)):
        costs[:, k] = out.tracking_cost + out.velocity_cost
        errors = np.maximum(errors, out.position_error)
        if scenario.task.has_orientation:
            angles = np.maximum(angles, out.orientation_error)
    return add_up(costs), errors, angles


def reference_costs(digest: str, seeds: Sequence[int]) -> FloatArray | None:
    """The costs of the reference policy on some episodes, None where they are not known.

    Args:
        digest: The fingerprint of the scenario.
        seeds: The reset seeds. Shape of what is returned: (N,).
    """
    known: dict[int, float] = {}
    for record in _records():
        if record["fingerprint"] == digest:
            known.update(zip(record["seeds"], record["costs"], strict=True))
    return np.array([known[seed] for seed in seeds]) if known.keys() >= set(seeds) else None


@functools.cache
def _records() -> list[dict[str, Any]]:
    content: list[dict[str, Any]] = json.loads(FILE.read_text(encoding="utf-8"))
    return content


def update() -> None:
    """Computes the costs of the reference anew, and writes them down."""
    records, seeds = [], scenarios.seeds("validation", EPISODES)
    for task in TASKS:
        scenario = scenarios.get(SCENARIO).replace(task=tasks.get(task))
        episodes = rollouts(scenario, reference_policy(scenario), seeds)
        costs = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in episodes]
        records.append(record_of(scenario, seeds, costs))
    write(FILE, (json.dumps(records, indent=1) + "\n").encode())


def record_of(scenario: Scenario, seeds: Sequence[int], costs: Sequence[float]) -> dict[str, Any]:
    """The costs of the reference, as they are written down."""
    return {
        "scenario": scenario.name,
        "task": scenario.task.name,
        "fingerprint": fingerprint(scenario),
        "policy": POLICY,
        "seeds": list(seeds),
        "costs": [float(f"{cost:.{DIGITS}g}") for cost in costs],
    }


@dataclasses.dataclass(frozen=True)
class Options:
    """What the command line takes."""

    update: bool = False
    """Compute the costs anew, which takes some minutes, and write them down."""


def main(arguments: Sequence[str] | None = None) -> int:
    """The command line: prints the mean costs of the reference, or computes them anew.

    Args:
        arguments: What stands behind the command; taken from the process if left out.

    Returns:
        The exit code, 0.
    """
    options = tyro.cli(
        Options,
        prog="python -m baselines.training.validation",
        description=f"Prints the mean cost of {POLICY} on the first {EPISODES} validation episodes of {SCENARIO}: the "
        "costs of agents in training are divided by those of it.",
        args=arguments,
    )
    if options.update:
        update()
        _records.cache_clear()
    for record in _records():
        mean, where = math.exp(float(np.mean(np.log(record["costs"])))), f"{record['scenario']} ({record['task']})"
        print(f"{record['policy']} on {where}: geometric mean of {len(record['costs'])} costs {mean:.6g}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
