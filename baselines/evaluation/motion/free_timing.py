"""Policies with free timing: their episodes continue to the end of the path, and are measured along it, too.

Costs, errors and times of a row remain those of the steps of the scenario.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from baselines.episodes import Episode, Policy, Seeds, Tick, rollouts
from ikgym.kernels.simulation import nominal_rows
from ikgym.kernels.tasks import AXIS, POSE
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import FloatArray

#: How many times as long as the scenario an episode may become; the numbers before are tried first.
LONGER = (1, 2, 4)


def play_to_end(
    scenario: Scenario,
    policy: Policy,
    seeds: Sequence[int | Seeds],
    preview: Preview,
    *,
    timed: bool,
    tick: Tick | None = None,
) -> list[Episode]:
    """Episodes that continue until the end of the path is reached, but at least for the steps of the scenario."""
    for factor in LONGER:
        longer = scenario.replace(steps=factor * scenario.steps)
        episodes = rollouts(longer, policy, seeds, preview=preview, timed=timed)
        if all(_end(scenario, episode) is not None for episode in episodes):
            break
    if tick is not None:
        tick(scenario.steps * len(seeds))
    return [first_steps(episode, _end(scenario, episode) or len(episode.q)) for episode in episodes]


def first_steps(episode: Episode, steps: int) -> Episode:
    """The beginning of an episode."""
    if len(episode.q) == steps:
        return episode
    arrays: dict[str, Any] = {
        name: values[:steps] for name, values in vars(episode).items() if isinstance(values, np.ndarray)
    }
    diagnostics = {name: values[:steps] for name, values in episode.diagnostics.items()}
    scenario = episode.scenario.replace(steps=steps)
    return dataclasses.replace(episode, **arrays, scenario=scenario, diagnostics=diagnostics)


def path_scores(scenario: Scenario, episode: Episode) -> dict[str, float | None]:
    """The columns of a row that state how the path was followed, see :class:`baselines.evaluation.metrics.Row`."""
    task, end = scenario.task, _end(scenario, episode)
    error = task.error(reference_at(scenario, episode.seeds, episode.diagnostics["progress"]), episode.pose)[:end]
    first = 0 if task.kind in (POSE, AXIS) else task.error_size - 3
    position, angles = error[:, first : first + 3], error[:, 3:] if task.kind in (POSE, AXIS) else None
    return {
        "path_time": None if end is None else end * scenario.dt,
        "path_position_error": float(np.linalg.norm(position, axis=1).max()),
        "path_orientation_error": None if angles is None else float(np.linalg.norm(angles, axis=1).max()),
    }


def reference_at(scenario: Scenario, seeds: Seeds, progress: FloatArray) -> FloatArray:
    """Task coordinates (k, m) of the reference after fractions of steps (k,)."""
    points = scenario.points(1)  # the end may be passed by a fraction of a step
    times = np.interp(progress, np.arange(len(points)), points) * scenario.dt
    frames = scenario.episode(seeds.seed).frames(times, scenario.model)
    frames = np.ascontiguousarray(frames if scenario.task.has_orientation else frames[:, -3:])
    out = np.empty((len(frames), scenario.task.size))
    nominal_rows(scenario.task.kind, frames, out)
    return out


def _end(scenario: Scenario, episode: Episode) -> int | None:
    """Steps after which the end of the path was reached; None if it was not."""
    reached = np.flatnonzero(episode.diagnostics["progress"] >= scenario.steps)
    return int(reached[0]) + 1 if len(reached) else None
