"""Kernels: the drives of a plant."""

from __future__ import annotations

import numpy as np

from ikgym.kernels.jit import inlined
from ikgym.kernels.random_numbers import uniform


@inlined
def recall(ring, row, now, place, back, j):
    """A command of some steps ago, 0 before the episode.

    Args:
        ring: Commands of the last steps. Shape (N, D, n).
        row: The arm.
        now: Steps made.
        place: That of this step in the ring, ``now`` mod D: a division takes longer than all else here.
        back: Steps ago, less than D.
        j: The joint.
    """
    if back > now:
        return 0.0
    return ring[row, place - back if back <= place else place - back + ring.shape[1], j]


@inlined
def disturb(velocity, bias, noise, key, counter):
    """A velocity with its bias and its noise, each of them left out where it is 0."""
    if bias != 0.0:
        velocity += bias
    if noise != 0.0:
        velocity += noise * uniform(key, counter)
    return velocity


@inlined
def engage(play, row, j, backlash, way):
    """Motion of the joint when its drive moves by ``way`` within the backlash, all of it without one.

    Args:
        play: How far drives are from the middle of their backlash. Shape (N, n).
        row: The arm.
        j: The joint.
        backlash: Its width in [rad] or [m].
        way: Motion of the drive, in [rad] or [m].
    """
    if backlash == 0.0:
        return way
    half, reached = 0.5 * backlash, play[row, j] + way
    play[row, j] = min(max(reached, -half), half)
    return reached - play[row, j]


@inlined
def lag_behind(drive, row, j, lag, velocity):
    """The velocity of a drive behind a first-order loop.

    Args:
        drive: Velocities that drives had. Shape (N, n).
        row: The arm.
        j: The joint.
        lag: The share of the gap to the command that a step closes.
        velocity: The commanded velocity.
    """
    drive[row, j] += lag * (velocity - drive[row, j])
    return drive[row, j]


@inlined
def respond(coefficients, past, row, j, command):
    """The velocity of a drive of low order, see :attr:`ikgym.Plant.drive`.

    Args:
        coefficients: Of the last velocities and commands. Shape (n, 7).
        past: The last three velocities, then the last three commands, newest first; shifted. Shape (N, n, 6).
        row: The arm.
        j: The joint.
        command: Its command.
    """
    velocity = coefficients[j, 3] * command
    for i in range(3):
        velocity += coefficients[j, i] * past[row, j, i] + coefficients[j, 4 + i] * past[row, j, 3 + i]
    for i in (2, 1):
        past[row, j, i], past[row, j, 3 + i] = past[row, j, i - 1], past[row, j, 2 + i]
    past[row, j, 0], past[row, j, 3] = velocity, command
    return velocity


@inlined
def swing_link(free, swing, row, j, way, dt):
    """Motion of a link behind a spring, whose other end moves by ``way`` at a constant velocity.

    The velocity changes between two steps, which gives the spring's deflection a jump of its rate; within a step the
    deflection x swings freely: x'' + 2 ζ ω x' + ω² x = 0.

    Args:
        free: The matrix of (x, x') over a step, row by row; 0 without a spring. Shape (n, 4).
        swing: Deflections in [rad] or [m], their rates, and the last velocities. Shape (N, n, 3).
        row: The arm.
        j: The joint.
        way: Motion of the encoder's side, in [rad] or [m].
        dt: Δt in [s].
    """
    velocity = way / dt
    x, rate = swing[row, j, 0], swing[row, j, 1] - (velocity - swing[row, j, 2])
    swing[row, j, 0], swing[row, j, 2] = free[j, 0] * x + free[j, 1] * rate, velocity
    swing[row, j, 1] = free[j, 2] * x + free[j, 3] * rate
    return way + (swing[row, j, 0] - x)


@inlined
def hold(plant, row, j, velocity, gain):
    """Gives a joint that is stopped its velocity: nothing behind it lags or swings any more."""
    plant.drive[row, j] = velocity / gain
    if plant.past.shape[1] > 0:
        for i in range(3):
            plant.past[row, j, i] = velocity / gain
    if plant.swing.shape[1] > 0:
        plant.swing[row, j, 0], plant.swing[row, j, 1], plant.swing[row, j, 2] = 0.0, 0.0, velocity


@inlined
def counter_of(step, n, j):
    """One number for each step and joint."""
    return np.uint64(step * n + j)
