"""Kernel: one step of N arms.

Everything that happens in a step happens here, row by row, so that one environment, many of them in a loop and the
native vector environment agree bit for bit, whatever the number of threads.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym import cost_kernels, task_kernels
from ikgym.axis_kernels import angle_between
from ikgym.cost_kernels import CostParameters
from ikgym.jit import inlined, kernel
from ikgym.kinematics import Chain, forward
from ikgym.limit_kernels import LOWER, SLACK, UPPER, driven, stopped
from ikgym.random_numbers import uniform
from ikgym.rotations import geodesic_angle

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]

# The rows of a disturbance, see :class:`Constants`.
BIAS, NOISE = range(2)


class Constants(NamedTuple):
    """What is the same in all rows and at all times.

    Attributes:
        kind: The kind of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        velocity_limit: What an action of 1 means, in [rad/s] or [m/s]. Shape (n,).
        steps: Steps of an episode.
        point: Where the nominal point that is the target after k steps is among the state's frames.
            Shape (steps + furthest preview + 1,).
        counted: Whether costs count at the k-th step, that is whether it is the last of its point.
            Shape (steps + 1,).
        preview: How many steps ahead the nominal coordinates are shown. Shape (p,).
        disturbance: What is added to the joint velocity, in [rad/s] or [m/s]: a constant, and the bound of a uniform
            random part. Shape (2, n).
        limits: What :func:`ikgym.arms.limits.limit_rows` gives. Shape (4, n), or (0, n) where there are none.
    """

    kind: int
    dt: float
    velocity_limit: Floats
    steps: int
    point: Integers
    counted: Flags
    preview: Integers
    disturbance: Floats
    limits: Floats


class State(NamedTuple):
    """Where the N arms are, and where they are told to go.

    Attributes:
        actions: Joint velocities as fractions of the velocity limit, finite. Shape (N, n).
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
        step: Steps made in the episode. Shape (N,).
        frames: Nominal frames of the rows' episodes, or those that are near, see :mod:`ikgym.task_kernels`; shared
            where the first length is 1. Shape (N or 1, points, 12 or 3).
        noise_key: Key of the row's random disturbance. Shape (N,).
        scratch: What a call of the kernel works with: a frame, nominal task coordinates and their error, at its
            first row. Shape (N, 12 + m + e).
    """

    actions: Floats
    q: Floats
    qdot: Floats
    step: Integers
    frames: Floats
    noise_key: npt.NDArray[np.uint64]
    scratch: Floats


class Outcome(NamedTuple):
    """What the N arms show after a step: the observation, then what the step cost.

    Attributes:
        numbers: All of it in one block, which the others are views of; see :func:`outcome`.
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
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


def outcome(numbers: Floats, rows: int, n: int, m: int, p: int) -> Outcome:
    """The parts of an outcome as views of one block of numbers, as each step fills a fresh one.

    One block, since to allocate ten arrays and to hand them to a kernel takes longer than what the kernel does.

    Args:
        numbers: The block. Shape (N (2 n + m + p m + 9),).
        rows: N.
        n: Joints of the arm.
        m: Task coordinates.
        p: Steps ahead that are shown.
    """
    qdot = rows * n
    pose = qdot + rows * n
    nominal = pose + rows * m
    remaining = nominal + rows * p * m
    reward = remaining + rows
    return Outcome(
        numbers,
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
        numbers[reward + 5 * rows :].reshape(rows, 3),
    )


_outcome = inlined(outcome)


@kernel
def first_not_finite(actions, active):
    """The first active row of ``actions`` (N, n) with a NaN or an infinity, or -1."""
    for row in range(actions.shape[0]):
        if active[row]:
            for j in range(actions.shape[1]):
                if not math.isfinite(actions[row, j]):
                    return row
    return -1


@kernel
def step(
    # Chain.
    offsets,
    axes,
    prismatic,
    tool,
    tool_rotation,
    # Constants.
    kind,
    dt,
    velocity_limit,
    steps,
    point,
    counted,
    preview,
    disturbance,
    limits,
    # CostParameters.
    delta_x,
    p_x,
    delta_qdot,
    p_out,
    p_in,
    # State, changed in place.
    actions,
    q,
    qdot,
    made,
    tables,
    noise_key,
    scratch,
    # What is asked for.
    numbers,
    active,
    moving,
    start,
    stop,
):
    """Moves rows, and observes them.

    The arguments are the parts of :class:`Chain`, :class:`Constants`, :class:`CostParameters` and :class:`State`; then
    the block of an outcome, written in place; the rows that are meant, of shape (N,); whether they move or are observed
    where they are; the first row, and the row after the last.

    The tuples are taken apart by the caller, since this is called once a step: a call with 32 values takes 3.5 µs, with
    the same values in four named tuples 8.2 µs (medians on one machine, by empty kernels). And numba counts references
    at each access to a part of a tuple, which in the loop over rows takes longer than the kinematics.
    """
    chain = Chain(offsets, axes, prismatic, tool, tool_rotation)
    cost = CostParameters(delta_x, p_x, delta_qdot, p_out, p_in)
    rows, n = q.shape
    p, width = preview.shape[0], tables.shape[2]
    m = (numbers.shape[0] // rows - 2 * n - 9) // (p + 1)
    out = _outcome(numbers, rows, n, m, p)
    seen_q, seen_qdot, seen_pose, seen_nominal, remaining = out.q, out.qdot, out.pose, out.nominal, out.remaining
    tracking_cost, velocity_cost, clipped = out.tracking_cost, out.velocity_cost, out.clipped
    position_error, orientation_error, at_limit = out.position_error, out.orientation_error, out.at_limit
    limited = limits.shape[0] > 0
    # Each call has the scratch of its first row to itself.
    rotation, position = scratch[start, :9].reshape(3, 3), scratch[start, 9:12]
    nominal, error = scratch[start, 12 : 12 + m], scratch[start, 12 + m :]
    for row in range(start, stop):
        if not active[row]:
            continue
        clipped[row] = 0.0
        at_limit[row, 0] = at_limit[row, 1] = at_limit[row, 2] = 0.0
        if moving:
            for j in range(n):
                action = actions[row, j]
                if abs(action) > 1.0:
                    clipped[row] = 1.0
                    action = math.copysign(1.0, action)
                applied = action * velocity_limit[j]
                if limited:
                    slack = SLACK * velocity_limit[j]
                    applied = driven(limits, j, applied, qdot[row, j], slack, at_limit, row)
                velocity = applied
                if disturbance[BIAS, j] != 0.0:
                    velocity += disturbance[BIAS, j]
                if disturbance[NOISE, j] != 0.0:
                    velocity += disturbance[NOISE, j] * uniform(noise_key[row], np.uint64(made[row] * n + j))
                reached = q[row, j] + dt * velocity  # Varga 2021, eq. 5
                if limited and not limits[LOWER, j] <= reached <= limits[UPPER, j]:
                    reached, applied = stopped(limits, j, q[row, j], reached, dt)
                    at_limit[row, 0] += abs(velocity - applied) > slack
                q[row, j], qdot[row, j] = reached, applied
            made[row] += 1
        k = made[row]
        for j in range(n):
            seen_q[row, j] = q[row, j]
            seen_qdot[row, j] = qdot[row, j]
        forward(chain, q[row], rotation, position)
        pose = seen_pose[row]
        task_kernels.coordinates(kind, rotation, position, pose)

        frames = tables[row if tables.shape[0] > 1 else 0]
        for i in range(p):
            task_kernels.frame_coordinates(kind, frames[point[k + preview[i]]], seen_nominal[row, i])
        remaining[row, 0] = steps - k

        frame = frames[point[k]]
        square = 0.0
        for i in range(3):
            missing = frame[width - 3 + i] - position[i]
            square += missing * missing
        position_error[row] = math.sqrt(square)
        if kind == task_kernels.POSITION:
            orientation_error[row] = math.nan
        elif kind == task_kernels.AXIS:
            orientation_error[row] = angle_between(
                rotation[0, 2], rotation[1, 2], rotation[2, 2], frame[2], frame[5], frame[8]
            )
        else:
            orientation_error[row] = geodesic_angle(rotation, frame[:9].reshape(3, 3))

        tracking_cost[row] = 0.0
        velocity_cost[row] = 0.0
        if counted[k]:
            task_kernels.frame_coordinates(kind, frame, nominal)
            task_kernels.error(kind, nominal, pose, error)
            tracking_cost[row] = cost_kernels.tracking(cost, error)
            velocity_cost[row] = cost_kernels.velocity(cost, qdot[row])


@kernel
def nominal_rows(kind, frames, out):
    """Task coordinates of frames: ``frames`` (k, 12 or 3), ``out`` (k, m)."""
    for row in range(frames.shape[0]):
        task_kernels.frame_coordinates(kind, frames[row], out[row])
