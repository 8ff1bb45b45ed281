"""Kernels: boxes drawn at random around a joint motion that stays clear of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym.kernels.bodies import PLACED, of_obstacle, place
from ikgym.kernels.jit import kernel, uncounted
from ikgym.kernels.random_numbers import share, stream, uniform

Floats = npt.NDArray[np.float64]

#: Most attempts to draw a box.
TRIES = 1000
# Steps that are looked at first.
FIRST = 33
# Random numbers that a box takes: edges, angle, step, body, place along it, direction and distance from there.
NUMBERS = 10


class Drawing(NamedTuple):
    """The distribution of boxes, see :class:`ikgym.obstacles.random_boxes.RandomBoxes`.

    Attributes:
        lower: Of the centres in [m]. Shape (3,).
        upper: Of the centres in [m]. Shape (3,).
        smallest: Edges in [m]. Shape (3,).
        largest: Edges in [m]. Shape (3,).
        margin: Least distance from the motion, in [m].
        within: Largest distance of its nearest point, in [m].
    """

    lower: Floats
    upper: Floats
    smallest: Floats
    largest: Floats
    margin: float
    within: float


@kernel
def draw_boxes(chain, shapes, checked, bends, drawing, paths, keys, out, found):
    """Draws boxes around several joint motions, each box anew until the motion is clear of it.

    Args:
        chain: The arm, a :class:`ikgym.kernels.kinematics.Chain`.
        shapes: Its bodies, :class:`ikgym.kernels.bodies.Shapes`.
        checked: Whether a body may not touch a box. Shape (b,).
        bends: Bounds of the second derivatives of points of each body by two joint coordinates, in [m] per unit of
            both. Shape (b,).
        drawing: Their distribution, a :class:`Drawing`.
        paths: Joint coordinates at the steps in [rad] or [m]; straight on in between. Shape (k, t, n).
        keys: Of the random numbers. Shape (k,).
        out: Receives the boxes, see :class:`ikgym.kernels.bodies.Surroundings`. Shape (k, count, 16).
        found: Receives how many boxes have a place. Shape (k,).
    """
    steps, bodies = paths.shape[1], shapes.links.shape[0]
    joints, core = np.empty((paths.shape[2], 6)), np.empty(6)
    placed, travelled = np.empty((steps, bodies, PLACED)), np.empty((bodies, steps))
    for row in range(paths.shape[0]):
        for step in range(steps):
            place(chain, shapes, paths[row, step], joints, placed[step])
        _travel(placed, bends, paths[row], travelled)
        found[row] = 0
        for box in range(out.shape[1]):
            key = stream(keys[row], box)
            for attempt in range(TRIES):
                step = _draw(drawing, shapes, checked, placed, key, attempt * NUMBERS, out[row, box])
                if step < 0:
                    continue
                nearest = _at(shapes, checked, placed[step], out[row, box], core, drawing.margin)
                if not drawing.margin <= nearest <= drawing.within:
                    continue
                if _is_clear(shapes, checked, placed, travelled, out[row, box], core, drawing.margin):
                    found[row] += 1
                    break


@uncounted
def _travel(placed, bends, path, travelled):
    """Bounds of the ways that the points of each body have gone until each step, in [m].

    With joints that go straight on by d in all, a point leaves its chord by no more than bend d² / 8.
    """
    for step in range(1, path.shape[0]):
        turned = 0.0
        for j in range(path.shape[1]):
            turned += abs(path[step, j] - path[step - 1, j])
        for body in range(travelled.shape[0]):
            way = 0.0
            for end in range(0, 6, 3):
                square = 0.0
                for c in range(end, end + 3):
                    square += (placed[step, body, c] - placed[step - 1, body, c]) ** 2
                way = max(way, math.sqrt(square))
            travelled[body, 0] = 0.0
            travelled[body, step] = travelled[body, step - 1] + way + 0.25 * bends[body] * turned * turned


@uncounted
def _draw(drawing, shapes, checked, placed, key, first, box):
    """Draws an upright box near a body at some step; gives the step, -1 where the centre is outside the region."""
    diagonal = 0.0
    for c in range(3):
        edge = drawing.smallest[c] + share(key, first + c) * (drawing.largest[c] - drawing.smallest[c])
        box[12 + c] = 0.5 * edge
        diagonal += 0.25 * edge * edge
        box[c] = box[3 + c] = box[6 + c] = 0.0
    angle = math.pi * share(key, first + 3)
    box[0] = box[4] = math.cos(angle)
    box[3] = math.sin(angle)
    box[1] = -box[3]
    box[8] = 1.0
    box[15] = 0.0
    step, body = int(share(key, first + 4) * placed.shape[0]), int(share(key, first + 5) * placed.shape[1])
    if not checked[body]:
        return -1
    along, up, around = share(key, first + 6), uniform(key, first + 7), math.pi * uniform(key, first + 8)
    away = share(key, first + 9) * (shapes.radii[body] + math.sqrt(diagonal) + drawing.within)
    flat = math.sqrt(1.0 - up * up)
    box[9], box[10], box[11] = away * flat * math.cos(around), away * flat * math.sin(around), away * up
    inside = True
    for c in range(3):
        box[9 + c] += placed[step, body, c] + along * (placed[step, body, 3 + c] - placed[step, body, c])
        inside = inside and drawing.lower[c] <= box[9 + c] <= drawing.upper[c]
    return step if inside else -1


@uncounted
def _at(shapes, checked, placed, box, core, margin):
    """The distance of an arm from a box at one step; any below the margin if it is not kept."""
    least = math.inf
    for body in range(checked.shape[0]):
        if checked[body] and least >= margin:
            least = min(least, of_obstacle(shapes, placed, body, box, core)[0])
    return least


@uncounted
def _is_clear(shapes, checked, placed, travelled, box, core, margin):
    """Whether all bodies keep the margin from a box, at the steps and in between.

    Between two steps at which a body is d and e away, and travels no more than w, it stays (d + e - w) / 2 away. So
    steps that a body cannot come too near in are left out. Some steps are looked at first: most boxes are in the way of
    one.
    """
    last = placed.shape[0] - 1
    for i in range(FIRST):
        if _at(shapes, checked, placed[i * last // (FIRST - 1)], box, core, margin) < margin:
            return False
    for body in range(checked.shape[0]):
        step, distance = 0, margin
        if checked[body]:
            distance = of_obstacle(shapes, placed[0], body, box, core)[0]
        while checked[body] and step < last:
            after = step + 1
            while after < last and travelled[body, after + 1] - travelled[body, step] <= distance - margin:
                after += 1
            further = of_obstacle(shapes, placed[after], body, box, core)[0]
            between = 0.5 * (distance + further - (travelled[body, after] - travelled[body, step]))
            if between < margin or further < margin:
                return False
            step, distance = after, further
    return True
