"""Kernels: the damped least squares of a whole horizon, in time linear in its length (Zhang 2020, eq. 27 and 36).

With Ψ̄ = L D, L the block lower triangle of identities and D = blockdiag(J_1 … J_n), the printed

    ΔQ = (Ψ̄ᵀ Ψ̄ + λ I)⁻¹ Ψ̄ᵀ r    becomes    ΔQ = Dᵀ (D Dᵀ + λ M)⁻¹ d,    d_j = r_j - r_(j-1),  r_0 = 0,

where M = L⁻¹ L⁻ᵀ is block tridiagonal: -I next to the diagonal, and I, 2I, … 2I on it. At λ = 0 the blocks come
apart, which is the shortcut (38).
"""

from __future__ import annotations

from ikgym.kernels.jit import inlined, inner
from ikgym.kernels.linear_algebra import damped_gram, ldl, ldl_scaled_inverse, ldl_solve, transposed_product


@inner
def damped_horizon_step(jacobians, differences, damping, scratch, out):
    """ΔQ = Dᵀ (D Dᵀ + λ M)⁻¹ d, by blocks from the end of the horizon to its beginning and back.

    With S_n = J_n J_nᵀ + 2λ I and the gain K_j = λ S_j⁻¹, the elimination is a Riccati recursion:
    S_j = J_j J_jᵀ + λ M_jj - λ K_(j+1), and x_j = S_j⁻¹ b_j + K_j x_(j-1).

    Args:
        jacobians: J_1 … J_n. Shape (n, e, joints).
        differences: d. Shape (n, e).
        damping: λ, at least 0.
        scratch: Arrays for S_j, K and x. Shapes (e, e), (n, e, e), (n, e).
        out: Receives ΔQ. Shape (n, joints).

    Returns:
        How many blocks could be factorised: n, or fewer where a Jacobian has lost rank and λ is too small to count;
        ``out`` is of no use then.
    """
    _, gains, x = scratch
    n = x.shape[0]
    for j in range(n - 1, -1, -1):
        if not _eliminate(j, jacobians[j], differences[j], damping, scratch):
            return n - 1 - j
    for j in range(n):
        if damping > 0.0 and j > 0:
            for a in range(x.shape[1]):
                for b in range(x.shape[1]):
                    x[j, a] += gains[j, a, b] * x[j - 1, b]
        transposed_product(jacobians[j], x[j], out[j])
    return n


@inlined
def _eliminate(j, jacobian, difference, damping, scratch):
    """Block j: S_j⁻¹ b_j, and K_j for the block before; False where S_j cannot be factorised."""
    gram, gains, x = scratch
    n, e = x.shape
    damped_gram(jacobian, damping if j == 0 else 2.0 * damping, gram)
    for a in range(e):
        x[j, a] = difference[a]
    if damping > 0.0 and j + 1 < n:
        for a in range(e):
            x[j, a] += damping * x[j + 1, a]
            for b in range(a + 1):
                gram[a, b] -= damping * gains[j + 1, a, b]
    solved = ldl(gram)
    if solved:
        ldl_solve(gram, x[j])
        if damping > 0.0 and j > 0:
            ldl_scaled_inverse(gram, damping, gains[j])
    return solved
