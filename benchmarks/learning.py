"""Whether PPO learns with its own defaults: ``python -m benchmarks.learning --minutes 10``.

Trains ``PPO("MlpPolicy", ikgym.sb3.make_vec("panda-random", 8))`` of Stable-Baselines3 for some minutes of processor
time, and prints how well episodes of the split `validation` are followed on the way: of each the largest position error
after the first 0.2 s, and of these the median. Time in which the machine did something else does not count.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

import ikgym
import ikgym.sb3
from baselines.spec import parse_parameters
from ikgym import rl, scenarios
from ikgym.validation import FloatArray

#: Time in [s] after which errors count.
SETTLED = 0.2


def largest_errors(
    model: Any, scenario: str, split: str, episodes: int, changes: Mapping[str, Any] | None = None
) -> FloatArray:
    """The largest position error of each episode after the first 0.2 s, in [m]. Shape (episodes,)."""
    envs = rl.make_vec(scenario, episodes, autoreset_mode="Disabled", **{**(changes or {}), "lost_distance": None})
    observation, _ = envs.reset(seed=scenarios.SPLITS[split].start)
    worst, found = np.zeros(episodes), scenarios.get(scenario)
    for step in range(found.steps):
        observation, *_, infos = envs.step(model.predict(observation, deterministic=True)[0])
        if (step + 1) * found.dt > SETTLED:
            worst = np.maximum(worst, infos["position_error"])
    return worst


class Watch(BaseCallback):
    """Ends a training after some time of the processor, and says how far it is."""

    def __init__(self, arguments: argparse.Namespace) -> None:
        super().__init__()
        self._arguments, self._spent, self._since, self._rollouts = arguments, 0.0, time.process_time(), 0
        self._bar = tqdm(total=arguments.minutes, unit="min", bar_format="{l_bar}{bar}| {n:.2f}/{total} min{postfix}")

    def _on_step(self) -> bool:
        now = time.process_time()
        self._spent, self._since = self._spent + now - self._since, now
        self._bar.update(min(self._spent / 60.0, self._bar.total) - self._bar.n)
        return bool(self._spent < 60.0 * self._arguments.minutes)

    def _on_rollout_start(self) -> None:
        self._on_step()
        if self._rollouts % self._arguments.every == 0:
            self._bar.write(said(self.model, self._arguments, "validation", self._spent, self.num_timesteps))
        self._rollouts += 1
        self._since = time.process_time()  # validation does not count

    def _on_training_end(self) -> None:
        self._bar.close()


def said(model: Any, arguments: argparse.Namespace, split: str, spent: float, steps: int) -> str:
    """One line of what has been reached."""
    worst = 1e3 * largest_errors(model, arguments.scenario, split, arguments.episodes, dict(arguments.change))
    median, p90 = np.median(worst), np.percentile(worst, 90.0)
    return f"{spent / 60.0:6.2f} min {steps:9d} steps  {split}: median {median:8.2f} mm, 9 of 10 {p90:8.2f} mm"


def change(given: str) -> tuple[str, Any]:
    """A field and its value from NAME=VALUE."""
    (found,) = parse_parameters(given, "--change").items()
    return found


def main(given: Sequence[str] | None = None) -> None:
    """Trains and measures.

    Args:
        given: Of the command line; that of this process if left out.
    """
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10.0, help="of processor time")
    parser.add_argument("--scenario", default="panda-random")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--episodes", type=int, default=64, help="that are followed")
    parser.add_argument("--every", type=int, default=8, help="rollouts between two validations")
    parser.add_argument("--threads", type=int, default=1, help="of PyTorch")
    parser.add_argument(
        "--change", type=change, nargs="+", default=[], metavar="NAME=VALUE", help="fields of ikgym.rl.Learning"
    )
    parser.add_argument("--test", action="store_true", help="measure on the test episodes in the end: once")
    arguments = parser.parse_args(given)
    torch.set_num_threads(arguments.threads)
    envs = ikgym.sb3.make_vec(arguments.scenario, 8, **dict(arguments.change))
    model = PPO("MlpPolicy", envs, seed=arguments.seed, device="cpu")
    watch = Watch(arguments)
    model.learn(10**9, callback=watch)
    split = "test" if arguments.test else "validation"
    print(said(model, arguments, split, 60.0 * arguments.minutes, model.num_timesteps))


if __name__ == "__main__":
    main()
