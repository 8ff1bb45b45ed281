"""Infos of N arms after a step, in the layout of Gymnasium's vector environments."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.kernels.outcome import Observation, Outcome
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray

#: Keys of numbers, in the order of an outcome, from the tracking cost on.
NUMBERS = ("tracking_cost", "velocity_cost", "position_error", "orientation_error")

Infos = dict[str, Any]


def infos_of(out: Outcome, rows: BoolArray, made: npt.NDArray[np.int64], scenario: Scenario) -> Infos:
    """The infos of some rows; zero in the others.

    Args:
        out: After a step.
        rows: Which rows. Shape (N,).
        made: Steps made in the episodes. Shape (N,).
        scenario: The tracking problem.
    """
    if not rows.any():
        return {}
    numbers = np.where(rows, np.stack([getattr(out, key) for key in NUMBERS]), 0.0)
    infos: Infos = dict(zip(NUMBERS, numbers, strict=True))
    if not scenario.task.has_orientation:
        del infos["orientation_error"]
    infos["clipped"] = (out.clipped > 0.0) & rows
    infos["time"] = np.where(rows, made * scenario.dt, 0.0)
    infos["at_limit"] = np.zeros(out.at_limit.shape, dtype=np.int64)
    if scenario.arm.limited:
        infos["at_limit"] += (out.at_limit * rows[:, None]).astype(np.int64)
    for key in tuple(infos):
        infos[f"_{key}"] = rows.copy()
    return infos


def last_observations(seen: Observation, rows: BoolArray) -> npt.NDArray[np.object_]:
    """One observation a row, in the layout of `final_obs`; None in the other rows.

    Args:
        seen: The observation of all rows.
        rows: Which rows. Shape (N,).
    """
    out = np.full(len(rows), None, dtype=object)
    for row in np.flatnonzero(rows):
        out[row] = {key: value[row].copy() for key, value in seen.items()}
    return out
