"""Infos of the rows of a vector environment, as Gymnasium lays them out."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.kernels.outcome import Observation, Outcome
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray

#: Keys of numbers, in the order of an outcome, from the tracking cost on.
NUMBERS = ("tracking_cost", "velocity_cost", "position_error", "orientation_error")

Infos = dict[str, Any]


class Hinting(type):
    """Adds a hint to the class in f-strings: Stable-Baselines3 shows no more of an environment that it refuses."""

    def __format__(cls, _: str) -> str:
        return f"{repr(cls)[:-1]}; for Stable-Baselines3 there is ikgym.sb3.RedundantIKVecEnv>"


def contexts(context: FloatArray, rows: BoolArray) -> Infos:
    """Infos of some rows whose episodes have begun; zero in the others. Shapes (N, c) and (N,)."""
    return {"context": np.where(rows[:, None], context, 0.0), "_context": rows.copy()} if context.size else {}


def infos_of(out: Outcome, rows: BoolArray, made: npt.NDArray[np.int64], scenario: Scenario) -> Infos:
    """The infos of some rows after a step; zero in the others. Shapes (N,)."""
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
    if scenario.collides:
        infos["clearance"], infos["collision"] = np.where(rows, out.clearance, 0.0), (out.stopped > 0.0) & rows
    if scenario.proximity is not None:
        infos["proximity_cost"] = np.where(rows, out.proximity_cost, 0.0)
    for key in tuple(infos):
        infos[f"_{key}"] = rows.copy()
    return infos


def lost_rows(out: Outcome, lost_distance: float | None) -> BoolArray:
    """Rows that have lost their track, or whose bodies have touched; none without a distance in [m]. Shape (N,)."""
    if lost_distance is None:
        return np.zeros(len(out.position_error), dtype=np.bool_)
    lost: BoolArray = out.position_error > lost_distance
    return lost | (out.stopped > 0.0) if out.stopped.size else lost


def last_observations(seen: Observation, rows: BoolArray) -> npt.NDArray[np.object_]:
    """One observation a row, in the layout of `final_obs`; None in the other rows. Shape (N,)."""
    out = np.full(len(rows), None, dtype=object)
    for row in np.flatnonzero(rows):
        out[row] = {key: value[row].copy() for key, value in seen.items()}
    return out
