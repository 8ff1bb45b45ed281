"""Stable-Baselines3 in the environments by id, with settings in the format of rl-zoo3: thin calls, nothing changed."""

from __future__ import annotations

import ast
import csv
import dataclasses
import functools
import math
import operator
import pathlib
import time
from typing import Any

import numpy as np
import torch
import yaml
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.noise import NormalActionNoise

import ikgym.sb3
from baselines.files import write_json
from baselines.training.exporting import ACTIVATIONS
from baselines.training.trainers.sb3 import ALGORITHMS
from ikgym import rl
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, known_name, whole_number

#: A file an algorithm, with an entry an environment.
SETTINGS = pathlib.Path(__file__).parent / "settings"
#: Settings that may change during a training: ``lin_0.001`` falls linearly from there to 0.
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf", "delta_std")


@dataclasses.dataclass(frozen=True)
class Training:
    """One training run.

    Args:
        algorithm: `ppo`, `sac` or `td3`.
        env: The id.
        seed: Of the run.
        total_timesteps: Steps of all arms together; those of the settings if left out.
        minutes: CPU time of the training without validations after which the run ends early; None for no limit.
        settings: A file in the format of rl-zoo3; the published one if left out.
        defaults: Use the defaults of the library and one arm instead.
        validations: Number of validations, evenly spaced.
        episodes: Episodes of a validation.
    """

    algorithm: str
    env: str
    seed: int = 0
    total_timesteps: int | None = None
    minutes: float | None = None
    settings: pathlib.Path | None = None
    defaults: bool = False
    validations: int = 10
    episodes: int = 32

    def run(self, out: pathlib.Path) -> dict[str, Any]:
        """Trains, and writes `model.zip`, `curve.csv` and `run.json` into a folder.

        Raises:
            UnknownNameError: There is no such algorithm or environment.
            InvalidInputError: The settings cannot be read, or the algorithm refuses one.
        """
        torch.set_num_threads(1)
        out.mkdir(parents=True, exist_ok=True)
        settings = self.read()
        model, steps = self.make(settings), self.total_timesteps or settings["n_timesteps"]
        curve = Curve(self, steps, out / "curve.csv")
        model.learn(steps, callback=curve)
        model.save(out / "model.zip")
        score = curve.validate()
        about = {"env": self.env, "algorithm": self.algorithm, "seed": self.seed, "settings": settings}
        about |= {"steps": model.num_timesteps, "core_seconds": round(curve.spent, 1), "validation_score": score}
        write_json(out / "run.json", about)
        return about

    def read(self) -> dict[str, Any]:
        """The settings of algorithm and environment, as the file has them.

        Raises:
            UnknownNameError: There is no such algorithm, environment or entry of the file.
            InvalidInputError: The file cannot be read.
        """
        known_name("algorithm", self.algorithm, ALGORITHMS)
        known_name("environment", self.env, rl.IDS)
        if self.defaults:
            return {"n_timesteps": 1_000_000}
        file = SETTINGS / f"{self.algorithm}.yml" if self.settings is None else self.settings
        try:
            content = yaml.safe_load(file.read_text(encoding="utf-8"))
        except (OSError, yaml.YAMLError) as e:
            raise InvalidInputError(f"settings: expected a YAML file of rl-zoo3, got {file}: {e}") from e
        known_name("environment in the settings", self.env, content)
        return dict(content[self.env])

    def make(self, settings: dict[str, Any]) -> BaseAlgorithm:
        """The model that rl-zoo3 makes of the same settings and seed.

        Raises:
            InvalidInputError: The algorithm refuses a setting.
        """
        parameters = {key: _value(key, value) for key, value in settings.items() if key != "n_timesteps"}
        envs = ikgym.sb3.make_vec(self.env, whole_number("n_envs", parameters.pop("n_envs", 1), at_least=1))
        if parameters.pop("noise_type", None) is not None:
            joints: FloatArray = np.ones(envs.scenario.joints)
            parameters["action_noise"] = NormalActionNoise(0.0 * joints, parameters.pop("noise_std") * joints)
        policy, kind = parameters.pop("policy", "MlpPolicy"), ALGORITHMS[self.algorithm]
        try:
            return kind(policy, envs, seed=self.seed, device="cpu", **parameters)
        except (AssertionError, TypeError, ValueError) as e:  # Stable-Baselines3's own checks
            raise InvalidInputError(f"settings: {self.algorithm} refuses {parameters}: {e}") from e


class Curve(BaseCallback):
    """Validates at intervals, writes a row each time, and stops when the time is over.

    Args:
        training: The run.
        steps: Its steps.
        file: Receives the rows: CPU seconds, steps and score.
    """

    def __init__(self, training: Training, steps: int, file: pathlib.Path) -> None:
        super().__init__()
        self._training, self._file, self._rows = training, file, [("core_seconds", "steps", "score")]
        self._steps, self._seconds = steps, 60.0 * (training.minutes or math.inf)
        self.spent, self._since = 0.0, time.process_time()

    def _on_step(self) -> bool:
        now = time.process_time()
        self.spent, self._since = self.spent + now - self._since, now
        done = max(self.spent / self._seconds, self.num_timesteps / self._steps)
        if done * self._training.validations >= len(self._rows):
            self.validate()
        return self.spent < self._seconds

    def validate(self) -> float:
        """The present score on episodes of the split `validation`, which is written to the file."""
        env, episodes = self._training.env, self._training.episodes
        score = rl.score({env: [rl.costs(self.model, env, episodes=episodes)]}, "validation")[env].mean
        self._rows.append((f"{self.spent:.1f}", str(self.num_timesteps), f"{score:.4f}"))
        with self._file.open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream).writerows(self._rows)
        self._since = time.process_time()
        return score


def _value(key: str, value: Any) -> Any:
    """A value as rl-zoo3 reads it: ``lin_…`` is a schedule, and Python's ``dict(…)`` as text is a mapping.

    Raises:
        InvalidInputError: The text is neither.
    """
    if not isinstance(value, str):
        return value
    try:
        if key in SCHEDULED:
            return functools.partial(operator.mul, float(value.split("lin_")[1]))  # of the share that remains
        if value.startswith("dict("):
            call: Any = ast.parse(value, mode="eval").body
            return {one.arg: _literal(one.value) for one in call.keywords}
    except (IndexError, SyntaxError, ValueError) as e:
        raise InvalidInputError(f"settings: expected {key} in the format of rl-zoo3, got {value!r}: {e}") from e
    return value


def _literal(node: ast.expr) -> Any:
    """A literal, or an activation such as ``nn.ReLU``."""
    if isinstance(node, ast.Attribute):
        known_name("activation", node.attr, kinds := {kind.__name__: kind for kind in ACTIVATIONS.values()})
        return kinds[node.attr]
    return ast.literal_eval(node)
