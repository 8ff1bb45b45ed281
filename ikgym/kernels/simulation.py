"""Constants and state of N arms, and kernels for what a step shows of them; :mod:`ikgym.plant.step` moves the arms."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels import cost as cost_kernels
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.axes import angle_between
from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.outcome import Outcome as Outcome
from ikgym.kernels.rotations import geodesic_angle

Floats = npt.NDArray[np.float64]
Integers = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]


class Constants(NamedTuple):
    """Constants of all rows and steps.

    Attributes:
        kind: The kind of task coordinates, see :mod:`ikgym.kernels.tasks`.
        dt: Δt in [s].
        velocity_limit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        steps: Steps of an episode.
        point: Where the nominal point that is the target after k steps is among the state's frames.
            Shape (steps + furthest preview + 1,).
        counted: Whether costs count at the k-th step, that is whether it is the last of its point.
            Shape (steps + 1,).
        preview: How many steps ahead the nominal coordinates are shown. Shape (p,).
        limits: Result of :func:`ikgym.arms.limits.limit_rows`. Shape (4, n), or (0, n) where there are none.
    """

    kind: int
    dt: float
    velocity_limit: Floats
    steps: int
    point: Integers
    counted: Flags
    preview: Integers
    limits: Floats


class State(NamedTuple):
    """State of the N arms, and their commands.

    Attributes:
        actions: Joint velocities as fractions of the velocity limit, finite. Shape (N, n).
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
        step: Steps made in the episode. Shape (N,).
        frames: Nominal frames of the rows' episodes, or those that are near, see :mod:`ikgym.kernels.tasks`; shared
            where the first length is 1. Shape (N or 1, points, 12 or 3).
    """

    actions: Floats
    q: Floats
    qdot: Floats
    step: Integers
    frames: Floats


@kernel
def first_not_finite(actions, active):
    """The first active row of ``actions`` (N, n) with a NaN or an infinity, or -1."""
    for row in range(actions.shape[0]):
        if active[row]:
            for j in range(actions.shape[1]):
                if not math.isfinite(actions[row, j]):
                    return row
    return -1


@inlined
def _show_nominal(kind, frames, point, k, preview, out):
    """The nominal task coordinates ahead of step ``k``. ``out`` has shape (p, m)."""
    for i in range(preview.shape[0]):
        task_kernels.frame_coordinates(kind, frames[point[k + preview[i]]], out[i])


@inlined
def _errors(kind, frame, rotation, position):
    """The position error of a pose in [m], and the orientation error in [rad], NaN where the task has no orientation.

    Args:
        kind: The kind of task coordinates.
        frame: Where the tool should be. Shape (12,) or (3,).
        rotation: Orientation of the tool. Shape (3, 3).
        position: Tool point in [m]. Shape (3,).
    """
    square, width = 0.0, frame.shape[0]
    for i in range(3):
        missing = frame[width - 3 + i] - position[i]
        square += missing * missing
    if kind == task_kernels.POSITION:
        angle = math.nan
    elif kind == task_kernels.AXIS:
        angle = angle_between(rotation[0, 2], rotation[1, 2], rotation[2, 2], frame[2], frame[5], frame[8])
    else:
        angle = geodesic_angle(rotation, frame[:9].reshape(3, 3))
    return math.sqrt(square), angle


@inlined
def _tracking(kind, cost, frame, pose, nominal, error):
    """Φ^X of task coordinates.

    Args:
        kind: Their kind.
        cost: A :class:`CostParameters`.
        frame: Where the tool should be. Shape (12,) or (3,).
        pose: Task coordinates. Shape (m,).
        nominal: Receives the nominal ones. Shape (m,).
        error: Receives the error. Shape (e,).
    """
    task_kernels.frame_coordinates(kind, frame, nominal)
    task_kernels.error(kind, nominal, pose, error)
    return cost_kernels.tracking(cost, error)


@uncounted
def show_row(constants, cost, state, row, pose, frame, shown):
    """Writes the tool pose of a row, the reference ahead, its errors and the cost of the step.

    Args:
        constants: A :class:`Constants`.
        cost: A :class:`CostParameters`.
        state: A :class:`State`, with the row's step counted.
        row: Its number.
        pose: Receives the task coordinates. Shape (m,).
        frame: Orientation of the tool and tool point in [m], of shapes (3, 3) and (3,); then working memory of
            shapes (m,) and (e,).
        shown: A :class:`ikgym.kernels.outcome.Shown`, written in place.
    """
    kind, point, tables, k = constants.kind, constants.point, state.frames, state.step[row]
    rotation, position, nominal, error = frame
    task_kernels.coordinates(kind, rotation, position, pose)
    frames = tables[row if tables.shape[0] > 1 else 0]
    _show_nominal(kind, frames, point, k, constants.preview, shown.nominal[row])
    shown.remaining[row, 0] = constants.steps - k
    target = frames[point[k]]
    shown.position_error[row], shown.orientation_error[row] = _errors(kind, target, rotation, position)
    shown.tracking_cost[row] = shown.velocity_cost[row] = 0.0
    if constants.counted[k]:
        shown.tracking_cost[row] = _tracking(kind, cost, target, pose, nominal, error)
        shown.velocity_cost[row] = cost_kernels.velocity(cost, state.qdot[row])


@inlined
def to_command(action, velocity_limit, clipped, row):
    """The command of an action in [rad/s] or [m/s]; outside the box it is clipped, and ``clipped`` (N,) is set."""
    if abs(action) > 1.0:
        clipped[row] = 1.0
        action = math.copysign(1.0, action)
    return action * velocity_limit


@kernel
def nominal_rows(kind, frames, out):
    """Task coordinates of frames: ``frames`` (k, 12 or 3), ``out`` (k, m)."""
    for row in range(frames.shape[0]):
        task_kernels.frame_coordinates(kind, frames[row], out[row])
