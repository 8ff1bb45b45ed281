"""Kernels: the drives of a plant."""

from __future__ import annotations

import numpy as np

from ikgym.kernels.jit import inlined
from ikgym.kernels.random_numbers import uniform


@inlined
def remembered(ring, row, step, j):
    """The command of joint ``j`` in an earlier step, 0 before the episode. ``ring`` has shape (N, D, n)."""
    return ring[row, step % ring.shape[1], j] if step >= 0 else 0.0


@inlined
def disturbed(velocity, bias, noise, key, counter):
    """A velocity with its bias and its noise, each of them left out where it is 0."""
    if bias != 0.0:
        velocity += bias
    if noise != 0.0:
        velocity += noise * uniform(key, counter)
    return velocity


@inlined
def engaged(play, row, j, backlash, way):
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
def filtered(drive, row, j, lag, velocity):
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
def counter_of(step, n, j):
    """One number for each step and joint."""
    return np.uint64(step * n + j)
