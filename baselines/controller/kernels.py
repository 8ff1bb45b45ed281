"""Kernels of a control loop: guards, limits, stops, and the conversion of poses."""

from __future__ import annotations

import math

import numpy as np

from baselines.policy_kernels import all_finite
from baselines.solvers.quadratic_program.velocity_box import smooth_box, stopping_change
from ikgym.kernels import tasks
from ikgym.kernels.jit import kernel

# Reasons to stop, see :class:`baselines.controller.StopReason`; 0 for none.
NOT_FINITE, STALE, JUMP, OUTSIDE, PATH_ERROR = range(1, 6)
# Rows of bounds, and numbers, see :class:`baselines.controller.Guards`.
LOWER, UPPER, WAY = range(3)
AGE, TOLERANCE, POSITION, ORIENTATION, FROZEN = range(5)
# Rows of the memory: joint coordinates, how far commands should have moved the joints since they changed.
MEASURED, TRAVEL = range(2)
# Counters: whether there was a measurement, its age, and for how many periods it has not changed.
BEGUN, BEFORE, REPEATED = range(3)


@kernel
def watch(q, qdot, pose, nominal, q_age, pose_age, kind, bounds, numbers, kept, counters):
    """The first guard that refuses the measurements.

    Args:
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (n,).
        pose: Task coordinates. Shape (m,).
        nominal: The reference ahead. Shape (p, m).
        q_age: How many periods ago q was measured.
        pose_age: How many periods ago the pose was measured.
        kind: The kind of task coordinates.
        bounds: Shape (3, n).
        numbers: Shape (5,).
        kept: The last measurement, changed in place. Shape (2, n).
        counters: Counters, changed in place. Shape (3,).

    Returns:
        The reason to stop; 0 if there is none.
    """
    ages = np.array([q_age, pose_age])
    if not all_finite(q, qdot, pose, nominal, ages):
        return NOT_FINITE
    same, jump, outside, due = True, False, False, False
    periods = max(1.0 + counters[BEFORE] - q_age, 0.0)
    for j in range(q.shape[0]):
        way = abs(q[j] - kept[MEASURED, j])
        same = same and way == 0.0
        jump = jump or way > periods * bounds[WAY, j] + numbers[TOLERANCE]
        outside = outside or not bounds[LOWER, j] <= q[j] <= bounds[UPPER, j]
        due = due or abs(kept[TRAVEL, j]) > numbers[TOLERANCE]
    first, counters[BEGUN], counters[BEFORE] = counters[BEGUN] == 0.0, 1.0, q_age
    counters[REPEATED] = counters[REPEATED] + 1.0 if same and not first else 0.0
    frozen = due and counters[REPEATED] > numbers[FROZEN]
    if frozen or not (0.0 <= q_age <= numbers[AGE] and 0.0 <= pose_age <= numbers[AGE]):
        return STALE
    if outside:
        return OUTSIDE
    if jump and not first:
        return JUMP
    kept[MEASURED] = q
    if not same:
        kept[TRAVEL] = 0.0
    distance, angle = errors(kind, nominal[0], pose)
    return 0 if distance <= numbers[POSITION] and angle <= numbers[ORIENTATION] else PATH_ERROR


@kernel
def errors(kind, nominal, pose):
    """Distance in [m] and angle in [rad] of a pose from the reference."""
    m = pose.shape[0]
    error = np.empty(tasks.error_size(kind, m))
    tasks.error(kind, nominal, pose, error)
    e, square, turned = error.shape[0], 0.0, 0.0
    for i in range(3):
        square += (nominal[m - 3 + i] - pose[m - 3 + i]) ** 2
    # Errors of POSE and AXIS begin with the position, coordinates end with it.
    begin = 3 if kind in (tasks.POSE, tasks.AXIS) else 0
    for i in range(begin, begin + e - 3):
        turned += error[i] ** 2
    return math.sqrt(square), math.sqrt(turned)


@kernel
def take_report(velocity, acceleration, dt, fastest, quickest, last, change):
    """Takes over the command that an arm reports, unless a number is not finite; whether it does.

    Args:
        velocity: Joint velocities in [rad/s] or [m/s]. Shape (n,).
        acceleration: In [rad/s²] or [m/s²], of shape (n,); empty where the arm reports none.
        dt: Δt in [s].
        fastest: The largest velocities, to which they are cut. Shape (n,).
        quickest: The largest changes of a velocity in a period. Shape (n,).
        last: See :func:`command`, changed in place. Shape (n,).
        change: See :func:`command`, changed in place. Shape (n,).
    """
    if np.isnan(velocity).any() or not np.isfinite(acceleration).all():
        return False
    for j in range(last.shape[0]):
        taken = min(max(velocity[j], -fastest[j]), fastest[j])
        made = dt * acceleration[j] if acceleration.shape[0] > 0 else change[j] + taken - last[j]
        change[j], last[j] = min(max(made, -quickest[j]), quickest[j]), taken
    return True


@kernel
def command(limits, q, action, unit, last, change, dt, kept, out):
    """The joint velocities that limits make of an action.

    Args:
        limits: See :class:`baselines.policy_kernels.Model`. Shape (6, n).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        action: Shape (n,).
        unit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        last: Joint velocities of the last command, changed in place. Shape (n,).
        change: By how much they differed from those before, changed in place. Shape (n,).
        dt: Δt in [s].
        kept: See :func:`watch`, changed in place. Shape (2, n).
        out: Receives joint velocities in [rad/s] or [m/s]. Shape (n,).
    """
    n = q.shape[0]
    lower, upper = np.empty(n), np.empty(n)
    smooth_box(limits, dt, q, last, change, lower, upper)
    for j in range(n):
        out[j] = min(max(action[j] * unit[j], lower[j]), upper[j])
        change[j] = out[j] - last[j]
        last[j] = out[j]
        kept[TRAVEL, j] += dt * out[j]


@kernel
def brake(most, steps, last, change, out):
    """A step of a stop.

    Args:
        most: The largest changes of the velocities in a period, in [rad/s] or [m/s]. Shape (n,).
        steps: The largest changes of these from period to period, inf where there is no limit of jerk. Shape (n,).
        last: Joint velocities of the last command, changed in place. Shape (n,).
        change: By how much they differed from those before, changed in place. Shape (n,).
        out: Receives joint velocities in [rad/s] or [m/s]. Shape (n,).
    """
    for j in range(last.shape[0]):
        if steps[j] < math.inf:
            change[j] = stopping_change(last[j], change[j], most[j], steps[j])
            last[j] += change[j]
        else:
            last[j] = math.copysign(max(abs(last[j]) - most[j], 0.0), last[j])
        out[j] = last[j]


@kernel
def find_broken_limit(bounds, stops, wanted, command, change, q, qdot, dt):
    """The limit that a command breaks, see :data:`baselines.controller.mock_arm.REFLEXES`; 0 if none.

    Args:
        bounds: The largest velocities, changes of them in a period, and changes of these. Shape (3, n).
        stops: The stops in [rad] or [m], and the largest accelerations. Shape (3, n).
        wanted: The commanded joint velocities in [rad/s] or [m/s]. Shape (n,).
        command: Those before. Shape (n,).
        change: By how much these differed from those before. Shape (n,).
        q: True joint coordinates in [rad] or [m]. Shape (n,).
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (n,).
        dt: Δt in [s].
    """
    if not np.isfinite(wanted).all():
        return 1
    for i in range(3):
        for j in range(wanted.shape[0]):
            step = wanted[j] - command[j]
            value = wanted[j] if i == 0 else step if i == 1 else step - change[j]
            if abs(value) > bounds[i, j]:
                return 2 + i
    for j in range(wanted.shape[0]):
        room = stops[UPPER, j] - q[j] if qdot[j] > 0.0 else q[j] - stops[LOWER, j]
        if 0.5 * qdot[j] ** 2 / stops[2, j] - dt * abs(qdot[j]) > max(room, 0.0):
            return 5
    return 0


@kernel
def convert(kind, rotations, positions, out):
    """Task coordinates of poses.

    Args:
        kind: The kind of task coordinates.
        rotations: Shape (p, 3, 3).
        positions: In [m]. Shape (p, 3).
        out: Receives the task coordinates. Shape (p, m).
    """
    for k in range(positions.shape[0]):
        tasks.coordinates(kind, rotations[k], positions[k], out[k])
