"""Kernels: the bodies of drawn arms, and motions that are not made since they would bring bodies together."""

from __future__ import annotations

import math
from typing import NamedTuple

from ikgym.kernels.bodies import Floats, Integers, Shapes, place, smallest
from ikgym.kernels.cost import ProximityParameters
from ikgym.kernels.jit import inlined, kernel, uncounted
from ikgym.kernels.random_numbers import stream
from ikgym.kernels.simulation import Flags
from ikgym.plant.arm_kernels import ZERO, turn, zero_of

# Bodies that come so near within a step, in [m], count as touching: a certificate of clearance needs a limit.
TOUCHING = 1e-6


class Contacts(NamedTuple):
    """Bodies and obstacles of N arms, their clearances and stops.

    Attributes:
        links: See :class:`ikgym.kernels.bodies.Shapes`. Shape (k,).
        radii: The same, in [m]. Shape (k,).
        sizes: The same, in [m]. Shape (k,).
        pairs: The same. Shape (p, 2).
        sweep: How far a joint moves a body's core at most, in [m] per unit of joint coordinate. Shape (k, n).
        checked: Whether a body may not touch an obstacle. Shape (o, k).
        boxes: Obstacles after 0, 1, … steps, of each row or of all, at rest or not.
            Shape (N or 1, steps + 2 or 1, o, 16).
        drift: How far an obstacle moves at most in the step after so many, in [m]. Shape (steps + 2 or 1,).
        shown: Obstacles that observations show: o or 0.
        proximity: The shape of its cost.
        starts: In the frames of the links, without the payload and with it, in [m]. Shape (N, 2, k, 3).
        ends: The same. Shape (N, 2, k, 3).
        distance: Smallest signed distance in [m]. Shape (N,).
        pair: The nearest pair: a body, and another body or k plus the number of an obstacle. Shape (N, 2).
        stopped: Whether the arm has touched something, and stands still. Shape (N,).
        before: Joint coordinates before the step in [rad] or [m]; worked with. Shape (N, n).
        between: Joint coordinates within the step; worked with. Shape (N, n).
        joints: Worked with. Shape (N, n, 6).
        placed: Worked with. Shape (N, k, 9).
        moving: Obstacles within the step; worked with. Shape (N, o, 16).
        core: Worked with. Shape (N, 6).
    """

    links: Integers
    radii: Floats
    sizes: Floats
    pairs: Integers
    sweep: Floats
    checked: Flags
    boxes: Floats
    drift: Floats
    shown: int
    proximity: ProximityParameters
    starts: Floats
    ends: Floats
    distance: Floats
    pair: Integers
    stopped: Flags
    before: Floats
    between: Floats
    joints: Floats
    placed: Floats
    moving: Floats
    core: Floats


@inlined
def place_of_boxes(contacts, row, step):
    """Where the obstacles of a row after so many steps are among the boxes."""
    return row % contacts.boxes.shape[0], min(step, contacts.boxes.shape[1] - 1)


@inlined
def _smallest(contacts, chain, row, loaded, q, boxes, found):
    starts, ends = contacts.starts[row, loaded], contacts.ends[row, loaded]
    shapes = Shapes(contacts.links, starts, ends, contacts.radii, contacts.sizes, contacts.pairs)
    place(chain, shapes, q, contacts.joints[row], contacts.placed[row])
    return smallest(shapes, boxes, contacts.checked, contacts.placed[row], contacts.core[row], found)


@uncounted
def measure(contacts, chain, row, loaded, step, q):
    """Measures the clearance of a row where it is.

    Args:
        contacts: A :class:`Contacts`.
        chain: The row's arm, a :class:`ikgym.kernels.kinematics.Chain`.
        row: Its number.
        loaded: 1 where it has its payload, 0 elsewhere.
        step: Steps made.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
    """
    contacts.pair[row, 0] = contacts.pair[row, 1] = -1
    table, at = place_of_boxes(contacts, row, step)
    contacts.distance[row] = _smallest(contacts, chain, row, loaded, q, contacts.boxes[table, at], contacts.pair[row])


@uncounted
def touches(contacts, chain, row, loaded, step, q):
    """Whether bodies of a row touch in its last step, in which joints and obstacles move evenly.

    Where they do not, the clearance at the end of the step is known afterwards; where they do, the pair is. Distances
    change by no more than joints and obstacles move: between two configurations that are farther from contact
    than that, nothing touches.

    Args:
        contacts: A :class:`Contacts`, with the joint coordinates before the step.
        chain: The row's arm, a :class:`ikgym.kernels.kinematics.Chain`.
        row: Its number.
        loaded: 1 where it has its payload, 0 elsewhere.
        step: Steps made, this one included.
        q: Joint coordinates after the step in [rad] or [m]. Shape (n,).
    """
    way = _way(contacts, row, step, q)
    last, before, between = contacts.distance[row], contacts.before[row], contacts.between[row]
    pair = contacts.pair[row]
    pair[0] = pair[1] = -1
    table, at = place_of_boxes(contacts, row, step)
    contacts.distance[row] = distance = _smallest(contacts, chain, row, loaded, q, contacts.boxes[table, at], pair)
    share = 0.0
    while distance > TOUCHING and last > TOUCHING:
        if last + distance > way * (1.0 - share):
            return False
        share += last / way
        for j in range(q.shape[0]):
            between[j] = before[j] + share * (q[j] - before[j])
        _move_boxes(contacts.boxes[table], at, share, contacts.moving[row])
        last = _smallest(contacts, chain, row, loaded, between, contacts.moving[row], pair)
    return True


@inlined
def _way(contacts, row, step, q):
    """How much nearer bodies may come to each other or to obstacles in a step, in [m]."""
    most, before = 0.0, contacts.before[row]
    for body in range(contacts.links.shape[0]):
        way = 0.0
        for j in range(contacts.links[body]):
            way += contacts.sweep[body, j] * abs(q[j] - before[j])
        most = max(most, way)
    return most + contacts.drift[min(step - 1, contacts.drift.shape[0] - 1)]


@inlined
def _move_boxes(boxes, at, share, out):
    """Obstacles at a share of the step that ends at some row of a table, or those that are at rest."""
    before = max(at - 1, 0)
    for i in range(out.shape[0]):
        for c in range(out.shape[1]):
            out[i, c] = boxes[before, i, c] + share * (boxes[at, i, c] - boxes[before, i, c])


@kernel
def turn_bodies(spread, keys, rows, calibration, load, axes, links, ends, out):
    """Turns bodies by the zeros of the joints before them, as links are turned where arms are drawn.

    Args:
        spread: A :class:`ikgym.plant.arm_kernels.Spread`.
        keys: One a row that is drawn. Shape (k,).
        rows: Which rows they are. Shape (k,).
        calibration: Factors of zeros. Shape (k,).
        load: Factors of the payload. Shape (k,).
        axes: Axes of the drawn arms. Shape (N or 1, 2, n, 3).
        links: Links of the b bodies. Shape (b,).
        ends: Both ends of the bodies in the frames of the links, in [m]. Shapes (b, 3).
        out: Receives both ends. Shapes (N, 2, b, 3).
    """
    for i in range(keys.shape[0]):
        of_zeros = stream(keys[i], ZERO)
        for loaded in range(2):
            for body in range(links.shape[0]):
                for end in range(2):
                    point = out[end][rows[i], loaded, body]
                    for c in range(3):
                        point[c] = ends[end][body, c]
                    for j in range(links[body]):
                        zero = zero_of(spread, of_zeros, j, loaded, calibration[i], load[i])
                        if zero != 0.0 and not spread.prismatic[j]:
                            s, half = math.sin(zero), math.sin(0.5 * zero)
                            axis = axes[rows[i] % axes.shape[0], loaded, j]
                            turn((axis[0], axis[1], axis[2]), s, 2.0 * half * half, point)
