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
from ikgym.cost_kernels import CostParameters
from ikgym.jit import inlined, kernel
from ikgym.kinematics import Chain, forward
from ikgym.rotations import geodesic_angle

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class Law(NamedTuple):
    """What is the same in all rows and at all times.

    Attributes:
        kind: The kind of task coordinates, see :mod:`ikgym.task_kernels`.
        dt: Δt in [s].
        velocity_limit: What an action of 1 means, in [rad/s] or [m/s]. Shape (n,).
        steps: Steps of an episode.
        point: Which nominal point is the target after k steps. Shape (steps + furthest preview + 1,).
        counted: Whether costs count at the k-th step, that is whether it is the last of its point.
            Shape (steps + 1,).
        preview: How many steps ahead the nominal coordinates are shown. Shape (p,).
        bias: Constant disturbance of the joint velocity, in [rad/s] or [m/s]. Shape (n,).
        noise: Bound of its uniform random disturbance, in [rad/s] or [m/s]. Shape (n,).
    """

    kind: int
    dt: float
    velocity_limit: Floats
    steps: int
    point: Integers
    counted: Flags
    preview: Integers
    bias: Floats
    noise: Floats


class State(NamedTuple):
    """Where the N arms are.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
        step: Steps made in the episode. Shape (N,).
        frames: Nominal frames of the rows' episodes, see :mod:`ikgym.task_kernels`; shared where the first
            length is 1. Shape (N or 1, points, 12 or 3).
        noise_key: Key of the row's random disturbance. Shape (N,).
    """

    q: Floats
    qdot: Floats
    step: Integers
    frames: Floats
    noise_key: npt.NDArray[np.uint64]


class Outcome(NamedTuple):
    """What the N arms show after a step: the observation, then what the step cost.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
        pose: Measured task coordinates. Shape (N, m).
        nominal: Nominal task coordinates ahead. Shape (N, p, m).
        remaining: Steps left. Shape (N, 1).
        tracking_cost: Φ^X, 0 where the step does not count. Shape (N,).
        velocity_cost: Φ^U, 0 where the step does not count. Shape (N,).
        position_error: In [m]. Shape (N,).
        orientation_error: Geodesic angle in [rad], NaN where the task has no orientation. Shape (N,).
        clipped: Whether the action left its box. Shape (N,).
    """

    q: Floats
    qdot: Floats
    pose: Floats
    nominal: Floats
    remaining: Floats
    tracking_cost: Floats
    velocity_cost: Floats
    position_error: Floats
    orientation_error: Floats
    clipped: Flags


@kernel
def first_not_finite(actions, active):  # type: ignore[no-untyped-def]
    """The first active row of ``actions`` (N, n) with a NaN or an infinity, or -1."""
    for row in range(actions.shape[0]):
        if active[row]:
            for j in range(actions.shape[1]):
                if not math.isfinite(actions[row, j]):
                    return row
    return -1


@kernel
def step(*arguments):  # type: ignore[no-untyped-def]
    """Moves the active rows from ``start`` to ``stop``, and observes them.

    The arguments are ``*Chain, *Law, *CostParameters, *State, *Outcome, actions, active, start, stop``: tuples are
    taken apart by the caller, since numba takes them over one by one in less time than as named tuples.

    Args:
        *arguments: The arm; the law; the cost; the state, changed in place; the outcome, written in place; the
            actions as fractions of the velocity limit, finite, of shape (N, n); the rows to step, of shape (N,); the
            first row, and the row after the last.
    """
    chain, law, cost, state, out = _assemble(arguments)
    actions, active, start, stop = arguments[34], arguments[35], arguments[36], arguments[37]
    scratch = _scratch(law, out)
    for row in range(start, stop):
        if active[row]:
            _move_row(law, state, actions, out, row)
            _observe_row(chain, law, cost, state, out, row, scratch)


@kernel
def observe(*arguments):  # type: ignore[no-untyped-def]
    """Observes the active rows without moving them; the arguments are those of :func:`step`."""
    chain, law, cost, state, out = _assemble(arguments)
    active, start, stop = arguments[35], arguments[36], arguments[37]
    scratch = _scratch(law, out)
    for row in range(start, stop):
        if active[row]:
            out.clipped[row] = False
            _observe_row(chain, law, cost, state, out, row, scratch)


@inlined
def _assemble(arguments):  # type: ignore[no-untyped-def]
    return (
        Chain(*arguments[0:5]),
        Law(*arguments[5:14]),
        CostParameters(*arguments[14:19]),
        State(*arguments[19:24]),
        Outcome(*arguments[24:34]),
    )


@kernel
def _move_row(law, state, actions, out, row):  # type: ignore[no-untyped-def]
    n = actions.shape[1]
    k = state.step[row]
    clipped = False
    for j in range(n):
        action = actions[row, j]
        if abs(action) > 1.0:
            clipped = True
            action = math.copysign(1.0, action)
        velocity = action * law.velocity_limit[j]
        state.qdot[row, j] = velocity
        if law.bias[j] != 0.0:
            velocity += law.bias[j]
        if law.noise[j] != 0.0:
            velocity += law.noise[j] * _uniform(state.noise_key[row], np.uint64(k * n + j))
        state.q[row, j] += law.dt * velocity  # Varga 2021, eq. 5
    state.step[row] = k + 1
    out.clipped[row] = clipped


@kernel
def _scratch(law, out):  # type: ignore[no-untyped-def]
    """Arrays that the rows of a call use one after the other: to allocate them costs as much as the kinematics."""
    m = out.pose.shape[1]
    e = 6 if law.kind == task_kernels.POSE else m
    return np.empty((3, 3)), np.empty(3), np.empty(m), np.empty(e)


@kernel
def _observe_row(chain, law, cost, state, out, row, scratch):  # type: ignore[no-untyped-def]
    rotation, position, nominal, error = scratch
    k = state.step[row]
    for j in range(state.q.shape[1]):
        out.q[row, j] = state.q[row, j]
        out.qdot[row, j] = state.qdot[row, j]
    forward(chain, out.q[row], rotation, position)
    pose = out.pose[row]
    task_kernels.coordinates(law.kind, rotation, position, pose)

    frames = state.frames[row if state.frames.shape[0] > 1 else 0]
    for p in range(law.preview.shape[0]):
        task_kernels.frame_coordinates(law.kind, frames[law.point[k + law.preview[p]]], out.nominal[row, p])
    out.remaining[row, 0] = law.steps - k

    frame = frames[law.point[k]]
    width = frame.shape[0]
    square = 0.0
    for i in range(3):
        missing = frame[width - 3 + i] - position[i]
        square += missing * missing
    out.position_error[row] = math.sqrt(square)
    if law.kind == task_kernels.POSITION:
        out.orientation_error[row] = math.nan
    else:
        out.orientation_error[row] = geodesic_angle(rotation, frame[:9].reshape(3, 3))

    out.tracking_cost[row] = 0.0
    out.velocity_cost[row] = 0.0
    if law.counted[k]:
        task_kernels.frame_coordinates(law.kind, frame, nominal)
        task_kernels.error(law.kind, nominal, pose, error)
        out.tracking_cost[row] = cost_kernels.tracking(cost, error)
        out.velocity_cost[row] = cost_kernels.velocity(cost, out.qdot[row])


@kernel
def _uniform(key, counter):  # type: ignore[no-untyped-def]
    """The ``counter``-th number of a stream, uniform between -1 and 1 (SplitMix64).

    A counter instead of a generator's state: rows stay independent of each other and of the order they run in.
    """
    z = key + (counter + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = z ^ (z >> np.uint64(31))
    return 2.0 * (np.float64(z >> np.uint64(11)) * 2.0**-53) - 1.0


@kernel
def nominal_rows(kind, frames, out):  # type: ignore[no-untyped-def]
    """Task coordinates of frames: ``frames`` (k, 12 or 3), ``out`` (k, m)."""
    for row in range(frames.shape[0]):
        task_kernels.frame_coordinates(kind, frames[row], out[row])
