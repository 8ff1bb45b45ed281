"""One run: the training of one agent with one seed, in one folder, which can be killed at any moment and resumed."""

from __future__ import annotations

import hashlib
import math
import pathlib
import platform
import time
from collections.abc import Callable
from typing import Any

import gymnasium
import numba
import numpy as np
import stable_baselines3
import torch
from torch import nn
from torch.utils.tensorboard import SummaryWriter

import ikgym
from baselines.agents.files import save_agent
from baselines.evaluation.metrics import describe
from baselines.files import locked, write_json
from baselines.fingerprints import fingerprint
from baselines.training.config import APG, TrainingError
from baselines.training.folder import FORMAT, Checkpoint, Folder
from baselines.training.randomness import deterministic_torch, reseed
from baselines.training.trainer import SegmentMetrics, Trainer
from baselines.training.validation import Score, bound, validated

#: Weights above this have diverged.
LARGEST = 1e9

#: Called after each segment with the number of segments done, and the score if there was a validation.
OnSegment = Callable[[int, Score | None], object]


def train(
    config: APG,
    seed: int,
    path: pathlib.Path,
    *,
    resume: bool = False,
    overwrite: bool = False,
    checkpoint_every: float = 0.0,
    command: str = "baselines.training.run.train(…)",
    on_segment: OnSegment | None = None,
) -> dict[str, Any]:
    """Trains an agent; returns the content of `run.json`.

    Args:
        config: The options.
        seed: Determines all randomness.
        path: The folder of the run, see :mod:`baselines.training.folder`.
        resume: Whether to continue the run in the folder, if there is one.
        overwrite: Whether to replace the run in the folder.
        checkpoint_every: Shortest time between two checkpoints, in [s].
        command: The command that started the run, for `run.json`.
        on_segment: See :data:`OnSegment`.

    Raises:
        IkgymError: Training, validation or a file failed.
    """
    with locked(path), deterministic_torch():
        run = _Run(config, seed, Folder(path), command)
        run.begin(resume=resume, overwrite=overwrite)
        return run.go(checkpoint_every, on_segment)


class _Run:
    def __init__(self, config: APG, seed: int, folder: Folder, command: str) -> None:
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
            "scenario": {
                "name": self._scenario.name,
                "steps": self._scenario.steps,
                "fingerprint": fingerprint(self._scenario),
            },
            "versions": versions(),
            "machine": describe(),
        }

    def begin(self, *, resume: bool, overwrite: bool) -> None:
        identity = {part: self._about[part] for part in ("method", "seed", "config", "scenario", "versions")}
        reseed(self._seed, None)
        self._trainer = Trainer(self._config, self._scenario, self._seed)
        bound(self._trainer.agent(), self._scenario)  # whatever is refused, is refused before files are replaced
        there = self._folder.prepare(identity, resume=resume, overwrite=overwrite)
        if there is not None:
            self._about["command"] = there.get("command", self._about["command"])
            if self._folder.checkpoint.exists():
                self._at = Checkpoint.load(self._folder.checkpoint)
                if self._at.trainer is not None:
                    self._trainer.restore(self._at.trainer)
        write_json(self._folder.run, self._content())

    def go(self, checkpoint_every: float, on_segment: OnSegment | None) -> dict[str, Any]:
        # A killed run may have logged rows after its last checkpoint, which are purged.
        purge = self._trainer.steps + 1 if self._at.history else None
        with SummaryWriter(str(self._folder.tensorboard), purge_step=purge) as board:
            if not self._at.history:
                self._note(0, {}, board)
            saved = -math.inf
            while self._at.segments < self._config.segments:
                number = self._at.segments
                reseed(self._seed, number)
                metrics = self._segment(number)
                self._at.segments = number + 1
                score = self._note(number + 1, metrics, board)
                if self._at.segments == self._config.segments or time.monotonic() - saved >= checkpoint_every:
                    self._save()
                    saved = time.monotonic()
                if on_segment is not None:
                    on_segment(self._at.segments, score)
        return self._finish()

    def _segment(self, number: int) -> SegmentMetrics:
        """A segment of the trainer, with a clear message if its weights diverge."""
        try:
            metrics = self._trainer.segment(number)
        except (ValueError, RuntimeError):
            if _finite(self._trainer.policy):
                raise
        else:
            if _finite(self._trainer.policy):
                return metrics
        raise TrainingError(
            f"The weights diverged in segment {number + 1}: try a lower learning rate, or another seed."
        )

    def _note(self, done: int, metrics: SegmentMetrics, board: SummaryWriter) -> Score | None:
        """Adds a row to the history, with a score if a validation is due, and with the computing time so far."""
        config, trainer = self._config, self._trainer
        row: dict[str, Any] = {"segment": done, "steps": trainer.steps}
        row.update({name: value for name, value in metrics.items() if math.isfinite(value)})
        score = None
        if done % config.evaluate_every == 0 or done == config.segments:
            score = validated(bound(trainer.agent(), self._scenario), self._scenario, config.validation_episodes)
            row["validation"] = vars(score)
            if self._at.best is None or score.cost < self._at.best["score"]["cost"]:
                weights = {name: tensor.clone() for name, tensor in trainer.policy.state_dict().items()}
                self._at.best = {"segment": done, "score": vars(score), "policy": weights}
        for name, value in [*row.items(), *(vars(score) if score else {}).items()]:
            if isinstance(value, float):
                board.add_scalar(name if "/" in name else f"validation/{name}", value, trainer.steps)
        clock, core = time.monotonic(), time.process_time()
        self._at.wall_seconds += clock - self._clock
        self._at.core_seconds += core - self._core
        self._clock, self._core = clock, core
        row["core_minutes"] = self._at.core_seconds / 60.0
        self._at.history.append(row)
        return score

    def _save(self) -> None:
        self._at.trainer = self._trainer.state()
        self._at.save(self._folder.checkpoint)
        write_json(self._folder.history, self._at.history)
        write_json(self._folder.run, self._content())

    def _finish(self) -> dict[str, Any]:
        """Writes the agent and the result of the run."""
        policy, best = self._trainer.policy, self._at.best
        assert best is not None  # the untrained agent is validated at the latest
        self._about["status"] = "finished"
        self._about["weights_sha256"] = weights_hash(policy)
        policy.load_state_dict(best["policy"])
        kept = {"segment": best["segment"], "by": "validation", "weights_sha256": weights_hash(policy)}
        self._about["kept"] = {**kept, "validation": best["score"]}
        content = self._content()
        training = {name: content[name] for name in ("method", "seed", "training", "kept", "versions")}
        save_agent(self._folder.agent, self._trainer.agent(training))
        # A run that was killed after its last checkpoint and before its history lacks the last row.
        write_json(self._folder.history, self._at.history)
        write_json(self._folder.run, content)
        return content

    def _content(self) -> dict[str, Any]:
        """The content of `run.json`."""
        times = ("segment", "steps", "core_minutes")
        return {
            **self._about,
            "training": {
                "segments": self._at.segments,
                "steps": self._trainer.steps,
                "core_minutes": self._at.core_seconds / 60.0,
                "wall_minutes": self._at.wall_seconds / 60.0,
            },
            "validation": [
                {name: row[name] for name in times} | row["validation"]
                for row in self._at.history
                if "validation" in row
            ],
        }


def versions() -> dict[str, str]:
    """The versions that a result depends on."""
    modules = (ikgym, np, numba, gymnasium, torch, stable_baselines3)
    return {"python": platform.python_version(), **{module.__name__: module.__version__ for module in modules}}


def weights_hash(policy: nn.Module) -> str:
    """SHA-256 of all weights of a module."""
    digest = hashlib.sha256()
    for name, tensor in sorted(policy.state_dict().items()):
        array = np.ascontiguousarray(tensor.detach().cpu().numpy())
        digest.update(f"{name} {array.dtype} {array.shape} ".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _finite(policy: nn.Module) -> bool:
    """Whether no weight has diverged."""
    return all(bool((parameter.detach().abs() < LARGEST).all()) for parameter in policy.parameters())
