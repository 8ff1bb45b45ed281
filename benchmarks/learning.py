"""Whether PPO learns with its own defaults: ``python -m benchmarks.learning --minutes 10``.

Trains ``PPO("MlpPolicy", ikgym.sb3.make_vec("panda-random", 8))`` of Stable-Baselines3 for some minutes of CPU time,
and prints how well episodes of the split `validation` are followed: the median of their largest position errors after
the first 0.2 s, that of `dls` on the same episodes, and the geometric mean of the costs divided by those of `dls`. Time
in which the machine did something else does not count.
"""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
import torch
import tyro
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

import baselines
import ikgym.sb3
from baselines.episodes import rollouts
from baselines.evaluation.summary import geometric_mean
from baselines.spec import parse_parameters
from ikgym import rl, scenarios
from ikgym.validation import FloatArray

#: Time in [s] after which errors count.
SETTLED = 0.2


@dataclasses.dataclass(frozen=True)
class Command:
    """Trains PPO with the defaults of Stable-Baselines3, and measures how well the agent follows paths."""

    minutes: float = 10.0
    """CPU time of the training."""
    scenario: str = "panda-random"
    """The scenario."""
    seed: int = 0
    """The seed of the training."""
    episodes: int = 64
    """Episodes of a validation."""
    every: int = 8
    """Rollouts between two validations."""
    change: Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME=VALUE …")] = ()
    """Fields of ikgym.rl.Learning."""
    test: bool = False
    """Measure the final agent on the test episodes: once."""

    @property
    def changes(self) -> dict[str, Any]:
        """The changed fields by name."""
        return {name: value for text in self.change for name, value in parse_parameters(text, "--change").items()}


def played(
    model: Any, scenario: str, split: str, episodes: int, changes: Mapping[str, Any] | None = None
) -> tuple[FloatArray, FloatArray]:
    """The largest position error of each episode after the first 0.2 s, in [m], and its cost. Shapes (episodes,)."""
    envs = rl.make_vec(scenario, episodes, autoreset_mode="Disabled", **{**(changes or {}), "lost_distance": None})
    observation, _ = envs.reset(seed=scenarios.SPLITS[split].start)
    worst, cost, found = np.zeros(episodes), np.zeros(episodes), scenarios.get(scenario)
    for step in range(found.steps):
        observation, *_, infos = envs.step(model.predict(observation, deterministic=True)[0])
        cost += infos["tracking_cost"] + infos["velocity_cost"]
        if (step + 1) * found.dt > SETTLED:
            worst = np.maximum(worst, infos["position_error"])
    return worst, cost


@functools.cache
def yardstick(scenario: str, split: str, episodes: int) -> tuple[FloatArray, FloatArray]:
    """The same as :func:`played` of `dls`."""
    found = scenarios.get(scenario)
    several = rollouts(found, baselines.make("dls", found), scenarios.seeds(split, episodes))
    settled = round(SETTLED / found.dt)
    errors = [one.position_error[settled:].max() for one in several]
    return np.array(errors), np.array([(one.tracking_cost + one.velocity_cost).sum() for one in several])


class Watch(BaseCallback):
    """Stops a training after some CPU time, and prints validations; their own time does not count."""

    def __init__(self, command: Command) -> None:
        super().__init__()
        self._command, self._spent, self._since, self._rollouts = command, 0.0, time.process_time(), 0

    def _on_step(self) -> bool:
        now = time.process_time()
        self._spent, self._since = self._spent + now - self._since, now
        return bool(self._spent < 60.0 * self._command.minutes)

    def _on_rollout_start(self) -> None:
        self._on_step()
        if self._rollouts % self._command.every == 0:
            self.show("validation")
        self._rollouts += 1
        self._since = time.process_time()

    def show(self, split: str) -> None:
        """Prints the present errors in one line."""
        command = self._command
        worst, cost = played(self.model, command.scenario, split, command.episodes, command.changes)
        median, p90 = 1e3 * np.median(worst), 1e3 * np.percentile(worst, 90.0)
        beside, least = yardstick(command.scenario, split, command.episodes)
        done = f"{self._spent / 60.0:6.2f} min {self.num_timesteps:9d} steps"
        print(f"{done}  {split}: median {median:8.2f} mm, 9 of 10 {p90:8.2f} mm", end="; ")
        print(f"dls {1e3 * np.median(beside):.4f} mm; cost × {geometric_mean(cost / least):.4g}", flush=True)


def main(command: Command) -> None:
    """Trains and measures."""
    torch.set_num_threads(1)
    envs, watch = ikgym.sb3.make_vec(command.scenario, 8, **command.changes), Watch(command)
    PPO("MlpPolicy", envs, seed=command.seed, device="cpu").learn(10**9, callback=watch)
    watch.show("test" if command.test else "validation")


if __name__ == "__main__":
    main(tyro.cli(Command))
