"""Rows of a vector environment: one as a single environment, and infos of all as Gymnasium lays them out."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.env import RedundantIKEnv
from ikgym.exceptions import NoAttributeError
from ikgym.kernels.outcome import Observation, Outcome
from ikgym.scenarios import Scenario
from ikgym.validation import BoolArray, FloatArray

#: Keys of numbers, in the order of an outcome, from the tracking cost on.
NUMBERS = ("tracking_cost", "velocity_cost", "position_error", "orientation_error")

Infos = dict[str, Any]

#: Attributes that every row has, from the vector environment and the number of the row.
_SHARED: dict[str, Callable[[Any, int], Any]] = {
    "scenario": lambda envs, _: envs.scenario,
    "observation_space": lambda envs, _: envs.single_observation_space,
    "action_space": lambda envs, _: envs.single_action_space,
    "metadata": lambda *_: RedundantIKEnv.metadata,
    "render_mode": lambda envs, _: envs.render_mode,
    "np_random": lambda envs, row: envs.generator(row)[0],
    "np_random_seed": lambda envs, row: envs.generator(row)[1],
}
_OWN = ("_envs", "_index")


class Hinting(type):
    """Adds a hint to the class name, which is all that Stable-Baselines3 shows of an environment that it refuses."""

    def __repr__(cls) -> str:
        return f"{super().__repr__()[:-1]}; for Stable-Baselines3 there is ikgym.sb3.RedundantIKVecEnv>"


class ArmRow:
    """Attributes of one of N arms: the shared ones, its generator, and those set by users."""

    def __init__(self, envs: Any, index: int) -> None:
        self.__dict__.update(_envs=envs, _index=index)

    def __getattr__(self, name: str) -> Any:
        if name in _SHARED:
            return _SHARED[name](self._envs, self._index)
        if name.startswith("__"):  # what copy and pickle ask for
            raise AttributeError(name)
        given = (one for one in self.__dict__ if one not in _OWN)
        raise NoAttributeError(
            f"The arms of a native vector environment have no {name!r}: they are reset, stepped and seen together. "
            f"Available: {', '.join((*_SHARED, *given))}. Environments one by one: gym.make_vec(…, "
            "vectorization_mode='sync')."
        )

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _SHARED or name in _OWN:
            raise NoAttributeError(f"{name!r} of one arm cannot be set: make another environment.")
        self.__dict__[name] = value


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
