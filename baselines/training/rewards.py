"""Learning libraries in the environments by id, settings in the format of rl-zoo3: thin calls, nothing changed."""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import functools
import io
import json
import math
import operator
import pathlib
import time
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import torch
import yaml
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger
from stable_baselines3.common.noise import NormalActionNoise

import ikgym.sb3
from baselines.files import csv_text, reading, reason, resumed, write, write_json
from baselines.training.config import Rewards
from baselines.training.exporting import ACTIVATIONS, export
from ikgym import rl
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.files import read_user_file
from ikgym.sb3 import LearningVecEnv
from ikgym.validation import FloatArray, known_name, number, shortened, whole_number

ALGORITHMS: dict[str, type[BaseAlgorithm]] = {"ppo": PPO, "sac": SAC, "td3": TD3, "recurrent_ppo": RecurrentPPO}
#: A file an algorithm, with an entry an environment.
SETTINGS = pathlib.Path(__file__).parent / "settings"
#: Settings that may change during a training: ``lin_0.001`` falls linearly from there to 0.
SCHEDULED = ("learning_rate", "clip_range", "clip_range_vf", "delta_std")
#: Settings that Stable-Baselines3 takes unchecked: numbers of something, shares, and others above 0.
COUNTS = ("n_steps", "batch_size", "n_epochs", "buffer_size")
SHARES, POSITIVE = ("gamma", "gae_lambda", "tau"), ("learning_rate", "clip_range", "clip_range_vf", "max_grad_norm")
#: Most bytes of a file of settings, and most values with those of its aliases.
MOST_BYTES, MOST_VALUES = 2**17, 10_000


@dataclasses.dataclass(frozen=True)
class Training:
    """One training run.

    Args:
        config: Its options.
        seed: Of the run.
        out: Its folder.
    """

    config: Rewards
    seed: int
    out: pathlib.Path

    def finished(self) -> dict[str, Any] | None:
        """The `run.json` in the folder, if the same run has ended there.

        Raises:
            ResultsError: Another run has.
        """
        file = self.out / "run.json"
        there = resumed(file, self._identity(), resume=True, overwrite=False)
        if there is not None:
            with reading(file):
                for name in ("validation_score", "steps"):
                    number(name, there.get(name, math.nan))
        return there

    def run(self) -> dict[str, Any]:
        """Trains, and writes `model.zip`, `agent.safetensors`, `curve.csv` and in the end `run.json`.

        Returns:
            The content of `run.json`.

        Raises:
            UnknownNameError: The settings have no entry for the environment.
            InvalidInputError: The settings cannot be read, or the algorithm refuses one.
            ResultsError: A file cannot be written.
        """
        torch.set_num_threads(1)
        about = self._identity()
        settings = about["settings"]
        model = make(self.config, settings, self.seed)
        curve = Curve(self.config, settings["n_timesteps"], self.out / "curve.csv")
        model.set_logger(Logger(folder=None, output_formats=[]))  # otherwise it makes a temporary folder
        with _checks(self.config.method, settings):
            model.learn(settings["n_timesteps"], callback=curve)
        file = io.BytesIO()
        model.save(file)
        write(self.out / "model.zip", file.getvalue())
        about |= {"steps": model.num_timesteps, "core_seconds": round(curve.spent, 1)}
        about |= {"validation_score": curve.validate()}
        about["agent"] = self._export(model, about)
        write_json(self.out / "run.json", about)
        return about

    def _identity(self) -> dict[str, Any]:
        """All that the result depends on, for `run.json`."""
        config, settings = self.config, read(self.config)
        settings["n_timesteps"] = config.total_timesteps or settings["n_timesteps"]
        named = {"env": config.env, "algorithm": config.method, "seed": self.seed}
        return {**named, "settings": settings, "minutes": config.minutes}

    def _export(self, model: BaseAlgorithm, about: dict[str, Any]) -> str:
        """Writes `agent.safetensors`, and returns its hash, or why there is none."""
        envs: Any = model.get_env()
        try:
            return export(model, envs, self.out / "agent.safetensors", about)
        except InvalidInputError as e:
            return f"none: {e}"


def read(config: Rewards) -> dict[str, Any]:
    """The settings of algorithm and environment, as the file has them.

    Raises:
        UnknownNameError: The file has no entry for the environment.
        InvalidInputError: The file cannot be read.
    """
    if config.defaults:
        return {"n_timesteps": 1_000_000}
    content = entries(SETTINGS / f"{config.method}.yml" if config.settings is None else config.settings)
    known_name("environment in the settings", config.env, content)
    found = content[config.env]
    if not isinstance(found, dict) or "n_timesteps" not in found:
        raise InvalidInputError(f"settings: expected n_timesteps and others of {config.env}, got {shortened(found)}.")
    if not _plain(found):  # run.json states them
        raise InvalidInputError(
            f"settings: expected texts, finite numbers, lists and tables by text, got {shortened(found)}."
        )
    steps = number("n_timesteps", found["n_timesteps"], at_least=1.0)
    return {**found, "n_timesteps": int(steps)}


def _plain(value: object) -> bool:
    """Whether JSON can state a value."""
    try:
        return bool(json.loads(json.dumps(value, allow_nan=False)) == value)
    except (RecursionError, TypeError, ValueError):
        return False


def entries(file: pathlib.Path) -> dict[str, Any]:
    """The entries of a file of settings by the ids of their environments.

    Raises:
        InvalidInputError: The file cannot be read.
    """
    text = read_user_file(file, MOST_BYTES)
    try:
        # Aliases may stand for more values than memory has: they are counted before the values are made.
        count = _count(yaml.compose(text, yaml.SafeLoader), {})
        if count <= MOST_VALUES:
            content = yaml.safe_load(text)
    except (AttributeError, LookupError, RecursionError, TypeError, ValueError, yaml.YAMLError) as e:
        raise InvalidInputError(f"settings: expected a YAML file of rl-zoo3, got {file}: {reason(e)}.") from e
    if count > MOST_VALUES:
        raise InvalidInputError(f"settings: expected at most {MOST_VALUES} values with those of aliases, got more.")
    return content if isinstance(content, dict) else {}


def _count(node: Any, counts: dict[int, float]) -> float:
    """The number of values in a node of YAML, each alias counted in full; infinite if a node contains itself."""
    if id(node) not in counts:
        counts[id(node)] = math.inf
        values = node.value if isinstance(node, yaml.CollectionNode) else ()
        parts = [part for value in values for part in (value if isinstance(value, tuple) else (value,))]
        counts[id(node)] = 1 + sum(_count(part, counts) for part in parts)
    return counts[id(node)]


def make(config: Rewards, settings: Mapping[str, Any], seed: int = 0) -> BaseAlgorithm:
    """The model that rl-zoo3 makes of the same settings and seed.

    Raises:
        InvalidInputError: The algorithm refuses a setting.
    """
    envs = ikgym.sb3.make_vec(config.env, whole_number("n_envs", settings.get("n_envs", 1), at_least=1))
    return built(ALGORITHMS[config.method], envs, settings, seed)


def built(kind: type[BaseAlgorithm], envs: LearningVecEnv, settings: Mapping[str, Any], seed: int) -> BaseAlgorithm:
    """The model of an algorithm in an environment.

    Raises:
        InvalidInputError: The algorithm refuses a setting.
    """
    parameters = {key: _value(key, value) for key, value in settings.items() if key not in ("n_timesteps", "n_envs")}
    if parameters.pop("noise_type", None) is not None:
        joints: FloatArray = np.ones(envs.scenario.joints)
        deviation = number("noise_std", parameters.pop("noise_std", None), at_least=0.0)
        parameters["action_noise"] = NormalActionNoise(0.0 * joints, deviation * joints)
    policy = parameters.pop("policy", next(iter(kind.policy_aliases)))
    with _checks(kind.__name__.lower(), parameters):
        return kind(policy, envs, seed=seed, device="cpu", **parameters)


@contextlib.contextmanager
def _checks(name: str, settings: Mapping[str, Any]) -> Iterator[None]:
    """Turns errors of a learning library, which checks little before it computes, into one about the settings."""
    try:
        yield
    except (IkgymError, MemoryError, OSError):
        raise
    except Exception as e:
        raise InvalidInputError(f"settings: {name} refuses {shortened(settings, 300)}: {reason(e)}.") from e


class Curve(BaseCallback):
    """Validates at intervals, writes a row each time, and stops when the time is over.

    Args:
        config: The options of the run.
        steps: Its steps.
        file: Receives the rows: CPU seconds, steps and score.
    """

    def __init__(self, config: Rewards, steps: int, file: pathlib.Path) -> None:
        super().__init__()
        self._config, self._file, self._rows = config, file, [("core_seconds", "steps", "score")]
        self._steps, self._seconds = steps, 60.0 * (config.minutes or math.inf)
        self.spent, self._since = 0.0, time.process_time()

    def _on_step(self) -> bool:
        now = time.process_time()
        self.spent, self._since = self.spent + now - self._since, now
        done = max(self.spent / self._seconds, self.num_timesteps / self._steps)
        if done < 1.0 and done * self._config.validations >= len(self._rows):  # the last one follows the training
            self.validate()
        return self.spent < self._seconds

    def validate(self) -> float:
        """The present score on episodes of the split `validation`, which is written to the file."""
        env, episodes = self._config.env, self._config.episodes
        score = rl.score({env: [rl.costs(self.model, env, episodes=episodes)]}, "validation")[env].mean
        self._rows.append((f"{self.spent:.1f}", str(self.num_timesteps), f"{score:.4f}"))
        head, *rows = self._rows
        write(self._file, csv_text(head, rows).encode())
        self._since = time.process_time()
        return score


def _value(key: str, value: Any) -> Any:
    """A value as rl-zoo3 reads it: ``lin_…`` is a schedule, and Python's ``dict(…)`` as text is a mapping.

    Raises:
        InvalidInputError: The text is neither.
    """
    if key in COUNTS:
        return whole_number(key, value, at_least=1)
    if key in SHARES:
        return number(key, value, at_least=0.0, at_most=1.0)
    if key in POSITIVE and not isinstance(value, str) and value is not None:
        return number(key, value, above=0.0)
    if not isinstance(value, str):
        return value
    try:
        if key in SCHEDULED:
            start = number(key, float(value.split("lin_")[1]), above=0.0)
            return functools.partial(operator.mul, start)  # of the share that remains
        if value.startswith("dict("):
            return _literal(ast.parse(value, mode="eval").body)
    except (IndexError, MemoryError, RecursionError, SyntaxError, ValueError) as e:  # of text that nests too deeply
        raise InvalidInputError(
            f"settings: expected {key} in the format of rl-zoo3, got {shortened(value)}: {reason(e)}."
        ) from e
    return value


def _literal(node: ast.expr) -> Any:
    """A literal, an activation such as ``nn.ReLU``, or a ``dict(…)`` of such values."""
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "dict" and not node.args:
        return {one.arg: _literal(one.value) for one in node.keywords}
    if isinstance(node, ast.Attribute):
        known_name("activation", node.attr, kinds := {kind.__name__: kind for kind in ACTIVATIONS.values()})
        return kinds[node.attr]
    return ast.literal_eval(node)
