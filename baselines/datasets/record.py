"""Episodes as a data set has them: what the policy saw, what it did, and what the environment said."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.episodes import TICK, Policy, Tick, check_finite, play
from baselines.evaluation.entrants import ForeignPolicy
from baselines.evaluation.plan import Job
from ikgym.outcome import Outcome, observation
from ikgym.preview import offsets

#: Arrays with an axis of episodes in front, by where they are in an episode, such as ``"observations/q"``.
Block = dict[str, npt.NDArray[Any]]

#: Bytes of a block, and its episodes, at most: it is in memory twice while it is written.
MOST_BYTES, MOST_EPISODES = 2**26, 64


def blocks(jobs: Sequence[Job]) -> list[Sequence[Job]]:
    """Episodes that are recorded, and written, together."""
    size = max(1, min(MOST_EPISODES, MOST_BYTES // _bytes(jobs[0])))
    return [jobs[first : first + size] for first in range(0, len(jobs), size)]


def _bytes(job: Job) -> int:
    """About what an episode takes."""
    n, m, ahead = job.scenario.joints, job.scenario.task.size, len(offsets(job.preview))
    return job.scenario.steps * 8 * (3 * n + m + ahead * m + 16)


def record(jobs: Sequence[Job], tick: Tick | None = None) -> Block:
    """Plays the jobs of one policy in one scenario, and keeps what happens.

    Args:
        jobs: One an episode.
        tick: See :data:`baselines.episodes.Tick`.

    Returns:
        `observations/KEY` of shape (N, steps + 1, …), the first one that of the reset; `actions` (N, steps, n) as
        float32, within their box; `rewards`, `infos/KEY` (N, steps, …).

    Raises:
        InvalidInputError: The policy refuses what it is shown, or chooses no action.
        ResultsError: The policy is no longer what it was when the jobs were planned.
    """
    first = jobs[0]
    policy = first.make()
    single = isinstance(policy, ForeignPolicy)
    if single or first.entrant.made_for_episodes(first.scenario):
        each = [_record([job], job.make(), tick, single=single) for job in jobs]
        return {key: np.concatenate([one[key] for one in each]) for key in each[0]}
    return _record(jobs, policy, tick, single=False)


def _record(jobs: Sequence[Job], policy: Policy, tick: Tick | None, *, single: bool) -> Block:
    scenario, draws, rows = jobs[0].scenario, [job.seeds for job in jobs], len(jobs)
    kept: Block = {}
    made, state = 0, None

    def keep(values: Mapping[str, npt.NDArray[Any]], steps: int = scenario.steps) -> None:
        for key, value in values.items():
            if key not in kept:
                kept[key] = np.empty((rows, steps, *value.shape[1:]), dtype=value.dtype)
            kept[key][:, made] = value

    def keep_seen(out: Outcome) -> None:
        keep({f"observations/{key}": value for key, value in observation(out).items()}, scenario.steps + 1)

    def act(out: Outcome) -> npt.NDArray[np.float32]:
        nonlocal state
        keep_seen(out)
        chosen, state = policy.predict(observation(out, 0 if single else None), state)
        check_finite(chosen, policy, scenario, draws, made)
        action = np.asarray(chosen, dtype=np.float32)
        keep({"actions": np.clip(action, -1.0, 1.0).reshape(rows, -1)})  # as the environment does, which says so
        return action

    commands = policy.commands
    for out in play(scenario, draws, act, preview=jobs[0].preview, single=single, commands=commands):
        keep({"rewards": -(out.tracking_cost + out.velocity_cost), **_infos(out, scenario.task.has_orientation)})
        keep({"infos/clipped": out.clipped > 0.0, "infos/time": np.full(rows, (made + 1) * scenario.dt)})
        made += 1
        if tick is not None and made % TICK == 0:
            tick(TICK * rows)
    keep_seen(out)
    if tick is not None:
        tick(scenario.steps % TICK * rows)
    return kept


def _infos(out: Outcome, has_orientation: bool) -> Block:
    """What `info` has of a step, see :class:`ikgym.env.RedundantIKEnv`."""
    names = ["tracking_cost", "velocity_cost", "position_error", *["orientation_error"] * has_orientation]
    infos = {f"infos/{name}": getattr(out, name) for name in names}
    return infos | {"infos/at_limit": out.at_limit.astype(np.int64)}
