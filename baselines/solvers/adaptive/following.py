"""Kernels: commands by which joints follow an arm without delay and lag, and how that arm moves."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from baselines.solvers.adaptive.drives import SAMPLES, SPAN, TOTAL, mixture
from baselines.solvers.quadratic_program.velocity_box import reachable_change, smooth_box
from ikgym.kernels.jit import inlined, kernel
from ikgym.validation import LARGEST, FloatArray

#: Steps in which a limited jerk lets a drive catch up with a velocity that it has missed.
PATIENCE = 10.0
#: Share of the largest acceleration that corrects an error.
SHARE = 0.2
#: Commands within this share of the largest velocity are never too fast.
SLOW = 0.01
#: Share of the largest stable gain, and steps by which a delay may change that is known.
STABLE, UNSURE = 0.75, 2.0
#: For how long the fastest velocity that was wanted is remembered, in [s].
REMEMBERED = 1.0


class Servo(NamedTuple):
    """Gain and limits of the correction of errors.

    Attributes:
        gain: Share of the present error that is corrected in a step while nothing is known of the drives.
        dt: Δt in [s].
        unit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        largest: The largest velocities in [rad/s] or [m/s]. Shape (n,).
        change: How much they change at most in a step; inf where there is no limit. Shape (n,).
        steps: By how much these changes may differ from step to step; inf where jerk has no limit. Shape (n,).
        overdrive: Largest ratio of a command to the velocities wanted lately; inf where that does not matter.
    """

    gain: float
    dt: float
    unit: FloatArray
    largest: FloatArray
    change: FloatArray
    steps: FloatArray
    overdrive: float


@inlined
def gain_of(least, doubt):
    """Share of the present error that is corrected in a step, from the delay that is in doubt, in steps.

    A gain is stable below 2 sin(π / (2 (2 d + 1))) where d steps are not compensated for.
    """
    steps = max(doubt, UNSURE)
    return max(least, STABLE * 2.0 * math.sin(math.pi / (2.0 * (2.0 * steps + 1.0))))


@inlined
def kalman_gain(off, step, past, spread):
    """Gain that corrects a measured error best: the Kalman gain of a random walk observed in white noise.

    Over s steps the measured error changes with the variance s w + 2 v, where w is that of a step of the walk (errors
    of the simulated drives) and v that of the noise. Running sums for one step and for SPAN steps give both.

    Args:
        off: The error in [rad] or [m].
        step: k, the number of the measurement.
        past: The last errors, that of step k at k modulo SPAN, changed in place. Shape (SPAN,).
        spread: Running sums of the squared changes over one step and over SPAN steps, changed in place. Shape (2,).
    """
    here = step % SPAN
    spread[0] += (off - past[here - 1]) ** 2 - spread[0] / SAMPLES
    spread[1] += (off - past[here]) ** 2 - spread[1] / SAMPLES
    past[here] = off
    walk = (spread[1] - spread[0]) / (SPAN - 1)
    noise = 0.5 * (spread[0] - walk)
    if noise <= 0.0:
        return 1.0
    return 2.0 / (1.0 + math.sqrt(1.0 + 4.0 * noise / walk)) if walk > 0.0 else 0.0


@kernel
def move_rows(limits, dt, wanted, q, qdot):
    """Moves arms that have limits, but no delay and no lag.

    Args:
        limits: See :class:`baselines.policy_kernels.Model`. Shape (6, n).
        dt: Δt in [s].
        wanted: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        q: Joint coordinates now and 1, 2, … steps ago, in [rad] or [m], changed in place. Shape (B, A, n).
        qdot: The velocities applied last, and those before, in [rad/s] or [m/s], changed in place. Shape (B, A, n).
    """
    n = q.shape[2]
    lower, upper = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        smooth_box(limits, dt, q[row, 0], qdot[row, 0], qdot[row, 0] - qdot[row, 1], lower, upper)
        for i in range(q.shape[1] - 1, 0, -1):
            q[row, i], qdot[row, i] = q[row, i - 1], qdot[row, i - 1]
        for j in range(n):
            qdot[row, 0, j] = min(max(wanted[row, j], lower[j]), upper[j])
            q[row, 0, j] += dt * qdot[row, 0, j]


@kernel
def follow_rows(off, lags, servo, memory, qdot):
    """Commands by which the joints move as the arm without delay and lag, and what the simulated drives make of them.

    A joint that is less late than the slowest one follows where that arm was some steps ago. A command is the velocity
    wanted and a share of the error, through the inverse of the lag. Where accelerations are limited, large errors are
    corrected no faster than the arm can stop, at a raised gain also through its lag: a share of them would overshoot
    ever more. The gain is raised up to :func:`kalman_gain`. A command is at most ``overdrive`` times as fast as the
    wanted velocity of the last second, or slow: the inverse of a lag turns steps, and a wrong one errors, into peaks.

    Where jerk is limited the gain is not raised, and a velocity that a drive has missed is made up for in PATIENCE
    steps: the inverse of a lag multiplies an error, and commands that cannot change so fast would swing.

    Args:
        off: How far the arm is from where the simulated drives should have brought it, in [rad] or [m]. Shape (B, n).
        lags: T of the simulated drives. Shape (n, L).
        servo: A plain :class:`Servo`.
        memory: A plain :class:`PredictedMemory`, changed in place.
        qdot: Receives the commands in [rad/s] or [m/s]. Shape (B, n).
    """
    gain, dt, unit, largest, change, steps, overdrive = servo
    velocity, path, fastest, past, spread, moved = memory[2], memory[3], memory[15], memory[16], memory[17], memory[18]
    aimed = memory[19]
    samples, delay, lag, doubt, sent, lead, arm_q, arm_qdot = memory[6:14]
    for row in range(qdot.shape[0]):
        for j in range(qdot.shape[1]):
            speeds, places = velocity[row, j], path[row, j]
            low, high, share = mixture(lag[row, j], lags[j])
            a, b = (1.0 - share) / lags[j, low], share / lags[j, high]
            held = lead[row] - delay[row, j]
            i = max(int(held), 0)
            early = held - i
            q = (1.0 - early) * arm_q[row, i + 1, j] + early * arm_q[row, i + 2, j]  # before this step, as the drives
            wanted = (1.0 - early) * arm_qdot[row, i, j] + early * arm_qdot[row, i + 1, j]
            error = q - (1.0 - share) * places[0, low] - share * places[0, high] - off[row, j]
            size = abs(error) / dt
            accelerated = min(change[j], LARGEST) * size  # 0 without an error, also where there is no limit
            slow = min(gain * size, math.sqrt(SHARE * accelerated))
            useful = kalman_gain(off[row, j], samples[row], past[row, j], spread[row, j])
            raised = min(gain_of(gain, doubt[row, j, TOTAL]), useful) if steps[j] == np.inf else gain
            fast = min(raised * size, math.sqrt(min(SHARE, 0.5 * (a + b)) * accelerated))
            target = wanted + math.copysign(max(slow, fast), error)
            if steps[j] < np.inf:  # only what the target gains is made in one step
                speed = (1.0 - share) * speeds[low] + share * speeds[high]
                aimed[row, j], target = target, speed + target - aimed[row, j] + (aimed[row, j] - speed) / PATIENCE
            free = (1.0 - share - a) * speeds[low] + (share - b) * speeds[high]
            command, last = (target - free) / (a + b), sent[row, j]
            fastest[row, j] = max((1.0 - dt / REMEMBERED) * fastest[row, j], abs(wanted))
            if overdrive < np.inf:
                most = max(overdrive * fastest[row, j], SLOW * largest[j])
                command = min(max(command, -most), most)
            least, greatest = last - change[j], last + change[j]
            if steps[j] < np.inf:
                least = last - reachable_change(-moved[row, j], largest[j] + last, change[j], steps[j])
                greatest = last + reachable_change(moved[row, j], largest[j] - last, change[j], steps[j])
            command = min(max(command, least), greatest)
            qdot[row, j] = min(max(command, -largest[j]), largest[j])
            # The command is a float32 share of the unit.
            sent[row, j] = np.float32(qdot[row, j] / unit[j]) * unit[j]
            moved[row, j] = sent[row, j] - last
            for k in range(places.shape[0] - 1, 0, -1):
                for f in range(speeds.shape[0]):
                    places[k, f] = places[k - 1, f]
            for f in range(speeds.shape[0]):
                speeds[f] += (sent[row, j] - speeds[f]) / lags[j, f]
                places[0, f] += dt * speeds[f]
