"""Costs that scores of agents are measured by: ``python -m benchmarks.yardsticks``, in about half an hour.

For each environment by id and each of the episodes that agents are scored on: the cost of an arm at rest; of `dls` with
the best gain and damping on episodes of the split `validation`; and the least cost that any of some policies reaches,
which know the deviations of the plant and have exact sensors without delay. The reward threshold of an id is the return
of `dls` that is damped until its score is 0.8.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import baselines
from baselines.episodes import Episode, rollout, rollouts
from baselines.registry import parse_policy
from ikgym import rl, scenarios
from ikgym.rl.scoring import EPISODES, FILE
from ikgym.rl.track import UNIT
from ikgym.rl.track_kernels import distance_rewards
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Settings of `dls`.
GAINS, DAMPINGS = (0.03, 0.06, 0.1, 0.15, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0), (1e-3, 1e-2, 0.03, 0.1)
#: Policies one of which has the best cost of an episode.
BEST = ("rhc_foresight", "rhc:horizon=8")
#: Score at the reward threshold, and dampings of `dls` on both sides of it.
SOLVED, DAMPED = 0.8, (0.03, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)


class Still:
    """An arm that stands still."""

    def predict(self, observation: FloatArray, state: Any = None, **_: Any) -> tuple[FloatArray, Any]:
        """No motion."""
        return np.zeros((len(observation), 7)), state


def counted(scenario: Scenario, policy: str, seeds: Sequence[int], steps: int | None) -> FloatArray:
    """Logarithms of 1 + cost of the last steps of episodes. Shape (episodes,)."""
    name, parameters = parse_policy(policy)
    if name == "told":
        episodes = [
            rollout(scenario, baselines.make(name, scenario, seed=seed, **parameters), seed, timed=False)
            for seed in seeds
        ]
    else:
        episodes = rollouts(scenario, baselines.make(name, scenario, **parameters), seeds)
    return logarithms(episodes, steps)


def logarithms(episodes: Sequence[Episode], steps: int | None) -> FloatArray:
    """Logarithms of 1 + cost of the last steps of episodes, None for all of them. Shape (episodes,)."""
    return np.log1p([one.cost[-(steps or 0) :].sum() for one in episodes])


def returns(task: rl.Task, episodes: Sequence[Episode]) -> FloatArray:
    """Sums of the rewards of whole episodes, see :class:`ikgym.rl.Task`. Shape (episodes,)."""
    out = np.empty((len(episodes), len(episodes[0].position_error)))
    for one, rewards in zip(episodes, out, strict=True):
        scales = task.radian, UNIT, task.zero
        distance_rewards(scales, one.position_error, one.orientation_error, one.velocity_cost, rewards)
    total: FloatArray = out.sum(axis=1)
    return total


def informed(scenario: Scenario, policy: str) -> tuple[Scenario, str]:
    """The same plant with exact sensors, and the policy that knows it; as they are where the plant is ideal."""
    if scenario.plant.ideal:
        return scenario, policy
    exact = {"pose_noise": 0.0, "pose_rotation_noise": 0.0, "pose_every": 1, "pose_delay": 0, "pose_missing": 0.0}
    name, parameters = parse_policy(policy)
    plant = scenario.plant.replace(**exact)
    return scenario.replace(plant=plant), f"told:policy={name},options={parameters}"


def tuned(scenario: Scenario, steps: int | None) -> str:
    """`dls` with the best settings on episodes for validation."""
    seeds = scenarios.seeds("validation", EPISODES)
    specs = [f"dls:gain={gain},damping={damping}" for gain, damping in itertools.product(GAINS, DAMPINGS)]
    return min(specs, key=lambda spec: float(counted(scenario, spec, seeds, steps).mean()))


def measure(name: str, split: str, dls: str) -> dict[str, FloatArray]:
    """Logarithms of 1 + cost of the yardsticks of an environment. Shapes (episodes,)."""
    task = rl.IDS[name].task
    scenario, seeds = scenarios.find(task.scenario), scenarios.seeds(split, EPISODES)
    still = np.log1p(np.asarray(rl.costs(Still(), name, split=split, episodes=EPISODES)))
    tuned_dls = least = counted(scenario, dls, seeds, task.counted)
    for policy in (dls, *BEST):
        plant, privileged = informed(scenario, policy)
        least = np.minimum(least, counted(plant, privileged, seeds, task.counted))
    return {"still": still, "dls": tuned_dls, "best": least}


def threshold(name: str, dls: str, yardsticks: Mapping[str, FloatArray]) -> float:
    """The mean return of `dls` in an environment with the damping that takes its score down to 0.8."""
    task, seeds, points = rl.IDS[name].task, scenarios.seeds("validation", EPISODES), []
    scenario, (solver, parameters) = scenarios.find(task.scenario), parse_policy(dls)
    still, one = yardsticks["still"].mean(), yardsticks["dls"].mean()
    for damping in DAMPED:
        policy = baselines.make(solver, scenario, **{**parameters, "damping": damping})
        episodes = rollouts(scenario, policy, seeds)
        score = (still - logarithms(episodes, task.counted).mean()) / (still - one)
        points.append((float(score), float(returns(task, episodes).mean())))
    scores, means = np.array(sorted(points)).T
    return round(float(np.interp(SOLVED, scores, means)), 6)


def main() -> None:
    """Measures all of them and writes the file."""
    out: dict[str, Any] = {"dls_settings": {}, "thresholds": {}, "validation": {}, "test": {}}
    for name, kind in rl.IDS.items():
        dls = tuned(scenarios.find(kind.task.scenario), kind.task.counted)
        costs = {split: measure(name, split, dls) for split in ("validation", "test")}
        out["dls_settings"][name], out["thresholds"][name] = dls, threshold(name, dls, costs["validation"])
        for split, yardsticks in costs.items():
            out[split][name] = {policy: values.round(4).tolist() for policy, values in yardsticks.items()}
            print(
                name, split, dls, {policy: values.mean().round(3) for policy, values in yardsticks.items()}, flush=True
            )
    FILE.write_text(json.dumps(out).replace("}, ", "},\n").replace("], ", "],\n") + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
