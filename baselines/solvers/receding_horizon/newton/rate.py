"""Kernels: the cost of changes of velocity, which couples three knots.

Between a block of g steps and one of h steps the joint velocity changes by Δq̇, which is taken to need (g + h) / 2
steps: Σ (Δq̇)² over these steps is Δq̇² / ((g + h) / 2), exact where both are one step long. The block before the first
is the step that has passed.
"""

from __future__ import annotations

from ikgym.kernels.jit import inlined, uncounted


@inlined
def change(problem, path, k, j):
    """The change of velocity at the beginning of block ``k``, of joint ``j``, in [rad/s] or [m/s].

    Returns:
        The change, its derivative by the knot at the block's end, that by the knot two before (both in [1/s]), and the
        weight of its square.
    """
    lengths, dt, start = problem.grid.length, problem.data.dt, problem.start
    here = path[k - 1, j] if k > 0 else start[j]
    by_end = 1.0 / (lengths[k] * dt)
    length, by_beginning, velocity = 1.0, 0.0, problem.qdot_before[j]
    if k > 0:
        length, by_beginning = lengths[k - 1], 1.0 / (lengths[k - 1] * dt)
        velocity = (here - (path[k - 2, j] if k > 1 else start[j])) * by_beginning
    weight = problem.rate_weight / (0.5 * (length + lengths[k]))
    return (path[k, j] - here) * by_end - velocity, by_end, by_beginning, weight


@uncounted
def rate_cost(problem, path):
    """The cost of a path's changes of velocity. Shape (K, n)."""
    total = 0.0
    for k in range(path.shape[0]):
        for j in range(path.shape[1]):
            changed, _, _, weight = change(problem, path, k, j)
            total += weight * changed * changed
    return total


@uncounted
def add_rate_cost(problem, path, model):
    """Adds gradient and Hessian of :func:`rate_cost` to a quadratic model.

    Args:
        problem: A :class:`workspace.PathProblem` of K knots.
        path: Joint coordinates at the knots in [rad] or [m]. Shape (K, n).
        model: The :class:`workspace.QuadraticModel`, whose ``far`` is set.

    Returns:
        The cost.
    """
    gradient, diagonal, coupling, far = model.gradient, model.diagonal, model.coupling, model.far
    total = 0.0
    for k in range(path.shape[0]):
        for j in range(path.shape[1]):
            changed, a, c, weight = change(problem, path, k, j)
            total += weight * changed * changed
            twice = 2.0 * weight
            gradient[k, j] += twice * changed * a
            diagonal[k, j, j] += twice * a * a
            far[k, j] = twice * a * c if k > 1 else 0.0
            if k > 0:
                gradient[k - 1, j] -= twice * changed * (a + c)
                diagonal[k - 1, j, j] += twice * (a + c) * (a + c)
                coupling[k, j] += twice * a * (a + c)
            if k > 1:
                gradient[k - 2, j] += twice * changed * c
                diagonal[k - 2, j, j] += twice * c * c
                coupling[k - 1, j] += twice * c * (a + c)
    return total
