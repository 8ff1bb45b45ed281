"""Kernels: Newton steps of block-tridiagonal and block-pentadiagonal models, in time linear in the knots."""

from __future__ import annotations

from ikgym.kernels.jit import inlined, uncounted
from ikgym.kernels.linear_algebra import cholesky, inverse_of_factor


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
    """Eliminates the knot before, by the diagonal (n,) of the block next to the pivot.

    Its Schur complement is taken from the pivot, whose lower triangle counts, its share from the right-hand side.
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
    """Knot ``k`` before anything is eliminated: the lower triangle of its damped block, and minus its gradient."""
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


@uncounted
def pentadiagonal_step(model, exact, damping, inverse, factor, step):
    """:func:`newton_step` where ``model.far`` is not zero.

    The blocks two away from the diagonal are diagonal and stay so; those next to it fill up on the way.
    """
    knots, n = step.shape
    far, filled = model.far, model.filled
    for k in range(knots):
        pivot_of(model, exact, damping, k, factor, step[k])
        if k > 0:
            _fill(model, inverse, k)
            _eliminate_full(filled[k], inverse[k - 1], step[k - 1], model.product, factor, step[k])
        if k > 1:
            _eliminate_diagonal(far[k], inverse[k - 2], step[k - 2], factor, step[k])
        if not cholesky(factor):
            return False
        inverse_of_factor(factor, inverse[k])
    for k in range(knots - 1, -1, -1):
        for a in range(n):
            if k + 1 < knots:
                for b in range(n):
                    step[k, a] -= filled[k + 1, b, a] * step[k + 1, b]
            if k + 2 < knots:
                step[k, a] -= far[k + 2, a] * step[k + 2, a]
        multiply(inverse[k], factor, step[k])
    return True


@inlined
def _fill(model, inverse, k):
    """The block next to the diagonal in row ``k``, behind the elimination of the knot two before."""
    far, filled = model.far, model.filled
    n = far.shape[1]
    for a in range(n):
        for b in range(n):
            total = -model.coupling[k, a] if a == b else 0.0
            if k > 1:
                for c in range(n):
                    total -= far[k, a] * inverse[k - 2, a, c] * filled[k - 1, b, c]
            filled[k, a, b] = total


@inlined
def _eliminate_full(filled, inverse, rhs_before, product, pivot, rhs):
    """Eliminates the knot before likewise, by a full block; ``product`` is scratch. Shapes (n, n)."""
    n = rhs.shape[0]
    for a in range(n):
        for b in range(n):
            total = 0.0
            for c in range(n):
                total += filled[a, c] * inverse[c, b]
            product[a, b] = total
            rhs[a] -= total * rhs_before[b]
        for b in range(a + 1):
            total = 0.0
            for c in range(n):
                total += product[a, c] * filled[b, c]
            pivot[a, b] -= total


@inlined
def _eliminate_diagonal(far, inverse, rhs_before, pivot, rhs):
    """Eliminates the knot two before likewise. Shape of ``far`` (n,)."""
    n = rhs.shape[0]
    for a in range(n):
        for b in range(n):
            rhs[a] -= far[a] * inverse[a, b] * rhs_before[b]
        for b in range(a + 1):
            pivot[a, b] -= far[a] * inverse[a, b] * far[b]
