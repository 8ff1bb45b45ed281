"""Kernels: the clearance of a joint path, a limit of the interior point method like those of the joints.

At each knot the signed distance d of every pair of bodies that is near must not fall below a margin. This is a limit
u <= 0 with u = (margin - d) / SCALE, and is φ(u) in the barrier function, see :mod:`terms`; its curvature along
the gradient of d is that of φ, and the curvature of d itself is left out (Gauss–Newton). Pairs come and go as the path
changes: the part of φ that a pair has at the influence distance, with its slope and its curvature there, is taken off,
so that no pair makes a jump.
"""

from __future__ import annotations

import numpy as np

from baselines.solvers.receding_horizon.newton.terms import (
    BARRIER_SIZE,
    BEYOND,
    one_side,
    primal_dual_curvature,
    smooth,
)
from baselines.solvers.receding_horizon.newton.workspace import joints_at
from ikgym.kernels.bodies import gradient, nearest, place, smallest
from ikgym.kernels.jit import inlined, uncounted

# Unit of clearances in [m], as velocities have their limit.
SCALE = 1e-3
# The weight w of clearances, in units of that of limits: pushed against a body, a path may save many costs.
WEIGHT = 10.0
# Bodies that come so near within a step, in [m], count as touching.
TOUCHING = 1e-5
# How often a first step is slowed down before the arm brakes.
SLOWER = 5
# A pair that was not near before the step has no multiplier yet.
NEW = -1.0


@inlined
def boxes_at(clearance, step):
    """The row of the obstacles a number of steps from now."""
    return min(step, clearance.boxes.shape[0] - 1)


@uncounted
def find_pairs(clearance, chain, q, step, work):
    """The pairs that are near at a configuration some steps from now, which the workspace receives; how many."""
    place(chain, clearance.shapes, q, work.joints, work.placed)
    near, boxes = (work.distances, work.found, work.vectors), clearance.boxes[boxes_at(clearance, step)]
    return nearest(clearance.shapes, boxes, clearance.checked, work.placed, work.core, clearance.influence, near)


@uncounted
def least_clearance(clearance, chain, q, step, work):
    """The smallest signed distance at a configuration some steps from now, in [m]."""
    place(chain, clearance.shapes, q, work.joints, work.placed)
    boxes = clearance.boxes[boxes_at(clearance, step)]
    return smallest(clearance.shapes, boxes, clearance.checked, work.placed, work.core, work.found[0])


@inlined
def _at_influence(clearance, weight, mu):
    """Where the influence of a pair begins: u, and φ with its slope and its curvature there."""
    u = (clearance.margin - clearance.influence) / SCALE
    here = smooth(u, weight, mu)
    return u, here.value, here.gradient, primal_dual_curvature(here, weight, here.gradient)


@uncounted
def clearance_value(clearance, problem, path, barrier, workspace):
    """The barriers of all near pairs; 0 where there is no :class:`bodies.Clearance`."""
    if clearance is None:
        return 0.0
    work, chain, total = workspace.clearance, problem.data.chain, 0.0
    weight, mu = WEIGHT * barrier.limit_weight, barrier.mu
    far, value, slope, curvature = _at_influence(clearance, weight, mu)
    for k in range(path.shape[0]):
        q = joints_at(problem, path, k, workspace.knot)
        for i in range(find_pairs(clearance, chain, q, problem.grid.at[k], work)):
            u = (clearance.margin - work.distances[i]) / SCALE
            total += smooth(u, weight, mu).value - value - (slope + 0.5 * curvature * (u - far)) * (u - far)
    return total


@uncounted
def add_clearance(clearance, problem, path, barrier, advance, workspace):
    """Adds :func:`clearance_value` to the quadratic model, and gives it; the arguments are those of ``linearise``."""
    if clearance is None:
        return 0.0
    work, model, chain = workspace.clearance, workspace.model, problem.data.chain
    weight, mu, total, by_joints = WEIGHT * barrier.limit_weight, barrier.mu, 0.0, work.gradient
    far, value, slope, curvature = _at_influence(clearance, weight, mu)
    for k in range(path.shape[0]):
        count = find_pairs(clearance, chain, joints_at(problem, path, k, workspace.knot), problem.grid.at[k], work)
        _take_over(work, k, count, advance)
        for i in range(count):
            pair = work.found[i]
            gradient(chain.prismatic, clearance.shapes, work.joints, pair[0], pair[1], work.vectors[i], by_joints)
            u = (clearance.margin - work.distances[i]) / SCALE
            known = work.barriers[k, i, 0, BEYOND] < np.inf
            here = one_side(work.barriers, k, i, 0, u, weight, mu, advance if known else NEW)
            total += here.value - value - (slope + 0.5 * curvature * (u - far)) * (u - far)
            first = (slope + curvature * (u - far) - here.gradient) / SCALE
            curved = max(here.curvature - curvature, 0.0) / (SCALE * SCALE)
            for a in range(path.shape[1]):
                model.gradient[k, a] += first * by_joints[a]
                for b in range(a + 1):
                    model.diagonal[k, a, b] += curved * by_joints[a] * by_joints[b]
    return total


@inlined
def _take_over(work, k, count, advance):
    """Makes the near pairs those of knot ``k``; pairs that were near before the step bring their barriers along."""
    known = work.counts[k] if advance >= 0.0 else 0
    for i in range(known):
        for c in range(BARRIER_SIZE):
            work.before[i, c] = work.barriers[k, i, 0, c]
    for i in range(count):
        work.barriers[k, i, 0, BEYOND] = np.inf
        for o in range(known):
            if work.pairs[k, o, 0] == work.found[i, 0] and work.pairs[k, o, 1] == work.found[i, 1]:
                for c in range(BARRIER_SIZE):
                    work.barriers[k, i, 0, c] = work.before[o, c]
    for i in range(count):
        work.pairs[k, i, 0], work.pairs[k, i, 1] = work.found[i, 0], work.found[i, 1]
    work.counts[k] = count


@uncounted
def clearance_left(clearance, work, knots, slack):
    """Whether a pair at one of K knots is nearer than the margin by more than a share of its scale."""
    if clearance is None:
        return False
    for k in range(knots):
        for i in range(work.counts[k]):
            if work.barriers[k, i, 0, BEYOND] > slack:
                return True
    return False


@uncounted
def clearance_excess(clearance, problem, path, workspace):
    """By how much a path comes nearer than the margin at its knots, in units of SCALE; below 0 where it does not."""
    if clearance is None:
        return -np.inf
    work, chain, least = workspace.clearance, problem.data.chain, np.inf
    for k in range(path.shape[0]):
        q = joints_at(problem, path, k, workspace.knot)
        least = min(least, least_clearance(clearance, chain, q, problem.grid.at[k], work))
    return (clearance.margin - least) / SCALE


@uncounted
def wait_clear(clearance, problem, first, path, workspace):
    """Makes a path wait in front of a body that it would touch, from knot ``first`` on; in place."""
    if clearance is None:
        return
    work, chain = workspace.clearance, problem.data.chain
    for k in range(first, path.shape[0]):
        if least_clearance(clearance, chain, path[k], problem.grid.at[k], work) < clearance.margin:
            for j in range(path.shape[1]):
                path[k, j] = path[k - 1, j] if k > 0 else problem.start[j]


@uncounted
def keep_clear(clearance, problem, qdot, work):
    """Slows the first step of a plan down until it touches nothing, within the limits of acceleration; in place.

    Args:
        clearance: See :class:`workspace.PathProblem`.
        problem: See :mod:`newton`.
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (n,).
        work: The :class:`bodies.ClearanceWorkspace`.

    Returns:
        Whether the step was clear.
    """
    if clearance is None:
        return True
    data, before, changes = problem.data, problem.qdot_before, problem.change_limit
    if is_clear(clearance, data.chain, problem.start, qdot, data.dt, work):
        return True
    for trial in range(SLOWER):
        share = 0.5 if trial < SLOWER - 1 else 0.0
        for j in range(qdot.shape[0]):
            slower = share * qdot[j]
            qdot[j] = min(max(slower, before[j] - changes[j]), before[j] + changes[j])
        if is_clear(clearance, data.chain, problem.start, qdot, data.dt, work):
            break
    return False


@uncounted
def is_clear(clearance, chain, q, qdot, dt, work):
    """Whether nothing touches in the step that begins at q, in which all joints move evenly.

    A distance changes by no more than the joints move: where two configurations are farther from touching than
    that, nothing touches in between. Obstacles are where they will be after the step.

    Args:
        clearance: The :class:`Clearance`; None where nothing touches.
        chain: The arm.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (n,).
        dt: Δt in [s].
        work: The :class:`ClearanceWorkspace`.
    """
    if clearance is None:
        return True
    way = dt * _fastest(clearance, qdot)
    share, here = 0.0, least_clearance(clearance, chain, q, 1, work)
    for j in range(q.shape[0]):
        work.between[j] = q[j] + dt * qdot[j]
    there = least_clearance(clearance, chain, work.between, 1, work)
    while here > TOUCHING and there > TOUCHING:
        if here + there > way * (1.0 - share):
            return True
        share += here / way
        for j in range(q.shape[0]):
            work.between[j] = q[j] + share * dt * qdot[j]
        here = least_clearance(clearance, chain, work.between, 1, work)
    return False


@inlined
def _fastest(clearance, qdot):
    """How fast a body moves at most, in [m/s]; of a pair on the arm only the joints in between count."""
    most = 0.0
    for body in range(clearance.sweep.shape[0]):
        speed = 0.0
        for j in range(qdot.shape[0]):
            speed += clearance.sweep[body, j] * abs(qdot[j])
        most = max(most, speed)
    return most
