"""Kernel: one step of N arms whose plant is not ideal."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.bodies.proximity import proximity
from ikgym.kernels.jit import expanded, inlined, kernel, uncounted
from ikgym.kernels.kinematics import Chain, forward
from ikgym.kernels.limits import FASTEST, LOWER, SLACK, UPPER, driven, stopped, within
from ikgym.kernels.outcome import OBSTACLE, more_parts, more_size, parts, size
from ikgym.kernels.simulation import Floats, Integers, commanded, show_row
from ikgym.plant.contact import measure, place_of_boxes, touches
from ikgym.plant.drive_kernels import counter_of, disturbed, engaged, filtered, remembered
from ikgym.plant.sensor_kernels import NOISE, measure_pose, measure_q

_parts, _more_parts, _size, _more_size = expanded(parts), expanded(more_parts), inlined(size), inlined(more_size)


class Drives(NamedTuple):
    """Drive parameters of all rows.

    Attributes:
        bias: In [rad/s] or [m/s]. Shape (n,).
        noise: In [rad/s] or [m/s]. Shape (n,).
        backlash: In [rad] or [m]. Shape (n,).
        prismatic: True where a joint is prismatic. Shape (n,).
        payload_step: Steps made when the payload is taken up.
    """

    bias: Floats
    noise: Floats
    backlash: Floats
    prismatic: npt.NDArray[np.bool_]
    payload_step: int


class Sensors(NamedTuple):
    """Sensor parameters of all rows, by the names of :class:`ikgym.Plant`. ``q_noise`` has shape (n,)."""

    q_noise: Floats
    q_delay: int
    pose_delay: int
    pose_missing: float


class PlantState(NamedTuple):
    """Parameters and state of the plants of N arms.

    Attributes:
        keys: Of the rows' streams of random numbers. Shape (N, 5).
        lag: The share of the gap to a commanded velocity that a step closes, 1 without lag. Shape (N,).
        delay: Steps after which a command reaches the drive. Shape (N,).
        pose_noise: Standard deviation of each part of a measured position, in [m]. Shape (N,).
        pose_rotation_noise: The same of the rotation vector of the orientation, in [rad]. Shape (N,).
        pose_every: Steps from one measurement of the pose to the next. Shape (N,).
        drive: Velocities of the drives in [rad/s] or [m/s]. Shape (N, n).
        play: How far drives are from the middle of their backlash, in [rad] or [m]. Shape (N, n).
        commands: The last commands in [rad/s] or [m/s]; that of step k is number k mod D. Shape (N, D, n).
        q: The last measured joint coordinates; those of step k are number k mod Q. Shape (N, Q, n).
        pose: The last measured poses; the i-th is number i mod S. Shape (N, S, m).
        shown: The poses that are shown. Shape (N, m).
        shown_step: When they were measured, in steps. Shape (N,).
    """

    keys: npt.NDArray[np.uint64]
    lag: Floats
    delay: Integers
    pose_noise: Floats
    pose_rotation_noise: Floats
    pose_every: Integers
    drive: Floats
    play: Floats
    commands: Floats
    q: Floats
    pose: Floats
    shown: Floats
    shown_step: Integers


@kernel
def step(constants, cost, drives, sensors, arms, state, plant, contacts, numbers, active, moving, start, stop):
    """Moves rows, and observes them, as :func:`ikgym.kernels.simulation.step` does.

    Args:
        constants: A :class:`ikgym.kernels.simulation.Constants`.
        cost: A :class:`ikgym.kernels.cost.CostParameters`.
        drives: A :class:`Drives`.
        sensors: A :class:`Sensors`.
        arms: The rows' own, an :class:`Arms`.
        state: A :class:`ikgym.kernels.simulation.State`, changed in place.
        plant: A :class:`PlantState`, changed in place.
        contacts: A :class:`ikgym.plant.contact.Contacts`, changed in place; None where touching does not matter.
        numbers: The block of an outcome, written in place.
        active: The rows that are meant. Shape (N,).
        moving: Whether they move, or are observed where they are.
        start: The first row.
        stop: The row after the last.
    """
    rows, n = state.q.shape
    p, m = constants.preview.shape[0], plant.shown.shape[1]
    usual = rows * _size(n, m, p)
    o = 0 if contacts is None else contacts.shown
    h = ((numbers.shape[0] - usual) // rows - _more_size(n, m, 0, o)) // n
    shown, more = _parts(numbers, rows, n, m, p), _more_parts(numbers[usual:], rows, n, m, h, o)
    _rows(constants, cost, drives, sensors, arms, state, plant, contacts, shown, more, active, moving, start, stop)


@uncounted
def _rows(constants, cost, drives, sensors, arms, state, plant, contacts, shown, more, active, moving, start, stop):
    """The rows of :func:`step`, with the parts of the outcome in two tuples."""
    q, qdot = state.q, state.qdot
    offsets, axes, tool, tool_rotation = arms.offsets, arms.axes, arms.tool, arms.tool_rotation
    n, m, scratch = q.shape[1], plant.shown.shape[1], state.scratch
    rotation, position = scratch[start, :9].reshape(3, 3), scratch[start, 9:12]
    nominal, error = scratch[start, 12 : 12 + m], scratch[start, 12 + m :]
    for row in range(start, stop):
        if not active[row]:
            continue
        shown.clipped[row] = 0.0
        shown.at_limit[row, 0] = shown.at_limit[row, 1] = shown.at_limit[row, 2] = 0.0
        if moving:
            if contacts is not None:
                for j in range(n):
                    contacts.before[row, j] = q[row, j]
            _drive(constants, drives, state, plant, row, shown.clipped, shown.at_limit)
            state.step[row] += 1
        k = state.step[row]
        loaded = 1 if k >= drives.payload_step else 0
        chain = Chain(
            offsets[row, loaded], axes[row, loaded], drives.prismatic, tool[row, loaded], tool_rotation[row, loaded]
        )
        if contacts is not None:
            _meet(contacts, chain, state, plant.drive, row, loaded, moving, k == drives.payload_step)
            _show_contacts(contacts, row, k, constants.counted[k], more)
        else:
            more.clearance[row], more.stopped[row], more.pair[row, 0], more.pair[row, 1], more.proximity_cost[row] = (
                math.inf,
                0.0,
                -1.0,
                -1.0,
                0.0,
            )
        forward(chain, q[row], rotation, position)
        show_row(constants, cost, state, row, more.true_pose[row], (rotation, position, nominal, error), shown)
        for j in range(n):
            shown.qdot[row, j] = qdot[row, j]
            more.true_q[row, j] = q[row, j]
        _recall(constants.limits, plant.commands, row, k, more.commands)
        _sense(sensors, plant, constants.kind, state, row, (rotation, position), shown, more)


@inlined
def _meet(contacts, chain, state, drive, row, loaded, moving, loading):
    """Takes the motion of a row back in which bodies touch, and lets the arm stand still from then on."""
    q, qdot, k = state.q, state.qdot, state.step[row]
    if not moving:
        measure(contacts, chain, row, loaded, k, q[row])
        return
    before = contacts.before[row]
    if not contacts.stopped[row]:
        if loading:  # it has become another arm
            measure(contacts, chain, row, loaded, k - 1, before)
        if not touches(contacts, chain, row, loaded, k, q[row]):
            return
    first, second, touched = contacts.pair[row, 0], contacts.pair[row, 1], not contacts.stopped[row]
    for j in range(q.shape[1]):
        q[row, j], qdot[row, j], drive[row, j] = before[j], 0.0, 0.0
    contacts.stopped[row] = True
    measure(contacts, chain, row, loaded, k, q[row])
    if touched:
        contacts.pair[row, 0], contacts.pair[row, 1] = first, second


@inlined
def _show_contacts(contacts, row, k, counted, more):
    """Writes the clearance of a row, its cost, whether the row is stopped, its nearest pair, and its obstacles."""
    more.clearance[row], more.stopped[row] = contacts.distance[row], contacts.stopped[row]
    more.proximity_cost[row] = proximity(contacts.proximity, contacts.distance[row]) if counted else 0.0
    for c in range(2):
        more.pair[row, c] = contacts.pair[row, c]
    table, at = place_of_boxes(contacts, row, k + 1)
    for i in range(contacts.shown):
        for c in range(OBSTACLE):
            more.obstacles[row, i, c] = contacts.boxes[table, at, i, c]


@inlined
def _drive(constants, drives, state, plant, row, clipped, at_limit):
    """Moves the joints of a row: delay, velocity limit, acceleration limit, lag, bias and noise, backlash, stop."""
    dt, velocity_limit, limits = constants.dt, constants.velocity_limit, constants.limits
    q, qdot, limited = state.q, state.qdot, constants.limits.shape[0] > 0
    n, now, lag = q.shape[1], state.step[row], plant.lag[row]
    for j in range(n):
        command = commanded(state.actions[row, j], velocity_limit[j], clipped, row)
        plant.commands[row, now % plant.commands.shape[1], j] = command
        applied = remembered(plant.commands, row, now - plant.delay[row], j)
        slack = SLACK * velocity_limit[j]
        if limited:
            applied = driven(limits, j, applied, qdot[row, j], slack, at_limit, row)
        velocity = filtered(plant.drive, row, j, lag, applied) if lag < 1.0 else applied
        key = plant.keys[row, NOISE]
        velocity = disturbed(velocity, drives.bias[j], drives.noise[j], key, counter_of(now, n, j))
        way = dt * velocity
        if drives.backlash[j] != 0.0:
            way = engaged(plant.play, row, j, drives.backlash[j], way)
        reached = q[row, j] + way  # Varga 2021, eq. 5
        if limited and not limits[LOWER, j] <= reached <= limits[UPPER, j]:
            reached, applied = stopped(limits, j, q[row, j], reached, dt)
            at_limit[row, 0] += abs(velocity - applied) > slack
            plant.drive[row, j] = applied
        q[row, j], qdot[row, j] = reached, applied


@inlined
def _recall(limits, commands, row, now, out):
    """Shows the last commands within the velocity limit. ``out`` has shape (N, h, n)."""
    for i in range(out.shape[1]):
        for j in range(out.shape[2]):
            command = remembered(commands, row, now - 1 - i, j)
            out[row, i, j] = within(command, limits[FASTEST, j]) if limits.shape[0] > 0 else command


@inlined
def _sense(sensors, plant, kind, state, row, frame, shown, more):
    """Writes the measurements of the sensors. The pose in the scratch is blurred for them, at the end."""
    now, (rotation, position) = state.step[row], frame
    more.q_age[row, 0] = measure_q(sensors, plant.keys[row], row, now, state.q, plant.q, shown.q)
    arrived = measure_pose(sensors, plant, row, kind, now, rotation, position)
    if arrived >= 0:
        plant.shown_step[row] = arrived
    more.pose_age[row, 0] = now - plant.shown_step[row]
    for i in range(plant.shown.shape[1]):
        shown.pose[row, i] = plant.shown[row, i]
