"""One episode: its random seeds, its record, and the sum of its costs."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

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
            :func:`ikgym.scenarios.contacts.pair_names`; -1 where nothing can meet. Shape (steps, 2).
        stopped: 1 where bodies have touched and the arm stands still, 0 elsewhere. Shape (steps,).
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


def add_up(costs: FloatArray) -> FloatArray:
    """Sums over the steps, the last axis, from left to right, as a loop over rewards does, bit for bit."""
    # NumPy's sum() goes pairwise and differs in the last bits.
    total: FloatArray = np.cumsum(costs, axis=-1)[..., -1]
    return total
