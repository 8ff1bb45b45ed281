"""Observation and cost of N arms after a step, in one block of numbers and as arrays."""

from __future__ import annotations

from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
#: Numbers of an obstacle, see :class:`ikgym.kernels.bodies.Surroundings`.
OBSTACLE = 16


class Outcome(NamedTuple):
    """Results of a step of N arms: the observation, then the costs.

    Attributes:
        numbers: All of it in one block, which the others are views of; see :func:`outcome`.
        q: Measured joint coordinates in [rad] or [m]. Shape (N, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
        pose: Measured task coordinates. Shape (N, m).
        nominal: Nominal task coordinates ahead. Shape (N, p, m).
        remaining: Steps left. Shape (N, 1).
        tracking_cost: Φ^X, 0 where the step does not count. Shape (N,).
        velocity_cost: Φ^U, 0 where the step does not count. Shape (N,).
        position_error: In [m]. Shape (N,).
        orientation_error: Geodesic angle in [rad], NaN where the task has no orientation. Shape (N,).
        clipped: 1 where the action left its box, 0 elsewhere. Shape (N,).
        at_limit: Joints held back by a stop, by the velocity and by the acceleration limit. Shape (N, 3).
        q_age: Steps since the joint coordinates were measured. Shape (N, 1), or (N, 0) where no sensor is late.
        pose_age: Steps since the pose was measured. Shape (N, 1), or (N, 0) where no sensor is late.
        commands: The last h commands within the velocity limit, newest first, in [rad/s] or [m/s]. Shape (N, h, n).
        true_q: Joint coordinates in [rad] or [m]. Shape (N, n).
        true_pose: Task coordinates. Shape (N, m).
        clearance: Smallest signed distance between bodies in [m]; infinite where nothing can meet. Shape (N,).
        stopped: 1 where bodies have touched and the arm has been stopped, 0 elsewhere. Shape (N,).
        pair: The nearest pair: a body, and another body or the number of bodies plus that of an obstacle; the pair that
            touched at the step of a stop; -1 where nothing can meet. Shape (N, 2).
        proximity_cost: Φ^C, 0 where the step does not count. Shape (N,), or (N, 0) where bodies cannot touch and the
            plant is ideal.
        obstacles: Obstacles as they will be after the coming step, see :class:`ikgym.kernels.bodies.Surroundings`.
            Shape (N, o, 16), or (N, 0, 16) where they are always the same.
    """

    numbers: Floats
    q: Floats
    qdot: Floats
    pose: Floats
    nominal: Floats
    remaining: Floats
    tracking_cost: Floats
    velocity_cost: Floats
    position_error: Floats
    orientation_error: Floats
    clipped: Floats
    at_limit: Floats
    q_age: Floats
    pose_age: Floats
    commands: Floats
    true_q: Floats
    true_pose: Floats
    clearance: Floats
    stopped: Floats
    pair: Floats
    proximity_cost: Floats
    obstacles: Floats

    @property
    def cost(self) -> Floats:
        """The stage cost: Φ^X, Φ^U and Φ^C. Shape (N,)."""
        cost = self.tracking_cost + self.velocity_cost
        return cost + self.proximity_cost if self.proximity_cost.size else cost


_named: Any = namedtuple  # the types are those of Outcome
#: Parts of an outcome: those of all scenarios, and those where the plant is not ideal or bodies can touch.
Shown, More = _named("Shown", Outcome._fields[1:12]), _named("More", Outcome._fields[12:])

#: The observation, see :func:`observation`.
Observation = dict[str, Floats]
#: Its keys in all scenarios.
OBSERVED = ("q", "qdot", "pose", "nominal", "remaining")
#: Its keys where there is something to show.
SOMETIMES = ("q_age", "pose_age", "commands", "obstacles")


def observation(out: Outcome, row: int | None = None) -> Observation:
    """The observation of all arms, or of one arm without a row axis."""
    keys = (*OBSERVED, *(key for key in SOMETIMES if getattr(out, key).size))
    return {key: getattr(out, key) if row is None else getattr(out, key)[row] for key in keys}


def outcome(
    numbers: Floats, rows: int, n: int, m: int, p: int, h: int | None = None, o: int = 0, *, late: bool = False
) -> Outcome:
    """The parts of an outcome as views of one block of numbers, as each step fills a fresh one.

    One block, since to allocate ten arrays and to hand them to a kernel takes longer than the kernel itself.

    Args:
        numbers: The block. Shape (N (2 n + m + p m + 9),), or (N (2 n + m + p m + 9 + 2 + h n + n + m + 5 + 16 o),)
            where the plant is not ideal or bodies can touch.
        rows: N.
        n: Joints of the arm.
        m: Task coordinates.
        p: Steps ahead that are shown.
        h: Commands that are shown; None where the plant is ideal, and measurements are true.
        o: Obstacles that are shown.
        late: Whether a measurement may be of an earlier step, so that its age is shown.
    """
    shown = parts(numbers, rows, n, m, p)
    none = numbers[:0].reshape(rows, 0)
    if h is None:
        commands, obstacles = none.reshape(rows, 0, n), none.reshape(rows, 0, OBSTACLE)
        return Outcome._make((numbers, *shown, none, none, commands, shown.q, shown.pose, *4 * [none], obstacles))
    more = more_parts(numbers[rows * size(n, m, p) :], rows, n, m, h, o)
    return Outcome._make((numbers, *shown, *(more if late else more._replace(q_age=none, pose_age=none))))


def size(n: int, m: int, p: int) -> int:
    """Numbers that a row shows where the plant is ideal."""
    return 2 * n + m + p * m + 9


def more_size(n: int, m: int, h: int, o: int) -> int:
    """Numbers that a row shows besides where the plant is not ideal, or bodies can touch."""
    return 2 + h * n + n + m + 5 + OBSTACLE * o


def parts(numbers: Floats, rows: int, n: int, m: int, p: int) -> Any:
    """The parts :class:`Shown` of a block, see :func:`outcome`."""
    qdot = rows * n
    pose = qdot + rows * n
    nominal = pose + rows * m
    remaining = nominal + rows * p * m
    reward = remaining + rows
    return Shown(
        numbers[:qdot].reshape(rows, n),
        numbers[qdot:pose].reshape(rows, n),
        numbers[pose:nominal].reshape(rows, m),
        numbers[nominal:remaining].reshape(rows, p, m),
        numbers[remaining:reward].reshape(rows, 1),
        numbers[reward : reward + rows],
        numbers[reward + rows : reward + 2 * rows],
        numbers[reward + 2 * rows : reward + 3 * rows],
        numbers[reward + 3 * rows : reward + 4 * rows],
        numbers[reward + 4 * rows : reward + 5 * rows],
        numbers[reward + 5 * rows : reward + 8 * rows].reshape(rows, 3),
    )


def more_parts(numbers: Floats, rows: int, n: int, m: int, h: int, o: int) -> Any:
    """The parts :class:`More` of the rest of a block, see :func:`outcome`."""
    commands = 2 * rows
    true_q = commands + rows * h * n
    true_pose = true_q + rows * n
    clearance = true_pose + rows * m
    obstacles = clearance + 5 * rows
    return More(
        numbers[:rows].reshape(rows, 1),
        numbers[rows:commands].reshape(rows, 1),
        numbers[commands:true_q].reshape(rows, h, n),
        numbers[true_q:true_pose].reshape(rows, n),
        numbers[true_pose:clearance].reshape(rows, m),
        numbers[clearance : clearance + rows],
        numbers[clearance + rows : clearance + 2 * rows],
        numbers[clearance + 2 * rows : clearance + 4 * rows].reshape(rows, 2),
        numbers[clearance + 4 * rows : obstacles],
        numbers[obstacles : obstacles + rows * o * OBSTACLE].reshape(rows, o, OBSTACLE),
    )
