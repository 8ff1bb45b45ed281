"""Runs of apg: each in one folder, killed at any moment and resumed.

| file | content |
|---|---|
| `run.json` | options, seed, versions, machine, a row for each segment, and in the end the hash of the final weights |
| `checkpoint.pt` | the state to resume from, behind its SHA-256 |
| `events.out.tfevents.apg` | the rows, for TensorBoard |
| `agent.safetensors` | in the end: the agent, a policy of :mod:`baselines` |
"""

from __future__ import annotations

import hashlib
import io
import math
import pathlib
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numba
import numpy as np
import stable_baselines3
import torch
from tensorboard.compat.proto.event_pb2 import Event
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter
from torch import nn

import ikgym
from baselines.agents.files import AgentFile, save_agent
from baselines.agents.policy import Agent
from baselines.episodes import Policy, add_up, rollouts
from baselines.evaluation.metrics import describe, lost
from baselines.files import read_bytes, read_resumable, reading, write, write_json
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.policy import Problem
from baselines.statistics import geometric_mean
from baselines.training.apg import Trainer
from baselines.training.options import APG, TrainingError
from ikgym import scenarios
from ikgym.scenarios import Scenario

#: The version of `run.json` and of `checkpoint.pt`.
FORMAT = 4
RUN, CHECKPOINT, AGENT, EVENTS = "run.json", "checkpoint.pt", "agent.safetensors", "events.out.tfevents.apg"
#: Shortest time between two checkpoints in [s].
CHECKPOINT_EVERY = 15.0
#: Weights above this have diverged.
LARGEST = 1e9

#: Called after each segment with the number of segments done, and the cost if there was a validation.
OnSegment = Callable[[int, float | None], object]


def train(
    config: APG,
    seed: int,
    folder: pathlib.Path,
    *,
    command: str = "baselines.training.run.train(…)",
    on_segment: OnSegment | None = None,
) -> dict[str, Any]:
    """Trains an agent, or continues the run in the folder; PyTorch uses one thread from then on.

    Args:
        config: The options.
        seed: Determines all randomness.
        folder: The folder of the run; the caller has locked it.
        command: The command that started the run, for `run.json`.
        on_segment: See :data:`OnSegment`.

    Returns:
        The content of `run.json`.

    Raises:
        IkgymError: There is another run in the folder; training, validation or a file failed.
    """
    torch.set_num_threads(1)
    run = _Run(config, seed, folder, command)
    run.begin()
    run.learn(on_segment)
    return run.finish()


def read_finished(config: APG, seed: int, folder: pathlib.Path) -> dict[str, Any] | None:
    """The `run.json` in a folder, if the same run has ended there.

    Raises:
        ResultsError: There is another run.
    """
    there = read_resumable(folder / RUN, identity(config, seed))
    return there if there is not None and there.get("status") == "finished" else None


def identity(config: APG, seed: int) -> dict[str, Any]:
    """All that the result of a run depends on, for `run.json`."""
    scenario = config.make_scenario()
    return {
        "format": FORMAT,
        "method": "apg",
        "seed": seed,
        "config": config.to_json(),
        "scenario": {"name": scenario.name, "steps": scenario.steps, "fingerprint": fingerprint(scenario)},
        "versions": versions(),
    }


class _Run:
    def __init__(self, config: APG, seed: int, folder: pathlib.Path, command: str) -> None:
        self._config, self._folder, self._scenario = config, folder, config.make_scenario()
        self._identity = identity(config, seed)
        self._about = {**self._identity, "status": "running", "command": command, "machine": describe()}
        self._trainer = Trainer(config, self._scenario, seed)
        self._segments, self._history, self._best = 0, list[dict[str, Any]](), dict[str, Any]()
        self._core_seconds, self._clock = 0.0, time.process_time()

    def begin(self) -> None:
        """Prepares the folder, and restores the state of the run in it, if there is one."""
        policy_of(self._trainer.agent(), self._scenario)  # what is refused is refused before files are replaced
        manifest, checkpoint = self._folder / RUN, self._folder / CHECKPOINT
        there = read_resumable(manifest, self._identity)
        if there is None:
            clear(self._folder)
        else:
            self._about["command"] = there.get("command", self._about["command"])
        for draft in self._folder.glob(".*.tmp"):  # of a run that was killed while writing
            draft.unlink(missing_ok=True)
        if there is not None and checkpoint.exists():
            state = load_checkpoint(checkpoint)
            self._trainer.restore(state["trainer"])
            self._segments, self._history, self._best = state["segments"], state["history"], state["best"]
            self._core_seconds = state["core_seconds"]
        write_json(manifest, self._content())

    def learn(self, on_segment: OnSegment | None) -> None:
        """Trains the segments that are left."""
        if not self._history:
            self._note({})
        saved = -math.inf
        while self._segments < self._config.segments:
            metrics = self._segment()
            self._segments += 1
            cost = self._note(metrics)
            if self._segments == self._config.segments or time.monotonic() - saved >= CHECKPOINT_EVERY:
                self._save()
                saved = time.monotonic()
            if on_segment is not None:
                on_segment(self._segments, cost)

    def finish(self) -> dict[str, Any]:
        """Writes the agent with the least cost, and the result of the run, which it returns."""
        policy = self._trainer.policy
        self._about |= {"status": "finished", "weights_sha256": weights_hash(policy)}
        policy.load_state_dict(self._best.pop("policy"))
        self._about["kept"] = {**self._best, "weights_sha256": weights_hash(policy)}
        content = self._content()
        training = {name: content[name] for name in ("method", "seed", "training", "kept", "versions")}
        save_agent(self._folder / AGENT, self._trainer.agent(training))
        write(self._folder / EVENTS, events(self._history))
        write_json(self._folder / RUN, content)
        return content

    def _segment(self) -> dict[str, float]:
        """A segment of the trainer, with a clear message if its weights diverge."""
        try:
            metrics = self._trainer.segment(self._segments)
        except (ValueError, RuntimeError):
            if _finite(self._trainer.policy):
                raise
        else:
            if _finite(self._trainer.policy):
                return metrics
        raise TrainingError(
            f"The weights diverged in segment {self._segments + 1}: try a lower learning rate, or another seed."
        )

    def _note(self, metrics: Mapping[str, float]) -> float | None:
        """Adds a row to the history, with a score if a validation is due; returns the cost in it."""
        config, trainer, done, score = self._config, self._trainer, self._segments, dict[str, float]()
        if done % config.evaluate_every == 0 or done == config.segments:
            policy = policy_of(trainer.agent(), self._scenario)
            score = validate(policy, self._scenario, config.validation_episodes)
            if not self._best or score["cost"] < self._best["cost"]:
                weights = {name: tensor.clone() for name, tensor in trainer.policy.state_dict().items()}
                self._best = {"segment": done, **score, "policy": weights}
        now = time.process_time()
        self._core_seconds, self._clock = self._core_seconds + now - self._clock, now
        numbers = {name: value for name, value in metrics.items() if math.isfinite(value)}
        numbers |= {f"validation/{name}": value for name, value in score.items()}
        effort = {"segment": done, "steps": trainer.steps, "core_minutes": self._core_seconds / 60.0}
        self._history.append({**effort, **numbers})
        return score.get("cost")

    def _save(self) -> None:
        state = {"segments": self._segments, "history": self._history, "best": self._best}
        state |= {"trainer": self._trainer.state(), "core_seconds": self._core_seconds}
        save_checkpoint(self._folder / CHECKPOINT, state)
        write(self._folder / EVENTS, events(self._history))
        write_json(self._folder / RUN, self._content())

    def _content(self) -> dict[str, Any]:
        """The content of `run.json`."""
        effort = {"segments": self._segments, "steps": self._trainer.steps, "core_minutes": self._core_seconds / 60.0}
        return {**self._about, "training": effort, "history": self._history}


def validate(policy: Policy, scenario: Scenario, episodes: int) -> dict[str, float]:
    """Plays episodes of the split "validation", used neither for training nor for publication.

    Args:
        policy: The policy.
        scenario: The scenario; a deterministic one has one episode.
        episodes: Their number.

    Returns:
        `cost`, the geometric mean of the costs; `cost_ratio` likewise, left out where a best known cost is missing;
        `worst`, the largest ratio, or cost where there are none; `lost`, the share of episodes in which the arm lost
        track; `position_error_max_mm` and `orientation_error_max_mrad`, means of the largest errors of the episodes.
    """
    seeds = scenarios.seeds("validation", episodes if scenario.varies else 1)
    played = rollouts(scenario, policy, seeds)
    costs, known = np.array([add_up(episode.cost) for episode in played]), best_known.costs(scenario, seeds)
    score = {"cost": geometric_mean(costs)}
    if None not in known:
        costs /= np.array(known, dtype=np.float64)
        score["cost_ratio"] = geometric_mean(costs)
    errors = [float(episode.position_error.max()) for episode in played]
    angles = [float(np.nan_to_num(episode.orientation_error).max()) for episode in played]
    score |= {"worst": float(costs.max()), "lost": float(np.mean(list(map(lost, errors, angles))))}
    score["position_error_max_mm"] = 1e3 * float(np.mean(errors))
    if scenario.task.has_orientation:
        score["orientation_error_max_mrad"] = 1e3 * float(np.mean(angles))
    return score


def policy_of(agent: AgentFile, scenario: Scenario) -> Agent:
    """An agent as a policy for a scenario.

    Raises:
        IkgymError: The scenario does not fit the agent.
    """
    return Agent(Problem.of(scenario), given=agent)


def clear(folder: pathlib.Path) -> None:
    """Removes the files of a run, but no others."""
    # run.json first: without it, a folder after a kill is no run.
    for name in (RUN, CHECKPOINT, AGENT, EVENTS):
        (folder / name).unlink(missing_ok=True)


def events(history: Sequence[Mapping[str, float]]) -> bytes:
    """A file of TensorBoard with the rows of a history; its time is CPU time."""
    stream = io.BytesIO()
    writer = RecordWriter(stream)
    writer.write(Event(file_version="brain.Event:2").SerializeToString())
    for row in history:
        values = [Summary.Value(tag=name, simple_value=row[name]) for name in row if "/" in name]
        event = Event(wall_time=60.0 * row["core_minutes"], step=int(row["steps"]), summary=Summary(value=values))
        writer.write(event.SerializeToString())
    return stream.getvalue()


def save_checkpoint(file: pathlib.Path, state: Mapping[str, Any]) -> None:
    """Writes a state in one go, behind its SHA-256.

    Raises:
        ResultsError: The file cannot be written.
    """
    stream = io.BytesIO()
    torch.save({"format": FORMAT, **state}, stream)
    write(file, hashlib.sha256(stream.getvalue()).digest() + stream.getvalue())


def load_checkpoint(file: pathlib.Path) -> dict[str, Any]:
    """The state in a file.

    Raises:
        ResultsError: It cannot be read, is damaged, or has another format.
    """
    with reading(file, "Remove the folder to begin anew."):
        content = read_bytes(file)
        if hashlib.sha256(content[32:]).digest() != content[:32]:
            raise ValueError("its SHA-256 is another")
        state: dict[str, Any] = torch.load(io.BytesIO(content[32:]), map_location="cpu", weights_only=True)
        if state["format"] != FORMAT:
            raise ValueError("it has another format")
        return state


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
