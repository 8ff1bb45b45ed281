"""One episode: its random seeds, its record, and the sum of its costs."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy.arguments import Report
from ikgym.kernels.simulation import Outcome
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class Seeds(NamedTuple):
    """Random seeds of one episode.

    Attributes:
        seed: The reset seed: trajectory, plant, and everything that the others do not set.
        arm_seed: Arm and drives of the plant; those of the reset seed if None.
        noise_seed: Noise in sensors and drives; 0 is the noise of the reset seed. Policies that are compared get the
            same noise.
    """

    seed: int
    arm_seed: int | None = None
    noise_seed: int = 0

    @classmethod
    def of(cls, seed: int | Seeds) -> Seeds:
        """The seeds of a reset seed alone; seeds are returned as they are."""
        return seed if isinstance(seed, Seeds) else cls(seed)


#: Parts of an outcome that the record of an episode has under the same name.
_OUTCOME = ("qdot", "tracking_cost", "velocity_cost", "position_error", "orientation_error", "at_limit")


@dataclasses.dataclass(frozen=True, eq=False)
class Episode:
    """The record of one episode; row k belongs to step k, counted from 0.

    Args:
        q: True joint coordinates after the step, in [rad] or [m]. Shape (steps, n).
        qdot: Joint velocities applied, in [rad/s] or [m/s]. Shape (steps, n).
        pose: True task coordinates after the step. Shape (steps, m).
        tracking_cost: Φ^X, 0 where the step does not count. Shape (steps,).
        velocity_cost: Φ^U, 0 where the step does not count. Shape (steps,).
        position_error: In [m]. Shape (steps,).
        orientation_error: Geodesic angle in [rad], NaN where the task has no orientation. Shape (steps,).
        at_limit: Joints held back by a stop, by the velocity and by the acceleration limit. Shape (steps, 3).
        status: Values of :class:`baselines.Status`. Shape (steps,).
        iterations: Iterations of the policy. Shape (steps,).
        time_ns: Wall time of the call of `predict`, in [ns]. Shape (steps,), or (0,) where the calls were not timed.
        diagnostics: Diagnostics of the policy by name, see :meth:`SolverPolicy.diagnostics`; each of shape (steps, …).
        clearance: Smallest signed distance between bodies in [m]; None, like the next two, where the scenario has no
            collisions. Shape (steps,).
        pair: The closest pair, and the one that touched where the arm stops, see
            :meth:`ikgym.Scenario.pair_names`; -1 where nothing can meet. Shape (steps, 2).
        stopped: 1 where bodies have touched and the arm has stopped, 0 elsewhere. Shape (steps,).
        proximity_cost: Φ^C, 0 where the step does not count; None where the scenario has no such cost. Shape (steps,).
    """

    q: FloatArray
    qdot: FloatArray
    pose: FloatArray
    tracking_cost: FloatArray
    velocity_cost: FloatArray
    position_error: FloatArray
    orientation_error: FloatArray
    at_limit: FloatArray
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]
    time_ns: npt.NDArray[np.int64]
    diagnostics: dict[str, FloatArray]
    clearance: FloatArray | None = None
    pair: FloatArray | None = None
    stopped: FloatArray | None = None
    proximity_cost: FloatArray | None = None

    @property
    def cost(self) -> FloatArray:
        """The stage costs. Shape (steps,)."""
        cost: FloatArray = self.tracking_cost + self.velocity_cost
        return cost if self.proximity_cost is None else cost + self.proximity_cost


class Recording:
    """The record of episodes side by side, while they are played.

    Args:
        scenario: The scenario.
        rows: Number of episodes.

    Attributes:
        time_ns: Wall times of the calls of `predict`, in [ns], of one episode whose calls are timed.
    """

    def __init__(self, scenario: Scenario, rows: int) -> None:
        self._scenario, self._rows = scenario, rows
        self._record: dict[str, npt.NDArray[Any]] = {}
        self._diagnostics: dict[str, npt.NDArray[Any]] = {}
        self.time_ns: list[int] = []

    def keep(self, step: int, out: Outcome, report: Report, diagnostics: Mapping[str, npt.NDArray[Any]]) -> None:
        """Keeps the outcome of a step, counted from 0, and what the policy reports."""
        values = {name: getattr(out, name) for name in _OUTCOME}
        values |= {"q": out.true_q, "pose": out.true_pose, "status": report.status, "iterations": report.iterations}
        if self._scenario.collides:
            values |= {"clearance": out.clearance, "pair": out.pair, "stopped": out.stopped}
        if self._scenario.proximity is not None:
            values["proximity_cost"] = out.proximity_cost
        for into, arrays in ((self._record, values), (self._diagnostics, diagnostics)):
            for name, array in arrays.items():
                if name not in into:
                    into[name] = np.empty((self._rows, self._scenario.steps, *array.shape[1:]), dtype=array.dtype)
                into[name][:, step] = array

    def episodes(self) -> list[Episode]:
        """The episodes."""
        times = np.array(self.time_ns, dtype=np.int64)
        return [
            Episode(
                **{name: values[row] for name, values in self._record.items()},
                time_ns=times,
                diagnostics={name: values[row] for name, values in self._diagnostics.items()},
            )
            for row in range(self._rows)
        ]


def add_up(costs: FloatArray) -> FloatArray:
    """Sums over the steps, the last axis, from left to right, as a loop over rewards does, bit for bit."""
    # NumPy's sum() goes pairwise and differs in the last bits.
    total: FloatArray = np.cumsum(costs, axis=-1)[..., -1]
    return total
