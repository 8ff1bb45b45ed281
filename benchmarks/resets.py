"""Resets of the environments by id."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Callable

import numpy as np

from benchmarks.measuring import FULL, Effort, medians
from benchmarks.table import Table
from ikgym import rl


def tables(effort: Effort = FULL) -> list[Table]:
    """Resets over steps, a row each environment."""
    sizes = (8, 64, 512) if effort is FULL else effort.rows
    made: dict[tuple[str, int, str], Callable[[], object]] = {}
    for name, n in itertools.product(rl.IDS, sizes):
        envs = rl.IDS[name].arms(n, lost_distance=None)
        envs.reset(seed=0)
        still = np.zeros((n, envs.scenario.joints), dtype=np.float32)
        made |= {(name, n, "reset"): envs.reset, (name, n, "step"): functools.partial(envs.step, still)}
    times = medians(made, effort.rounds, effort.seconds)
    rows: dict[str, tuple[float | None, ...]] = {
        name: tuple(times[name, n, "reset"] / times[name, n, "step"] for n in sizes) for name in rl.IDS
    }
    note = "The time of a reset of all rows over that of a step of all, medians."
    return [Table("Resets of environments by id", note, tuple(f"N = {n}" for n in sizes), rows)]
