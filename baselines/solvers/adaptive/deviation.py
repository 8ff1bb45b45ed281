"""Kernels: how far poses are from those of a model, as a twist that can be added to and taken from task coordinates.

A deviation has six numbers: the shift of the position in [m], then the rotation vector δ in [rad] with R = exp(δ) R̂ in
the base frame. Skew coordinates do not determine an orientation: theirs is the difference of the coordinates instead.
Parts that the task does not have are 0.
"""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.axes import across
from ikgym.kernels.jit import inlined, inner
from ikgym.kernels.rotations import rodrigues, rotation_vector
from ikgym.kernels.tasks import AXIS, MATRIX, POSE, POSITION, SKEW

SIZE = 6


@inner
def turned_by(x, y, z):
    """The rotation matrix of a rotation vector."""
    angle = math.sqrt(x * x + y * y + z * z)
    axis = np.zeros(3)
    axis[0] = 1.0
    if angle > 0.0:
        axis[0], axis[1], axis[2] = x / angle, y / angle, z / angle
    return rodrigues(axis, angle)


@inlined
def product(first, second, out):
    """Multiplies two matrices of shape (3, 3)."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@inner
def add_deviation(kind, deviation, sign, coordinates, out):
    """Moves task coordinates by a deviation, or back.

    Args:
        kind: Of task coordinates, see :mod:`ikgym.kernels.tasks`.
        deviation: Shape (6,).
        sign: 1 to move them, -1 to move them back.
        coordinates: Shape (p, m).
        out: Receives the moved ones. Shape (p, m).
    """
    m = coordinates.shape[1]
    turn = turned_by(sign * deviation[3], sign * deviation[4], sign * deviation[5])
    for row in range(coordinates.shape[0]):
        seen, moved = coordinates[row], out[row]
        for i in range(3):
            moved[m - 3 + i] = seen[m - 3 + i] + sign * deviation[i]
        if kind == SKEW:
            for i in range(3):
                moved[i] = seen[i] + sign * deviation[3 + i]
        elif kind == AXIS:
            for i in range(3):
                moved[i] = turn[i, 0] * seen[0] + turn[i, 1] * seen[1] + turn[i, 2] * seen[2]
        elif kind != POSITION:
            product(turn, seen[:9].reshape(3, 3), moved[:9].reshape(3, 3))


@inner
def deviation_between(kind, rotation, position, model_rotation, model_position, out):
    """The deviation from the pose of a model to another one.

    Args:
        kind: Of task coordinates.
        rotation: Orientation. Shape (3, 3).
        position: In [m]. Shape (3,).
        model_rotation: The model's. Shape (3, 3).
        model_position: The model's. Shape (3,).
        out: Receives the deviation. Shape (6,).
    """
    for i in range(3):
        out[i] = position[i] - model_position[i]
    if kind == POSITION:
        out[3:] = 0.0
    elif kind == SKEW:
        seen, modelled = np.empty(6), np.empty(6)
        task_kernels.coordinates(SKEW, rotation, position, seen)
        task_kernels.coordinates(SKEW, model_rotation, model_position, modelled)
        for i in range(3):
            out[3 + i] = seen[i] - modelled[i]
    else:
        turn = np.empty((3, 3))
        product(rotation, model_rotation.T, turn)
        out[3:] = rotation_vector(turn)


@inner
def missing_deviation(kind, measured, modelled, deviation, out):
    """Difference from a deviation to that of measured coordinates, a rotation vector in the base frame included.

    Args:
        kind: Of task coordinates.
        measured: Measured coordinates. Shape (m,).
        modelled: Those of the model at the same joint coordinates. Shape (m,).
        deviation: Estimate of the deviation. Shape (6,).
        out: Receives the deviation. Shape (6,).
    """
    m = measured.shape[0]
    predicted, error = np.empty((1, m)), np.zeros(max(m, SIZE))
    add_deviation(kind, deviation, 1.0, modelled.reshape(1, m), predicted)
    # Coordinates of matrices are those of poses, whose error is a rotation vector.
    shown = POSE if kind == MATRIX else kind
    task_kernels.error(shown, measured, predicted[0], error[: task_kernels.error_size(shown, m)])
    first = 3 if kind == SKEW else 0
    for i in range(3):
        out[i], out[3 + i] = error[first + i], error[3 - first + i]
    if kind == AXIS:
        ax, ay, az, bx, by, bz = across(measured[0], measured[1], measured[2])
        x, y = error[3], error[4]
        out[3], out[4], out[5] = x * ax + y * bx, x * ay + y * by, x * az + y * bz


@inner
def move_deviation(kind, change, deviation):
    """Adds a missing deviation, or a share of it, to a deviation, in place: the product of rotations. Shapes (6,)."""
    for i in range(3):
        deviation[i] += change[i]
    if kind == SKEW:
        for i in range(3):
            deviation[3 + i] += change[3 + i]
    elif kind != POSITION:
        turn, before = np.empty((3, 3)), turned_by(deviation[3], deviation[4], deviation[5])
        product(turned_by(change[3], change[4], change[5]), before, turn)
        deviation[3:] = rotation_vector(turn)
