"""Costs that scores of agents are measured by: ``python -m benchmarks.yardsticks``, in some minutes.

For each environment by id: an arm that stands still; `dls` with the best gain and damping on episodes of the split
`validation`; and the least cost of an episode that any of some policies reaches, which on a plant are told how the arm
deviates and have exact sensors without delay. The reward threshold of an id is the return of `dls` that is damped until
its score is 0.8.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import baselines
from baselines.episodes import rollout, rollouts
from baselines.recording import Episode
from baselines.spec import parse_policy
from ikgym import rl, scenarios
from ikgym.rl.scoring import FILE
from ikgym.rl.track import UNIT
from ikgym.rl.track_kernels import distance_rewards
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

EPISODES = 64
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


def measured(name: str, split: str, dls: str) -> dict[str, float]:
    """Mean logarithms of 1 + cost of an environment."""
    task = rl.IDS[name].task
    scenario, seeds = scenarios.find(task.scenario), scenarios.seeds(split, EPISODES)
    least = counted(scenario, dls, seeds, task.counted)
    means = {"still": float(np.log1p(rl.costs(Still(), name, split=split, episodes=EPISODES)).mean())}
    means["dls"] = float(least.mean())
    for policy in (dls, *BEST):
        plant, told = informed(scenario, policy)
        least = np.minimum(least, counted(plant, told, seeds, task.counted))
    return {name: round(value, 6) for name, value in {**means, "best": float(least.mean())}.items()}


def threshold(name: str, dls: str, own: Mapping[str, float]) -> float:
    """The mean return of `dls` in an environment with the damping that takes its score down to 0.8."""
    task, seeds, points = rl.IDS[name].task, scenarios.seeds("validation", EPISODES), []
    scenario, (solver, parameters) = scenarios.find(task.scenario), parse_policy(dls)
    for damping in DAMPED:
        policy = baselines.make(solver, scenario, **{**parameters, "damping": damping})
        episodes = rollouts(scenario, policy, seeds)
        score = (own["still"] - logarithms(episodes, task.counted).mean()) / (own["still"] - own["dls"])
        points.append((float(score), float(returns(task, episodes).mean())))
    scores, means = np.array(sorted(points)).T
    return round(float(np.interp(SOLVED, scores, means)), 6)


def main() -> None:
    """Measures all of them and writes the file."""
    out: dict[str, Any] = {"dls_settings": {}, "validation": {}, "test": {}, "thresholds": {}}
    for name, kind in rl.IDS.items():
        dls = tuned(scenarios.find(kind.task.scenario), kind.task.counted)
        out["dls_settings"][name] = dls
        for split in ("validation", "test"):
            out[split][name] = measured(name, split, dls)
            print(name, split, dls, out[split][name], flush=True)
        out["thresholds"][name] = threshold(name, dls, out["validation"][name])
    FILE.write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
