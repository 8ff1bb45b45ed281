"""Kernel: the Newton step of a block-tridiagonal quadratic model, in time linear in its knots."""

from __future__ import annotations

from baselines.solvers.linear_algebra import inverse_of_factor
from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.linear_algebra import cholesky


@uncounted
def newton_step(model, exact, damping, inverse, factor, step):
    """Solves (H + damping I) step = -gradient by blocks, from the first knot to the last and back.

    Args:
        model: The :class:`workspace.QuadraticModel`.
        exact: Whether to take the Hessian itself instead of its Gauss–Newton part.
        damping: Added to the diagonal.
        inverse: Receives the inverses of the pivots. Shape (at least K, n, n).
        factor: Scratch. Shape (n, n).
        step: Receives the step. Shape (K, n).

    Returns:
        False where the matrix is not positive definite; the step is of no use then.
    """
    knots, n = step.shape
    coupling = model.coupling
    for k in range(knots):
        pivot_of(model, exact, damping, k, factor, step[k])
        if k > 0:
            _eliminate(coupling[k], inverse[k - 1], step[k - 1], factor, step[k])
        if not cholesky(factor):
            return False
        inverse_of_factor(factor, inverse[k])
    for k in range(knots - 1, -1, -1):
        if k + 1 < knots:
            for a in range(n):
                step[k, a] += coupling[k + 1, a] * step[k + 1, a]
        multiply(inverse[k], factor, step[k])
    return True


@inlined
def _eliminate(coupling, inverse, rhs_before, pivot, rhs):
    """Eliminates the knot before: its Schur complement from the pivot, its share from the right-hand side.

    Args:
        coupling: The negative of the block's diagonal. Shape (n,).
        inverse: Inverse of the pivot before. Shape (n, n).
        rhs_before: The right-hand side before. Shape (n,).
        pivot: Lower triangle, changed in place. Shape (n, n).
        rhs: Changed in place. Shape (n,).
    """
    n = rhs.shape[0]
    for a in range(n):
        carried = 0.0
        for b in range(n):
            carried += inverse[a, b] * rhs_before[b]
        rhs[a] += coupling[a] * carried
        for b in range(a + 1):
            pivot[a, b] -= coupling[a] * inverse[a, b] * coupling[b]


@inlined
def pivot_of(model, exact, damping, k, pivot, rhs):
    """Knot ``k`` before anything is eliminated from it: its block of the Hessian, damped, and minus its gradient.

    Args:
        model: The :class:`workspace.QuadraticModel`.
        exact: Whether to take the Hessian itself instead of its Gauss–Newton part.
        damping: Added to the diagonal.
        k: Which knot.
        pivot: Receives the block's lower triangle. Shape (n, n).
        rhs: Receives minus the gradient. Shape (n,).
    """
    diagonal, second, gradient = model.diagonal[k], model.second[k], model.gradient[k]
    for a in range(rhs.shape[0]):
        for b in range(a + 1):
            pivot[a, b] = diagonal[a, b] + second[a, b] if exact else diagonal[a, b]
        pivot[a, a] += damping
        rhs[a] = -gradient[a]


@inlined
def multiply(matrix, scratch, vector):
    """The product of a matrix (n, n) and a vector (n,), in its place; ``scratch`` (n, n) holds it meanwhile."""
    n = vector.shape[0]
    for a in range(n):
        total = 0.0
        for b in range(n):
            total += matrix[a, b] * vector[b]
        scratch[0, a] = total
    for a in range(n):
        vector[a] = scratch[0, a]
