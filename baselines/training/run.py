"""One run: the training of one agent with one seed, in one folder, which can be killed at any moment and resumed.

| file | what it holds |
|---|---|
| `run.json` | configuration, seed, versions, machine, what it has cost, evaluations, hash of the final weights |
| `history.json` | a row a segment: its metrics, and the score where there was an evaluation |
| `checkpoint.pt` | where the run stands, to go on from |
| `tensorboard/` | the history, for TensorBoard |
| `model.zip` | at the end: the kept model, for Stable-Baselines3; not of ``apg``, which has no critic |
| `model.safetensors` | likewise: all its weights, for ``--init``; cannot run code |
| `agent.safetensors` | at the end: the same agent, for :mod:`baselines` |
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import math
import pathlib
import platform
import time
from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import numba
import numpy as np
import stable_baselines3
import torch
from torch.utils.tensorboard import SummaryWriter

import ikgym
from baselines.evaluation.machine import describe
from baselines.files.locks import locked
from baselines.fingerprints import fingerprint
from baselines.training import checkpoint, methods
from baselines.training.checkpoint import Checkpoint
from baselines.training.config.base import Config
from baselines.training.errors import TrainingError
from baselines.training.folder import FORMAT, Folder
from baselines.training.networks import MemoryModel
from baselines.training.randomness import deterministic_torch, reseed
from baselines.training.score import Score
from baselines.training.trainer import SegmentMetrics, Trainer
from baselines.training.trainers.export import export
from baselines.training.trainers.models import Model, weights_hash
from ikgym.scenarios import Scenario

#: No weight of a network that has learned anything is this large.
LARGEST = 1e9

#: Called after each segment with how many are done, and the last score.
OnSegment = Callable[[int, Score | None], object]


@dataclasses.dataclass(frozen=True)
class Result:
    """What came of a run.

    Args:
        folder: Where its files are.
        weights_sha256: Of all weights at the end, see :func:`baselines.training.trainers.models.weights_hash`.
        score: Of the kept agent.
    """

    folder: pathlib.Path
    weights_sha256: str
    score: Score


def train(
    config: Config,
    seed: int,
    path: pathlib.Path,
    *,
    resume: bool = False,
    overwrite: bool = False,
    checkpoint_every: float = 0.0,
    command: str = "baselines.training.run.train(…)",
    on_segment: OnSegment | None = None,
) -> Result:
    """Trains an agent.

    Args:
        config: Of any method.
        seed: From which all that is random follows.
        path: The folder of the run.
        resume: Goes on with what is in the folder, if there is something.
        overwrite: Replaces what is in the folder.
        checkpoint_every: Shortest time between two checkpoints, in [s]; they change nothing but what is lost when the
            run is killed.
        command: What to say in `run.json` that the run was begun by.
        on_segment: See :data:`OnSegment`.

    Raises:
        IkgymError: What training, validation or files can go wrong with.
    """
    with locked(path), deterministic_torch():
        run = _Run(config, seed, Folder(path), command)
        run.begin(resume=resume, overwrite=overwrite)
        return run.go(checkpoint_every, on_segment)


class _Run:
    def __init__(self, config: Config, seed: int, folder: Folder, command: str) -> None:
        self._config, self._seed, self._folder = config, seed, folder
        self._scenario = config.make_scenario()
        self._at = Checkpoint()
        self._clock, self._core = time.monotonic(), time.process_time()
        self._about: dict[str, Any] = {
            "format": FORMAT,
            "method": config.method,
            "seed": seed,
            "status": "running",
            "command": command,
            "config": config.to_json(),
            "processing": config.processing.to_json(),
            "scenario": about_scenario(self._scenario),
            "init": about_file(config.init),
            "versions": versions(),
            "machine": describe(),
        }

    def begin(self, *, resume: bool, overwrite: bool) -> None:
        identity = {part: self._about[part] for part in ("method", "seed", "config", "scenario", "init", "versions")}
        there = self._folder.prepare(identity, resume=resume, overwrite=overwrite)
        reseed(self._seed, None)
        self._trainer: Trainer = methods.get(self._config.method).make(self._config, self._scenario, self._seed)
        if there is not None:
            self._about["command"] = there.get("command", self._about["command"])
            if self._folder.checkpoint.exists():
                self._at = checkpoint.load(self._folder.checkpoint)
                if self._at.trainer is not None:
                    self._trainer.restore(self._at.trainer)
        self._write_about()

    def go(self, checkpoint_every: float, on_segment: OnSegment | None) -> Result:
        with self._board() as board:
            if not self._at.history:
                self._note(0, {}, board)
                self._count()
            saved = -math.inf
            while self._at.segments < self._trainer.segments:
                number = self._at.segments
                reseed(self._seed, number)
                metrics = self._segment(number)
                self._at.segments = number + 1
                score = self._note(number + 1, metrics, board)
                self._count()
                if self._at.segments == self._trainer.segments or time.monotonic() - saved >= checkpoint_every:
                    self._save()
                    saved = time.monotonic()
                if on_segment is not None:
                    on_segment(self._at.segments, score)
        return self._finish()

    def _segment(self, number: int) -> SegmentMetrics:
        """A segment of the trainer, and a clear message where its weights diverge."""
        try:
            metrics = self._trainer.segment(number)
        except (ValueError, RuntimeError):
            if _finite(self._trainer.model):
                raise
        else:
            if _finite(self._trainer.model):
                return metrics
        raise TrainingError(
            f"The weights were no longer finite in segment {number + 1}: try a lower learning rate, or another seed."
        )

    def _note(self, done: int, metrics: SegmentMetrics, board: SummaryWriter) -> Score | None:
        """Adds a row to the history, with a score where one is due."""
        config, trainer = self._config, self._trainer
        row: dict[str, Any] = {"segment": done, "steps": trainer.steps}
        row.update({name: value for name, value in metrics.items() if math.isfinite(value)})
        score = None
        if done % config.evaluate_every == 0 or done == trainer.segments:
            model = trainer.model
            score = trainer.score(config.validation_episodes)
            row["validation"] = score.to_json()
            if self._at.best is None or score.cost < self._at.best["score"]["cost"]:
                weights = {name: tensor.clone() for name, tensor in model.policy.state_dict().items()}
                self._at.best = {"segment": done, "score": score.to_json(), "policy": weights}
        self._at.history.append(row)
        for name, value in [*row.items(), *(score.to_json() if score else {}).items()]:
            if isinstance(value, float):
                board.add_scalar(name if "/" in name else f"validation/{name}", value, trainer.steps)
        return score

    def _finish(self) -> Result:
        """Writes the agent, and what came of the run."""
        model, config = self._trainer.model, self._config
        final = weights_hash(model)
        kept = {"segment": self._trainer.segments, "by": "end"}
        last = self._at.history[-1]["validation"]
        best = self._at.best
        if config.keep_best and best is not None:
            model.policy.load_state_dict(best["policy"])
            kept, last = {"segment": best["segment"], "by": "validation"}, best["score"]
        self._about["status"] = "finished"
        self._about["weights_sha256"] = final
        self._about["kept"] = {**kept, "weights_sha256": weights_hash(model), "validation": last}
        content = self._content()
        export(self._trainer, config.activation, self._folder, self._scenario, content)
        # Killed between its last checkpoint and the history that belongs to it, a run lacks the last row.
        self._folder.write_json(self._folder.history, self._at.history)
        self._folder.write_json(self._folder.run, content)
        return Result(self._folder.path, final, Score(**last))

    def _save(self) -> None:
        self._at.trainer = self._trainer.state()
        self._at.save(self._folder.checkpoint)
        self._folder.write_json(self._folder.history, self._at.history)
        self._write_about()

    def _count(self) -> None:
        """Adds what has passed since the last call to the run's times."""
        clock, core = time.monotonic(), time.process_time()
        self._at.wall_seconds += clock - self._clock
        self._at.core_seconds += core - self._core
        self._clock, self._core = clock, core
        self._at.history[-1]["core_minutes"] = self._at.core_seconds / 60.0

    def _content(self) -> dict[str, Any]:
        return {
            **self._about,
            "training": {
                "segments": self._at.segments,
                "steps": self._trainer.steps,
                "core_minutes": self._at.core_seconds / 60.0,
                "wall_minutes": self._at.wall_seconds / 60.0,
            },
            "validation": [
                {name: row[name] for name in ("segment", "steps", "core_minutes")} | row["validation"]
                for row in self._at.history
                if "validation" in row and "core_minutes" in row
            ],
        }

    def _write_about(self) -> None:
        self._folder.write_json(self._folder.run, self._content())

    @contextlib.contextmanager
    def _board(self) -> Iterator[SummaryWriter]:
        """TensorBoard's file; what a killed run had written behind its checkpoint is taken back."""
        gone_on = bool(self._at.history)
        board = SummaryWriter(str(self._folder.tensorboard), purge_step=self._trainer.steps + 1 if gone_on else None)
        try:
            yield board
        finally:
            board.close()


def about_scenario(scenario: Scenario) -> dict[str, Any]:
    """Which scenario it is, in `run.json`."""
    return {"name": scenario.name, "steps": scenario.steps, "fingerprint": fingerprint(scenario)}


def about_file(file: pathlib.Path | None) -> dict[str, Any] | None:
    """Which file it is, in `run.json`.

    Raises:
        TrainingError: It cannot be read.
    """
    if file is None:
        return None
    try:
        with file.open("rb") as stream:
            return {"file": str(file), "sha256": hashlib.file_digest(stream, "sha256").hexdigest()}
    except OSError as e:
        raise TrainingError(f"Cannot read {file}: {e.strerror or e}.") from None


def versions() -> dict[str, str]:
    """The versions that a result depends on, in `run.json`."""
    return {
        "ikgym": ikgym.__version__,
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "gymnasium": gymnasium.__version__,
        "torch": torch.__version__,
        "stable_baselines3": stable_baselines3.__version__,
    }


def _finite(model: Model | MemoryModel) -> bool:
    """Whether all weights are numbers that can still be added up."""
    return all(bool((parameter.detach().abs() < LARGEST).all()) for parameter in model.policy.parameters())
