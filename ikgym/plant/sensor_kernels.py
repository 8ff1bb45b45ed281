"""Kernels: the sensors of a plant."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inlined, inner
from ikgym.kernels.random_numbers import normal, share
from ikgym.plant.arm_kernels import turn

# The streams of the key of an episode's noises. The first is the key itself.
NOISE, Q_NOISE, POSITION, ROTATION, MISSING = range(5)
STREAMS = 5


@inlined
def divided(number, divisor):
    """Quotient and remainder; those of 1, the usual divisor, without a division, which takes 10 ns."""
    return (number, 0) if divisor == 1 else (number // divisor, number % divisor)


@inlined
def measure_q(sensors, plant, row, step, q, out):
    """Measures joint coordinates on the drive's side of resonances, and shows those that have arrived.

    Args:
        sensors: A :class:`ikgym.plant.step.Sensors`.
        plant: A :class:`ikgym.plant.step.PlantState`, whose measurements on their way are changed in place.
        row: The arm.
        step: Steps made.
        q: Joint coordinates. Shape (N, n).
        out: Receives the measurements. Shape (N, n).

    Returns:
        Steps since it was measured.
    """
    n, kept = q.shape[1], plant.q
    late = max(step - sensors.q_delay, 0)
    here, there = divided(step, kept.shape[1])[1], divided(late, kept.shape[1])[1]
    for j in range(n):
        value = q[row, j]
        if plant.swing.shape[1] > 0:
            value -= plant.swing[row, j, 0]
        if sensors.q_noise[j] != 0.0:
            value += sensors.q_noise[j] * normal(plant.keys[row, Q_NOISE], np.uint64(step * n + j))
        kept[row, here, j] = value
    for j in range(n):
        out[row, j] = kept[row, there, j]
    return step - late


@inlined
def missing(sensors, keys, number):
    """Whether a measurement of the pose is lost; the first never is."""
    return number > 0 and sensors.pose_missing > 0.0 and share(keys[MISSING], np.uint64(number)) < sensors.pose_missing


@inlined
def measure_pose(sensors, plant, row, kind, step, rotation, position):
    """Measures a pose where it is time to, and takes over the newest that has arrived.

    Args:
        sensors: A :class:`ikgym.plant.step.Sensors`.
        plant: A :class:`ikgym.plant.step.PlantState`, whose poses on their way and shown poses are changed in place.
        row: The arm.
        kind: The kind of task coordinates.
        step: Steps made.
        rotation: Orientation, which the noise may turn. Shape (3, 3).
        position: Position in [m], which the noise may shift. Shape (3,).

    Returns:
        The step of the measurement that has arrived, -1 where none has.
    """
    every, keys, kept, shown = plant.pose_every[row], plant.keys[row], plant.pose[row], plant.shown[row]
    number, since = divided(step, every)
    if since == 0 and not missing(sensors, keys, number):
        distance, angle = plant.pose_noise[row], plant.pose_rotation_noise[row]
        if distance != 0.0 or angle != 0.0:  # a call counts references, which takes longer than the rest
            blur(distance, angle, keys, kind, step, rotation, position)
        task_kernels.coordinates(kind, rotation, position, kept[divided(number, kept.shape[0])[1]])
    late = max(step - sensors.pose_delay, 0)
    number, since = divided(late, every)
    arrived = (late > 0 and since == 0 and not missing(sensors, keys, number)) or step == 0
    if not arrived:
        return -1
    newest = kept[divided(number, kept.shape[0])[1]]
    for i in range(shown.shape[0]):
        shown[i] = newest[i]
    return late


@inner
def blur(distance, angle, keys, kind, step, rotation, position):
    """Shifts a position by a normal vector, and turns an orientation by another one.

    Args:
        distance: Standard deviation of each part of the shift, in [m].
        angle: Standard deviation of each part of the rotation vector, in [rad].
        keys: Of the row's streams. Shape (5,).
        kind: The kind of task coordinates.
        step: Steps made.
        rotation: Orientation, changed in place. Shape (3, 3).
        position: Position in [m], changed in place. Shape (3,).
    """
    first = 3 * step
    if distance != 0.0:
        for c in range(3):
            position[c] += distance * normal(keys[POSITION], np.uint64(first + c))
    if angle != 0.0 and kind != task_kernels.POSITION:
        _turn(
            angle * normal(keys[ROTATION], np.uint64(first)),
            angle * normal(keys[ROTATION], np.uint64(first + 1)),
            angle * normal(keys[ROTATION], np.uint64(first + 2)),
            rotation,
        )


@inlined
def _turn(wx, wy, wz, rotation):
    """Turns an orientation by a rotation vector in place: Rodrigues' formula, without a division by the angle."""
    theta = math.sqrt(wx * wx + wy * wy + wz * wz)
    half = 0.5 * theta
    s = math.sin(theta) / theta if theta > 0.0 else 1.0
    v = 2.0 * (math.sin(half) / theta) ** 2 if theta > 0.0 else 0.5
    for c in range(3):
        turn((wx, wy, wz), s, v, rotation[:, c])
