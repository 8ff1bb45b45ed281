"""The problem of a joint path as its kernels see it, and the arrays that they work in."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy_kernels import Model
from baselines.solvers.receding_horizon.newton.bodies import Clearance, ClearanceWorkspace, clearance_workspace
from baselines.solvers.receding_horizon.newton.grid import Grid
from baselines.solvers.receding_horizon.newton.terms import BARRIER_SIZE
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import expanded, inner

Floats = npt.NDArray[np.float64]

# Of problems in which changes of velocity cost nothing.
NO_VELOCITY: Floats = np.zeros(0)
# Of problems without a payload.
NO_LOAD: Floats = np.zeros((0, 0))


class PathProblem(NamedTuple):
    """Start, reference and knots of the joint path that is sought.

    Attributes:
        data: Arm, task, cost and limits.
        grid: The time grid, of K knots.
        start: Joint coordinates now, in [rad] or [m]. Shape (n,).
        nominal: Nominal task coordinates 1, 2, … steps ahead. Shape (at least grid.at[-1], m).
        joint_weights: Factors of the velocity costs of the joints. Shape (n,).
        qdot_before: Joint velocities of the step that has passed, in [rad/s] or [m/s]; read where changes of velocity
            cost something. Shape (n,).
        rate_weight: Weight of changes of velocity, in [cost] / [(rad/s)²] or [cost] / [(m/s)²]; see :mod:`cost`.
        change_limit: Largest changes of the joint velocities in one step, in [rad/s] or [m/s]; inf where a joint has
            none. Shape (n,), for the interior point method, or (0,), for multipliers, which cannot limit them.
        braking: Whether the arm has to be able to stop within its joint limits behind the last knot; read where
            accelerations have a limit.
        load: Offset of the joint zeros by a payload at each knot, in [rad] or [m]. Shape (K, n), or (0, n)
            where there is none.
        clearance: Bodies that must not touch, for the interior point method; None where they may.
    """

    data: Model
    grid: Grid
    start: Floats
    nominal: Floats
    joint_weights: Floats
    qdot_before: Floats = NO_VELOCITY
    rate_weight: float = 0.0
    change_limit: Floats = NO_VELOCITY
    braking: bool = False
    load: Floats = NO_LOAD
    clearance: Clearance | None = None


class KnotWorkspace(NamedTuple):
    """Arrays that the knots of a path use one after the other.

    Attributes:
        rotation: Orientation of the tool. Shape (3, 3).
        position: The tool point in [m]. Shape (3,).
        geometric: The geometric Jacobian. Shape (6, n).
        pose: Task coordinates. Shape (m,).
        error: Tracking error. Shape (e,).
        jacobian: Jacobian of the task coordinates. Shape (m or 6, n).
        error_jacobian: Jacobian of the error. Shape (e, n).
        gradient: Derivatives of the cost by the components of the error. Shape (e,).
        moment: The gradient by the orientation, see :func:`second_order.set_moment`. Shape (3, 3).
        penalty_factor: Factor of the penalties of the limits. Shape (1,).
        gram: Of damped least squares. Shape (e, e).
        solution: Of damped least squares. Shape (e,).
        loaded: Joint coordinates with a payload. Shape (n,).
    """

    rotation: Floats
    position: Floats
    geometric: Floats
    pose: Floats
    error: Floats
    jacobian: Floats
    error_jacobian: Floats
    gradient: Floats
    moment: Floats
    penalty_factor: Floats
    gram: Floats
    solution: Floats
    loaded: Floats


class QuadraticModel(NamedTuple):
    """Gradient and Hessian of the merit function at a path.

    The Hessian is block-tridiagonal, and block-pentadiagonal where changes of velocity cost something.

    Attributes:
        gradient: Shape (K, n).
        diagonal: Gauss–Newton part of the diagonal blocks, lower triangles. Shape (K, n, n).
        second: Second-order part of the Hessian: Σ gradient_i ∂²error_i, lower triangles. Shape (K, n, n).
        coupling: The block between a knot and the one before is diagonal: its negative. Shape (K, n).
        far: The block between a knot and the one two before, diagonal as well. Shape (K, n).
        filled: Scratch of :mod:`newton_step`: blocks next to the diagonal, filled up. Shape (K, n, n).
        product: Scratch likewise. Shape (n, n).
    """

    gradient: Floats
    diagonal: Floats
    second: Floats
    coupling: Floats
    far: Floats
    filled: Floats
    product: Floats


class NewtonWorkspace(NamedTuple):
    """Arrays of Newton's method, for paths of up to K knots.

    Attributes:
        knot: Arrays of one knot.
        errors: Tracking errors of all knots. Shape (K, e).
        model: The quadratic model.
        inverse: Inverses of the pivots. Shape (K, n, n).
        factor: A pivot and its factor. Shape (n, n).
        step: The Newton step. Shape (K, n).
        trial: The path at a trial step length. Shape (K, n).
        before: Velocities of the block before, in [rad/s] or [m/s]. Shape (n,).
        barriers: Where accelerations are limited, the barriers (see :mod:`interior_point`) of the knots' errors, then
            of their velocities, changes of velocity and positions, at the upper and at the lower bound.
            Shape (K or 0, e + 3 n, 2, 4).
        clearance: Arrays for bodies that must not touch; None where they may.
    """

    knot: KnotWorkspace
    errors: Floats
    model: QuadraticModel
    inverse: Floats
    factor: Floats
    step: Floats
    trial: Floats
    before: Floats
    barriers: Floats
    clearance: ClearanceWorkspace | None


@expanded
def joints_at(problem, path, k, knot):
    """The joint coordinates that the kinematics see at a knot: those of the path, with the payload where there is one.

    Args:
        problem: A :class:`PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        k: The knot.
        knot: A :class:`KnotWorkspace`.
    """
    q = path[k]
    if problem.load.shape[0] > 0:
        for j in range(q.shape[0]):
            knot.loaded[j] = q[j] + problem.load[k, j]
        q = knot.loaded
    return q


# Arrays of the same shape are parts of one: an allocation takes 40 ns, and all of them once took 0.9 µs of a `predict`.


@inner
def knot_workspace(kind, m, n):
    """The workspace of one knot, for task coordinates of ``m`` numbers and ``n`` joints."""
    e = task_kernels.error_size(kind, m)
    rotations, vectors, jacobians = np.empty((2, 3, 3)), np.empty((3, e)), np.empty((2, e, n))
    return KnotWorkspace(
        rotations[0],
        np.empty(3),
        np.empty((6, n)),
        np.empty(m),
        vectors[0],
        jacobians[0],
        jacobians[1],
        vectors[1],
        rotations[1],
        np.ones(1),
        np.empty((e, e)),
        vectors[2],
        np.empty(n),
    )


@inner
def newton_workspace(kind, m, knots, n, limited=False, clearance=None):
    """The workspace for paths of up to ``knots`` knots, task coordinates of ``m`` numbers and ``n`` joints.

    Args:
        kind: The kind of task coordinates.
        m: Their number.
        knots: K.
        n: Joints.
        limited: Whether accelerations are limited.
        clearance: Bodies that must not touch; None where they may.
    """
    e = task_kernels.error_size(kind, m)
    vectors, blocks, squares = np.empty((5, knots, n)), np.empty((4, knots, n, n)), np.empty((2, n, n))
    return NewtonWorkspace(
        knot_workspace(kind, m, n),
        np.empty((knots, e)),
        QuadraticModel(vectors[0], blocks[0], blocks[1], vectors[1], vectors[2], blocks[2], squares[0]),
        blocks[3],
        squares[1],
        vectors[3],
        vectors[4],
        np.empty(n),
        np.zeros((knots if limited else 0, e + 3 * n, 2, BARRIER_SIZE)),
        clearance_workspace(clearance, knots, n),
    )
