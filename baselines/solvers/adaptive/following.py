"""Kernels: commands by which joints follow an arm without delay and lag, and how that arm moves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baselines.solvers.adaptive.drives import mixture
from baselines.solvers.quadratic_program.velocity_box import velocity_box
from ikgym.kernels.jit import kernel
from ikgym.validation import FloatArray

#: Share of the largest acceleration that corrects an error.
SHARE = 0.2
#: Commands within this share of the largest velocity are never too fast.
SLOW = 0.01
#: For how long the fastest velocity that was wanted is remembered, in [s].
REMEMBERED = 1.0


class Servo(NamedTuple):
    """Gain and limits of the correction of errors.

    Attributes:
        gain: Share of the present error that is taken back in a step.
        dt: Δt in [s].
        unit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        largest: The largest velocities in [rad/s] or [m/s]. Shape (n,).
        change: How much they change at most in a step; inf where there is no limit. Shape (n,).
        overdrive: Largest ratio of a command to the velocities wanted lately; inf where that does not matter.
    """

    gain: float
    dt: float
    unit: FloatArray
    largest: FloatArray
    change: FloatArray
    overdrive: float


@kernel
def move_rows(limits, dt, wanted, q, qdot):
    """Moves arms that have limits, but no delay and no lag.

    Args:
        limits: See :func:`baselines.solvers.quadratic_program.limits.limits_with_braking`. Shape (5, n).
        dt: Δt in [s].
        wanted: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        q: Joint coordinates in [rad] or [m], changed in place. Shape (B, n).
        qdot: The velocities applied last, in [rad/s] or [m/s], changed in place. Shape (B, n).
    """
    n = q.shape[1]
    lower, upper = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        velocity_box(limits, dt, q[row], qdot[row], lower, upper)
        for j in range(n):
            qdot[row, j] = min(max(wanted[row, j], lower[j]), upper[j])
            q[row, j] += dt * qdot[row, j]


@kernel
def follow_rows(error, wanted, lags, servo, memory, qdot):
    """Commands by which the joints move as wanted, and the velocities that the simulated drives make of them.

    A command is the velocity wanted and a share of the error, through the inverse of the lag. Where accelerations are
    limited, large errors are taken back no faster than the arm can stop: a share of them would overshoot ever more.
    A command is at most so many times faster than the wanted velocity of the last second, or slow: the inverse of a lag
    makes peaks of steps, and a wrong one of errors.

    Args:
        error: How far the arm will be behind when the command takes effect, in [rad] or [m]. Shape (B, n).
        wanted: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        lags: T of the simulated drives. Shape (L,).
        servo: A plain :class:`Servo`.
        memory: A plain :class:`PredictedMemory`, changed in place.
        qdot: Receives the commands in [rad/s] or [m/s]. Shape (B, n).
    """
    gain, dt, unit, largest, change, overdrive = servo
    velocity, path, lag, sent, fastest = memory[2], memory[3], memory[8], memory[9], memory[13]
    for row in range(qdot.shape[0]):
        low, high, share = mixture(lag[row], lags)
        a, b = (1.0 - share) / lags[low], share / lags[high]
        for j in range(qdot.shape[1]):
            back, stoppable = gain * error[row, j] / dt, SHARE * change[j] / dt * abs(error[row, j])
            if back * back > stoppable:
                back = math.copysign(math.sqrt(stoppable), back)
            target = wanted[row, j] + back
            free = (1.0 - share - a) * velocity[row, low, j] + (share - b) * velocity[row, high, j]
            command, last = (target - free) / (a + b), sent[row, j]
            fastest[row, j] = max((1.0 - dt / REMEMBERED) * fastest[row, j], abs(wanted[row, j]))
            if overdrive < np.inf:
                most = max(overdrive * fastest[row, j], SLOW * largest[j])
                command = min(max(command, -most), most)
            command = min(max(command, last - change[j]), last + change[j])
            qdot[row, j] = min(max(command, -largest[j]), largest[j])
            # The command is a float32 share of the unit.
            sent[row, j] = np.float32(qdot[row, j] / unit[j]) * unit[j]
        for f in range(lags.shape[0]):
            for i in range(path.shape[2] - 1, 0, -1):
                path[row, f, i] = path[row, f, i - 1]
            for j in range(qdot.shape[1]):
                velocity[row, f, j] += (sent[row, j] - velocity[row, f, j]) / lags[f]
                path[row, f, 0, j] += dt * velocity[row, f, j]
