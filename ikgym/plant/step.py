"""Kernel: one step of N arms."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.cost import CostParameters, proximity
from ikgym.kernels.jit import expanded, inlined, kernel, uncounted
from ikgym.kernels.kinematics import Chain, forward
from ikgym.kernels.limits import FASTEST, LOWER, SLACK, UPPER, clip, limit_command, stop_at_limit
from ikgym.kernels.outcome import OBSTACLE, more_parts, more_size, parts, size
from ikgym.kernels.simulation import Constants, Floats, Integers, State, show_row, to_command
from ikgym.kernels.tasks import error_size
from ikgym.plant.contact import measure, place_of_boxes, touches
from ikgym.plant.drive_kernels import counter_of, disturb, engage, hold, lag_behind, recall, respond, swing_link
from ikgym.plant.sensor_kernels import NOISE, measure_pose, measure_q

_parts, _more_parts, _size, _more_size = expanded(parts), expanded(more_parts), inlined(size), inlined(more_size)


class Drives(NamedTuple):
    """Drive parameters of all rows.

    Attributes:
        bias: In [rad/s] or [m/s]. Shape (n,).
        noise: In [rad/s] or [m/s]. Shape (n,).
        backlash: In [rad] or [m]. Shape (n,).
        fraction: Part of a delay beyond whole steps. Shape (n,).
        coefficients: Of drives of low order, see :attr:`ikgym.Plant.drive`. Shape (n, 7), or (0, 7) without.
        gain: Factors of the velocities. Shape (n,).
        free: See :func:`ikgym.plant.drive_kernels.swing_link`. Shape (n, 4), or (0, 4) without resonances.
        prismatic: True where a joint is prismatic. Shape (n,).
        payload_step: Steps made when the payload is taken up.
    """

    bias: Floats
    noise: Floats
    backlash: Floats
    fraction: Floats
    coefficients: Floats
    gain: Floats
    free: Floats
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
        lag: The share of the gap to a commanded velocity that a step closes, 1 without lag. Shape (N, n).
        delay: Whole steps after which a command reaches the drive. Shape (N, n).
        pose_noise: Standard deviation of each part of a measured position, in [m]. Shape (N,).
        pose_rotation_noise: The same of the rotation vector of the orientation, in [rad]. Shape (N,).
        pose_every: Steps from one measurement of the pose to the next. Shape (N,).
        drive: Velocities of the drives in [rad/s] or [m/s]. Shape (N, n).
        play: How far drives are from the middle of their backlash, in [rad] or [m]. Shape (N, n).
        past: Past of drives of low order, see :func:`ikgym.plant.drive_kernels.respond`. Shape (N, n or 0, 6).
        swing: See :func:`ikgym.plant.drive_kernels.swing_link`. Shape (N, n or 0, 3).
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
    past: Floats
    swing: Floats
    commands: Floats
    q: Floats
    pose: Floats
    shown: Floats
    shown_step: Integers


@kernel
def step(
    # Chain.
    offsets,
    axes,
    prismatic,
    tool,
    tool_rotation,
    # Constants.
    kind,
    dt,
    velocity_limit,
    steps,
    point,
    counted,
    preview,
    limits,
    # CostParameters.
    delta_x,
    p_x,
    delta_qdot,
    p_out,
    p_in,
    # State, changed in place.
    actions,
    q,
    qdot,
    steps_made,
    frames,
    # Of the plant.
    plants,
    contacts,
    # The command.
    numbers,
    active,
    moving,
    start,
    stop,
):
    """Steps the active rows and writes their outcome.

    Everything that happens in a step happens here, row by row, so that one environment, many of them in a loop and the
    native vector environment agree bit for bit, whatever the number of threads.

    The tuples are taken apart by the caller, since this is called once a step: a call with 32 values takes 3.5 µs, with
    the same values in four named tuples 8.2 µs (medians on one machine, by empty kernels). And numba counts references
    at each access to a part of a tuple, which in the loop over rows takes longer than the kinematics. The plant, which
    most scenarios do not have, stays in its tuples.

    The arguments are the fields of :class:`Chain` (of the arm in the data sheet, which moves where the plant is ideal),
    :class:`Constants`, :class:`CostParameters` and :class:`State`. Then come, in one tuple, :class:`Drives`,
    :class:`Sensors`, the :class:`ikgym.plant.arm_kernels.Arms` of the rows and :class:`PlantState`; where the plant is
    ideal ``()``, for which numba leaves out all that stands under a test of its length. Then
    :class:`ikgym.plant.contact.Contacts`, None where touching does not matter. The command is the block of an outcome,
    written in place; the rows to step, of shape (N,); whether they move or are observed where they are; the first row,
    and the row after the last.
    """
    chain = Chain(offsets, axes, prismatic, tool, tool_rotation)
    constants = Constants(kind, dt, velocity_limit, steps, point, counted, preview, limits)
    cost = CostParameters(delta_x, p_x, delta_qdot, p_out, p_in)
    state = State(actions, q, qdot, steps_made, frames)
    rows, n = q.shape
    p = preview.shape[0]
    if len(plants) == 0:  # ideal
        drives, sensors, arms, plant, more = (), (), (), (), ()
        shown = _parts(numbers, rows, n, (numbers.shape[0] // rows - 2 * n - 9) // (p + 1), p)
    else:
        drives, sensors, arms, plant = plants
        m = plant.shown.shape[1]
        usual = rows * _size(n, m, p)
        o = 0 if contacts is None else contacts.shown
        h = ((numbers.shape[0] - usual) // rows - _more_size(n, m, 0, o)) // n
        shown, more = _parts(numbers, rows, n, m, p), _more_parts(numbers[usual:], rows, n, m, h, o)
    m = shown.pose.shape[1]
    scratch = np.empty(12 + m + error_size(kind, m))
    of_plant = drives, sensors, arms, plant
    _rows(chain, constants, cost, state, *of_plant, contacts, scratch, shown, more, active, moving, start, stop)


@uncounted
def _rows(
    chain,
    constants,
    cost,
    state,
    drives,
    sensors,
    arms,
    plant,
    contacts,
    scratch,
    shown,
    more,
    active,
    moving,
    start,
    stop,
):
    """The rows of :func:`step`, with the parts of the outcome in two tuples; the second is () for an ideal plant."""
    q, qdot, m = state.q, state.qdot, shown.pose.shape[1]
    rotation, position = scratch[:9].reshape(3, 3), scratch[9:12]
    nominal, error = scratch[12 : 12 + m], scratch[12 + m :]
    for row in range(start, stop):
        if not active[row]:
            continue
        shown.clipped[row] = 0.0
        shown.at_limit[row, 0] = shown.at_limit[row, 1] = shown.at_limit[row, 2] = 0.0
        if moving:
            if contacts is not None:
                for j in range(q.shape[1]):
                    contacts.before[row, j] = q[row, j]
            _move(constants, drives, state, plant, row, shown.clipped, shown.at_limit)
            state.step[row] += 1
        if len(plant) == 0:  # ideal
            arm, true_q, true_pose = chain, shown.q, shown.pose
        else:
            k = state.step[row]
            loaded = 1 if k >= drives.payload_step else 0
            drawn = row if arms.offsets.shape[0] > 1 else 0
            arm = Chain(
                arms.offsets[drawn, loaded],
                arms.axes[drawn, loaded],
                drives.prismatic,
                arms.tool[drawn, loaded],
                arms.tool_rotation[drawn, loaded],
            )
            true_q, true_pose = more.true_q, more.true_pose
            if contacts is not None:
                _meet(contacts, arm, state, plant, row, loaded, moving, k == drives.payload_step)
                _show_contacts(contacts, row, k, constants.counted[k], more)
            else:
                more.clearance[row], more.stopped[row], more.proximity_cost[row] = math.inf, 0.0, 0.0
                more.pair[row, 0] = more.pair[row, 1] = -1.0
        for j in range(q.shape[1]):
            true_q[row, j] = q[row, j]
            shown.qdot[row, j] = qdot[row, j]
        forward(arm, q[row], rotation, position)
        show_row(constants, cost, state, row, true_pose[row], (rotation, position, nominal, error), shown)
        if len(plant) > 0:
            _show_commands(constants.limits, plant.commands, row, state.step[row], more.commands)
            _sense(sensors, plant, constants.kind, state, row, (rotation, position), shown, more)


@inlined
def _meet(contacts, chain, state, plant, row, loaded, moving, loading):
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
        q[row, j], qdot[row, j] = before[j], 0.0
        hold(plant, row, j, 0.0, 1.0)
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
def _move(constants, drives, state, plant, row, clipped, at_limit):
    """Moves the joints of a row, with the effects in the order that :class:`ikgym.Plant` states."""
    dt, velocity_limit, limits = constants.dt, constants.velocity_limit, constants.limits
    q, qdot, limited = state.q, state.qdot, constants.limits.shape[0] > 0
    n, now = q.shape[1], state.step[row]
    place = now % plant.commands.shape[1] if len(plant) > 0 else 0
    for j in range(n):
        applied = to_command(state.actions[row, j], velocity_limit[j], clipped, row)
        if len(plant) > 0:
            plant.commands[row, place, j] = applied
            delay = plant.delay[row, j]
            applied = recall(plant.commands, row, now, place, delay, j)
            if drives.fraction[j] != 0.0:
                before = recall(plant.commands, row, now, place, delay + 1, j)
                applied += drives.fraction[j] * (before - applied)
        slack = SLACK * velocity_limit[j]
        if limited:
            applied = limit_command(limits, j, applied, qdot[row, j], slack, at_limit, row)
        velocity = applied
        if len(plant) > 0:
            if plant.lag[row, j] < 1.0:
                velocity = lag_behind(plant.drive, row, j, plant.lag[row, j], applied)
            if drives.coefficients.shape[0] > 0:
                velocity = respond(drives.coefficients, plant.past, row, j, velocity)
            velocity *= drives.gain[j]
            key = plant.keys[row, NOISE]
            velocity = disturb(velocity, drives.bias[j], drives.noise[j], key, counter_of(now, n, j))
        way = dt * velocity
        if len(plant) > 0:
            way = engage(plant.play, row, j, drives.backlash[j], way)
            if drives.free.shape[0] > 0:
                way = swing_link(drives.free, plant.swing, row, j, way, dt)
        reached = q[row, j] + way  # Varga 2021, eq. 5
        if limited and not limits[LOWER, j] <= reached <= limits[UPPER, j]:
            reached, applied = stop_at_limit(limits, j, q[row, j], reached, dt)
            at_limit[row, 0] += abs(velocity - applied) > slack
            if len(plant) > 0:
                hold(plant, row, j, applied, drives.gain[j])
        q[row, j], qdot[row, j] = reached, applied


@inlined
def _show_commands(limits, commands, row, now, out):
    """Shows the last commands within the velocity limit. ``out`` has shape (N, h, n)."""
    for i in range(out.shape[1]):
        place = (now - 1) % commands.shape[1]
        for j in range(out.shape[2]):
            command = recall(commands, row, now - 1, place, i, j)
            out[row, i, j] = clip(command, limits[FASTEST, j]) if limits.shape[0] > 0 else command


@inlined
def _sense(sensors, plant, kind, state, row, frame, shown, more):
    """Writes the measurements of the sensors; called last, since the noise is added to the pose in place."""
    now, (rotation, position) = state.step[row], frame
    more.q_age[row, 0] = measure_q(sensors, plant, row, now, state.q, shown.q)
    arrived = measure_pose(sensors, plant, row, kind, now, rotation, position)
    if arrived >= 0:
        plant.shown_step[row] = arrived
    more.pose_age[row, 0] = now - plant.shown_step[row]
    for i in range(plant.shown.shape[1]):
        shown.pose[row, i] = plant.shown[row, i]
