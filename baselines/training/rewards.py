"""Training by rewards: thin calls of Stable-Baselines3 and sb3-contrib in the environments by id."""

from __future__ import annotations

import contextlib
import io
import math
import pathlib
import time
from collections.abc import Iterator, Mapping
from typing import Any

import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import Logger

import ikgym.sb3
from baselines.files import csv_text, read_resumable, reading, reason, write, write_json
from baselines.training.exporting import export
from baselines.training.options import Rewards
from baselines.training.zoo import ALGORITHMS, arguments, read_settings
from ikgym import rl
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.sb3 import LearningVecEnv
from ikgym.validation import number, shorten, whole_number


def train(config: Rewards, seed: int, folder: pathlib.Path) -> dict[str, Any]:
    """Trains, and writes `model.zip`, `agent.safetensors`, `curve.csv` and in the end `run.json`.

    Args:
        config: The options.
        seed: The seed of the run.
        folder: The folder of the run.

    Returns:
        The content of `run.json`.

    Raises:
        UnknownNameError: The settings have no entry for the environment, or there is no such setting.
        InvalidInputError: The settings cannot be read, or the algorithm refuses one.
        ResultsError: A file cannot be written.
    """
    torch.set_num_threads(1)
    about = identity(config, seed)
    settings = about["settings"]
    rows = whole_number("n_envs", settings.get("n_envs", 1), at_least=1)
    envs = ikgym.sb3.make_vec(config.env, rows, inverse=config.inverse)
    model = make(config.algorithm, envs, settings, seed)
    curve = Curve(config, settings["n_timesteps"], folder / "curve.csv")
    model.set_logger(Logger(folder=None, output_formats=[]))  # otherwise it makes a temporary folder
    with _checked_by(config.algorithm, settings):
        model.learn(settings["n_timesteps"], callback=curve)
    file = io.BytesIO()
    model.save(file)
    write(folder / "model.zip", file.getvalue())
    about |= {"steps": model.num_timesteps, "core_seconds": round(curve.spent, 1)}
    about |= {"validation_score": curve.validate()}
    try:
        about["agent"] = export(model, envs, folder / "agent.safetensors", about)
    except InvalidInputError as e:
        about["agent"] = f"none: {e}"
    write_json(folder / "run.json", about)
    return about


def read_finished(config: Rewards, seed: int, folder: pathlib.Path) -> dict[str, Any] | None:
    """The `run.json` in a folder, if the same run has ended there.

    Raises:
        ResultsError: Another run has.
    """
    file = folder / "run.json"
    there = read_resumable(file, identity(config, seed))
    if there is not None:
        with reading(file):
            for name in ("validation_score", "steps"):
                number(name, there.get(name, math.nan))
    return there


def identity(config: Rewards, seed: int) -> dict[str, Any]:
    """All that the result of a run depends on, for `run.json`.

    Raises:
        UnknownNameError: The settings have no entry for the environment.
        InvalidInputError: The settings cannot be read.
    """
    settings = read_settings(config)
    settings["n_timesteps"] = config.total_timesteps or settings["n_timesteps"]
    about = {"env": config.env, "algorithm": config.algorithm, "seed": seed, "inverse": config.inverse}
    return {**about, "settings": settings, "minutes": config.minutes}


def make(algorithm: str, envs: LearningVecEnv, settings: Mapping[str, Any], seed: int = 0) -> BaseAlgorithm:
    """The model that rl-zoo3 makes of the same settings and seed.

    Raises:
        UnknownNameError: There is no such setting.
        InvalidInputError: The algorithm refuses a setting.
    """
    given = arguments(algorithm, settings, envs.scenario.joints)
    with _checked_by(algorithm, settings):
        return ALGORITHMS[algorithm](env=envs, seed=seed, device="cpu", **given)


class Curve(BaseCallback):
    """Validates at intervals, writes a row each time, and stops when the time is over.

    Args:
        config: The options of the run.
        steps: Its steps.
        file: Receives the rows: CPU seconds, steps and score.
    """

    def __init__(self, config: Rewards, steps: int, file: pathlib.Path) -> None:
        super().__init__()
        self._config, self._file, self._rows = config, file, list[tuple[str, str, str]]()
        self._steps, self._seconds = steps, 60.0 * (config.minutes or math.inf)
        self.spent, self._since = 0.0, time.process_time()

    def _on_step(self) -> bool:
        now = time.process_time()
        self.spent, self._since = self.spent + now - self._since, now
        progress = max(self.spent / self._seconds, self.num_timesteps / self._steps)
        if progress < 1.0 and progress * self._config.validations >= len(self._rows) + 1:  # the last follows training
            self.validate()
        return self.spent < self._seconds

    def validate(self) -> float:
        """The present score on episodes of the split `validation`, which is written to the file."""
        env, episodes, inverse = self._config.env, self._config.episodes, self._config.inverse
        score = rl.score({env: [rl.costs(self.model, env, episodes=episodes, inverse=inverse)]})[env].mean
        self._rows.append((f"{self.spent:.1f}", str(self.num_timesteps), f"{score:.4f}"))
        write(self._file, csv_text(("core_seconds", "steps", "score"), self._rows).encode())
        self._since = time.process_time()
        return score


@contextlib.contextmanager
def _checked_by(algorithm: str, settings: Mapping[str, Any]) -> Iterator[None]:
    """Turns errors of a learning library, which checks little before it computes, into one about the settings."""
    try:
        yield
    except (IkgymError, MemoryError, OSError):
        raise
    except Exception as e:
        raise InvalidInputError(f"settings: {algorithm} refuses {shorten(settings, 300)}: {reason(e)}.") from e
