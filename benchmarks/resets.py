"""Resets of learning environments: random actions end episodes after some 60 steps."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.measuring import FULL, Effort, medians
from benchmarks.table import Table
from ikgym import rl

SCENARIO = "panda-random"
#: Steps after which the rows' episodes end out of step with each other.
MIXED = 200


def tables(effort: Effort = FULL) -> list[Table]:
    """Resets and steps of N arms."""
    sizes = (8, 64, 512) if effort is FULL else effort.rows
    times = medians({(n, name): call for n in sizes for name, call in calls(n).items()}, effort.rounds, effort.seconds)
    rows: dict[str, tuple[float | None, ...]] = {
        f"N = {n}": (
            times[n, "reset"] / times[n, "kept"],
            times[n, "lost"] / times[n, "kept"],
            1e-6 * n / times[n, "kept"],
            1e-6 * n / times[n, "lost"],
        )
        for n in sizes
    }
    columns = ("reset / step", "step, lost / kept", "kept [10⁶ steps/s]", "lost [10⁶ steps/s]")
    note = (
        f"`ikgym.rl.make_vec({SCENARIO!r}, N)` with random actions, medians: the time of a reset of all rows over that "
        "of a step of all; and steps where episodes end when the track is lost, beside those where they do not."
    )
    return [Table("Resets of learning environments", note, columns, rows), by_id(effort)]


def by_id(effort: Effort) -> Table:
    """Resets over steps of the environments by id."""
    sizes = (8, 64) if effort is FULL else effort.rows
    made: dict[tuple[str, int, str], Callable[[], object]] = {}
    for name, n in itertools.product(rl.IDS, sizes):
        envs = rl.IDS[name].arms(n, lost_distance=None)
        envs.reset(seed=0)
        still = np.zeros(envs.action_space.shape, dtype=np.float32)
        made |= {(name, n, "reset"): envs.reset, (name, n, "step"): functools.partial(envs.step, still)}
    times = medians(made, effort.rounds, effort.seconds)
    rows: dict[str, tuple[float | None, ...]] = {
        name: tuple(times[name, n, "reset"] / times[name, n, "step"] for n in sizes) for name in rl.IDS
    }
    note = "The time of a reset of all rows over that of a step of all, medians."
    return Table("Resets of environments by id", note, tuple(f"N = {n}" for n in sizes), rows)


def calls(n: int) -> dict[str, Callable[[], object]]:
    """A step where tracks are lost, one where they are kept, and a reset of all rows."""
    lost, kept = _stepping(n), _stepping(n, lost_distance=None)
    envs = rl.make_vec(SCENARIO, n, autoreset_mode="Disabled")
    envs.reset(seed=0)
    return {"lost": lost, "kept": kept, "reset": envs.reset}


def _stepping(n: int, **changes: Any) -> Callable[[], object]:
    envs: Any = rl.make_vec(SCENARIO, n, **changes)
    envs.reset(seed=0)
    actions = np.random.default_rng(0).normal(size=(MIXED, *envs.action_space.shape)).astype(np.float32)
    for action in actions:
        envs.step(action)
    count = iter(range(10**12))
    return lambda: envs.step(actions[next(count) % MIXED])
