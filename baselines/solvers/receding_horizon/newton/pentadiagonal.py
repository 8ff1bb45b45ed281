"""Kernel: the Newton step of a block-pentadiagonal quadratic model, in time linear in its knots."""

from __future__ import annotations

from baselines.solvers.linear_algebra import inverse_of_factor
from baselines.solvers.receding_horizon.newton.newton_step import multiply, pivot_of
from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.linear_algebra import cholesky


@uncounted
def pentadiagonal_step(model, exact, damping, inverse, factor, step):
    """Solves (H + damping I) step = -gradient as :func:`newton_step.newton_step`, where ``model.far`` is not zero.

    The blocks two away from the diagonal are diagonal and stay so; those beside it fill up on the way.

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
    far, beside = model.far, model.beside
    for k in range(knots):
        pivot_of(model, exact, damping, k, factor, step[k])
        if k > 0:
            _fill(model, inverse, k)
            _eliminate(beside[k], inverse[k - 1], step[k - 1], model.product, factor, step[k])
        if k > 1:
            _eliminate_diagonal(far[k], inverse[k - 2], step[k - 2], factor, step[k])
        if not cholesky(factor):
            return False
        inverse_of_factor(factor, inverse[k])
    for k in range(knots - 1, -1, -1):
        for a in range(n):
            if k + 1 < knots:
                for b in range(n):
                    step[k, a] -= beside[k + 1, b, a] * step[k + 1, b]
            if k + 2 < knots:
                step[k, a] -= far[k + 2, a] * step[k + 2, a]
        multiply(inverse[k], factor, step[k])
    return True


@inlined
def _fill(model, inverse, k):
    """The block beside the diagonal in row ``k``, behind the elimination of the knot two before."""
    far, beside = model.far, model.beside
    n = far.shape[1]
    for a in range(n):
        for b in range(n):
            total = -model.coupling[k, a] if a == b else 0.0
            if k > 1:
                for c in range(n):
                    total -= far[k, a] * inverse[k - 2, a, c] * beside[k - 1, b, c]
            beside[k, a, b] = total


@inlined
def _eliminate(beside, inverse, rhs_before, product, pivot, rhs):
    """Eliminates the knot before: its Schur complement from the pivot, its share from the right-hand side.

    Args:
        beside: The block. Shape (n, n).
        inverse: Inverse of the pivot before. Shape (n, n).
        rhs_before: The right-hand side before. Shape (n,).
        product: Scratch. Shape (n, n).
        pivot: Lower triangle, changed in place. Shape (n, n).
        rhs: Changed in place. Shape (n,).
    """
    n = rhs.shape[0]
    for a in range(n):
        for b in range(n):
            total = 0.0
            for c in range(n):
                total += beside[a, c] * inverse[c, b]
            product[a, b] = total
            rhs[a] -= total * rhs_before[b]
        for b in range(a + 1):
            total = 0.0
            for c in range(n):
                total += product[a, c] * beside[b, c]
            pivot[a, b] -= total


@inlined
def _eliminate_diagonal(far, inverse, rhs_before, pivot, rhs):
    """Eliminates the knot two before, likewise; its block is diagonal. Shape of ``far`` (n,)."""
    n = rhs.shape[0]
    for a in range(n):
        for b in range(n):
            rhs[a] -= far[a] * inverse[a, b] * rhs_before[b]
        for b in range(a + 1):
            pivot[a, b] -= far[a] * inverse[a, b] * far[b]
