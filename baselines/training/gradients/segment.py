"""Kernel: some steps of N arms under the bilinear law with constant (G, h) and feedback at every step."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.agents.bilinear.kernels import joint_command
from ikgym.kernels import cost as cost_kernels
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, kernel
from ikgym.kernels.kinematics import forward
from ikgym.kernels.limits import LOWER, UPPER, clip, limit_command, stop_at_limit
from ikgym.rl.twists import is_turned, turn, twist, twist_size

Floats = npt.NDArray[np.float64]


class Rows(NamedTuple):
    """The input of a segment.

    Attributes:
        nominal: Reference task coordinates after each of the K steps. Shape (N, K, m).
        counted: Whether the cost of each step counts. Shape (N, K).
        steps: Steps to make, at most K. Shape (N,).
        speed: s, see :mod:`baselines.agents.bilinear`. Shape (N,).
    """

    nominal: Floats
    counted: npt.NDArray[np.bool_]
    steps: npt.NDArray[np.int64]
    speed: Floats


class Path(NamedTuple):
    """The motion of the arms, as the adjoint needs it.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (N, K + 1, n).
        qdot: Joint velocities applied before them, in [rad/s] or [m/s]. Shape (N, K + 1, n).
        cost: The sum of the stage costs that count. Shape (N,).
        distance: The position error at the end in [m]. Shape (N,).
    """

    q: Floats
    qdot: Floats
    cost: Floats
    distance: Floats

    @classmethod
    def empty(cls, rows: int, steps: int, n: int) -> Path:
        """An uninitialised path of N arms and K steps."""
        q, qdot = np.empty((2, rows, steps + 1, n))
        return cls(q, qdot, np.empty(rows), np.empty(rows))


@kernel
def segment(model, rows, output, path, start, stop):
    """Moves arms.

    Args:
        model: See :class:`baselines.policy_kernels.Model`; limits of braking and jerk do not count.
        rows: A :class:`Rows`.
        output: (G, h) of each arm, see :func:`baselines.agents.bilinear.kernels.action_rows`. Shape (N, n (w + 1)).
        path: A :class:`Path` with the first `q` and `qdot`; receives everything else.
        start: The first row.
        stop: The row after the last.
    """
    chain, kind, cost, dt, velocity_limit, limits = model
    nominal, counted, steps, speed = rows
    q_path, qdot_path, total, distance = path
    prismatic, axis, m, n = chain.prismatic, chain.axes[0], nominal.shape[2], q_path.shape[2]
    turned, w, e = is_turned(kind, prismatic), twist_size(kind), task_kernels.error_size(kind, m)
    rotation, position, pose = np.empty((3, 3)), np.empty(3), np.empty(m)
    error, due, held = np.empty(max(e, 6)), np.empty(w), np.zeros((1, 3))
    for row in range(start, stop):
        total[row] = distance[row] = 0.0
        forward(chain, q_path[row, 0], rotation, position)
        task_kernels.coordinates(kind, rotation, position, pose)
        for t in range(steps[row]):
            target = nominal[row, t]
            q, qdot, reached, applied = q_path[row, t], qdot_path[row, t], q_path[row, t + 1], qdot_path[row, t + 1]
            twist(kind, target, pose, error, due)
            if turned:
                turn(axis, -q[0], due)
            for j in range(n):
                command = joint_command(output[row], j, due, speed[row], dt)
                applied[j] = limit_command(limits, j, clip(command, velocity_limit[j]), qdot[j], 0.0, held, 0)
                reached[j] = q[j] + dt * applied[j]
                if not limits[LOWER, j] <= reached[j] <= limits[UPPER, j]:
                    reached[j], applied[j] = stop_at_limit(limits, j, q[j], reached[j], dt)
            forward(chain, reached, rotation, position)
            task_kernels.coordinates(kind, rotation, position, pose)
            task_kernels.error(kind, target, pose, error[:e])
            if counted[row, t]:
                total[row] += cost_kernels.tracking(cost, error[:e]) + cost_kernels.velocity(cost, applied)
        if steps[row] > 0:
            distance[row] = missing(target, position)


@inlined
def missing(target, position):
    """The distance of a position from the last three of the reference task coordinates, in [m]."""
    m, square = target.shape[0], 0.0
    for i in range(3):
        difference = target[m - 3 + i] - position[i]
        square += difference * difference
    return math.sqrt(square)
