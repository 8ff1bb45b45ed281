"""Agents with memory beside adaptive policies: ``python -m benchmarks.memory --agents FILE … --out docs/memory.json``.

Plays the first episodes of imperfect plants, all policies with the same noise: as many noise seeds as the test set
says, of which an episode counts once, with their mean. Prints the table of docs/agents_memory.md.
"""

from __future__ import annotations

import argparse
import json
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from tqdm import tqdm

from baselines import registry
from baselines.episodes import Seeds, rollouts
from baselines.evaluation import test_sets
from baselines.evaluation.pages.statistics import geometric_interval
from baselines.files import write
from baselines.oracle import best_known
from baselines.policy import SolverPolicy
from baselines.spec import parse_policy
from ikgym import scenarios
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

PLANTS = ("panda-camera-slow", "panda-payload", "panda-field")
RHC = "'horizon':60,'iterations':3,'move_blocks':8"
PLAIN = f"policy=rhc,options={{{RHC}}}"
PREDICTED = f"policy=predicted,options={{'policy':'rhc','options':{{{RHC}}}}}"
ADAPTIVE = {
    "offset_free": f"offset_free:{PLAIN}",
    "calibrated and predicted": f"calibrated:{PREDICTED},start=1e-5,pose_noise=5e-4,walk=2e-4",
}
#: What nobody measures exactly: the noise that a filter is told where there is none.
EXACT = 1e-5
TOLD, MEMORY = "calibrated and predicted, told the noise", "agent with memory"


def informed(scenario: Scenario) -> str:
    """The calibration that is told how noisy the poses of a plant are."""
    plant = scenario.plant
    noise = f"pose_noise={plant.pose_noise or EXACT},pose_rotation_noise={plant.pose_rotation_noise or EXACT}"
    return f"calibrated:{PREDICTED},start=1e-5,{noise}"


def policies(scenario: Scenario, agents: Sequence[str]) -> dict[str, str]:
    """Who is measured, by label; filters that know nothing of late drives lose every episode on them."""
    late = scenario.plant.longest_command_delay > 0
    adaptive = {label: text for label, text in ADAPTIVE.items() if PREDICTED in text or not late}
    learned = {
        f"{MEMORY}, seed {number}": f"recurrent:path={agent}" if agent else "recurrent"
        for number, agent in enumerate(agents)
    }
    return {**adaptive, TOLD: informed(scenario), **learned}


def costs(scenario: Scenario, policy: SolverPolicy, seeds: Sequence[int], noise_seeds: int) -> list[float]:
    """The cost of each episode, the mean over its noise seeds."""
    draws = [Seeds(seed, noise_seed=noise) for seed in seeds for noise in range(noise_seeds)]
    found = [float(np.sum(e.tracking_cost + e.velocity_cost)) for e in rollouts(scenario, policy, draws)]
    return [float(f"{x:.7g}") for x in np.reshape(found, (len(seeds), noise_seeds)).mean(axis=1)]


def measure(
    names: Sequence[str], split: str, episodes: int, agents: Sequence[str], known: Mapping[str, Any]
) -> dict[str, Any]:
    """Costs by plant and by policy, beside the best known ones; these are None where they are not known.

    Args:
        names: Of the plants.
        split: Of the seeds.
        episodes: The first of the split.
        agents: Files, one a training seed.
        known: What was measured before, and is not measured again.
    """
    out: dict[str, Any] = {}
    seeds = scenarios.seeds(split, episodes)
    for name in names:
        scenario = scenarios.get(name)
        found = dict(known.get(name, {}).get("costs", {}))
        for label, text in tqdm(policies(scenario, agents).items(), desc=name):
            if label not in found:
                kind, parameters = parse_policy(text)
                policy = registry.make(kind, scenario, **parameters)
                found[label] = costs(scenario, policy, seeds, test_sets.get(name).noise_seeds)
        out[name] = {"best_known": [best_known.cost(scenario, seed) for seed in seeds], "costs": found}
    return out


def table(measured: Mapping[str, Any]) -> str:
    """Cost ratios with their intervals, and those of the agents paired with the best adaptive policy."""
    lines = ["| plant | policy | cost ratio | 95 % | ÷ best adaptive | 95 % |", "|---|---|--:|---|--:|---|"]
    for name, found in measured["plants"].items():
        known = np.array([1.0 if cost is None else cost for cost in found["best_known"]])
        rows = _rows(found["costs"])
        best = min((label for label in ADAPTIVE if label in rows), key=lambda label: float(np.log(rows[label]).mean()))
        for label, values in rows.items():
            paired = "– | –" if label in ADAPTIVE else _mean(values / rows[best])
            marked = f"**{label}**" if label == best else label
            lines.append(f"| `{name}` | {marked} | {_mean(values / known)} | {paired} |")
    return "\n".join(lines)


def _rows(found: Mapping[str, Sequence[float]]) -> dict[str, FloatArray]:
    """Costs by label, one row a training seed. Shapes (s, e)."""
    learned = [values for label, values in found.items() if label.startswith(MEMORY)]
    others = {label: np.array([values]) for label, values in found.items() if not label.startswith(MEMORY)}
    return {**others, f"{MEMORY}, {len(learned)} training seeds": np.array(learned)}


def _mean(ratios: FloatArray) -> str:
    low, high = geometric_interval(ratios)
    return f"{np.exp(np.log(ratios).mean()):.3f} | {low:.3f} … {high:.3f}"


def main(arguments: Sequence[str] | None = None) -> None:
    """The command line.

    Args:
        arguments: What stands behind the command; taken from the process if left out.
    """
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--agents", nargs="+", default=[""], help="files; the shipped one if left out")
    parser.add_argument("--plants", nargs="+", default=PLANTS, help="scenarios")
    parser.add_argument("--split", default="test", help="of the seeds")
    parser.add_argument("--episodes", type=int, default=16, help="the first of the split")
    parser.add_argument("--out", type=pathlib.Path, help="a JSON file; what is in it is not measured again")
    given = parser.parse_args(arguments)
    conditions = {"split": given.split, "episodes": given.episodes}
    known = json.loads(given.out.read_text()) if given.out is not None and given.out.exists() else conditions
    if {name: known[name] for name in conditions} != conditions:
        parser.error(f"{given.out} is of other episodes: expected {conditions}")
    plants = measure(given.plants, given.split, given.episodes, given.agents, known.get("plants", {}))
    measured = {**conditions, "plants": plants}
    if given.out is not None:
        write(given.out, (json.dumps(measured, indent=1) + "\n").encode())
    print(table(measured))


if __name__ == "__main__":
    main()
