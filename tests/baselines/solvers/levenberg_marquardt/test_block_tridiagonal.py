"""The horizon by blocks against the printed dense formula (27)."""

import numpy as np
import pytest

from baselines.solvers.levenberg_marquardt.block_tridiagonal import damped_horizon_step


def printed(jacobians, residuals, damping):
    """(27): [Ψ̄ᵀ Ψ̄ + λ I]⁻¹ Ψ̄ᵀ r, as least squares of the augmented system, which squares no condition number."""
    n, e, joints = jacobians.shape
    psi = np.zeros((n * e, n * joints))
    for i in range(n):
        for j in range(i + 1):
            psi[i * e : (i + 1) * e, j * joints : (j + 1) * joints] = jacobians[j]
    augmented = np.vstack([psi, damping**0.5 * np.eye(n * joints)])
    rhs = np.concatenate([residuals.ravel(), np.zeros(n * joints)])
    return np.linalg.lstsq(augmented, rhs, rcond=None)[0].reshape(n, joints)


def by_blocks(jacobians, residuals, damping):
    n, e, joints = jacobians.shape
    differences = np.diff(residuals, axis=0, prepend=np.zeros((1, e)))
    out, scratch = np.empty((n, joints)), (np.empty((e, e)), np.empty((n, e, e)), np.empty((n, e)))
    solved = damped_horizon_step(jacobians, differences, damping, scratch, out)
    return out if solved == n else None


@pytest.mark.parametrize("damping", [1e-3, 0.5, 20.0])
@pytest.mark.parametrize("n", [1, 2, 12])
def test_equals_the_dense_formula(n, damping):
    rng = np.random.default_rng(n)
    for e, joints in ((3, 3), (6, 7), (6, 6), (3, 7), (12, 8)):
        jacobians, residuals = rng.normal(size=(n, e, joints)), rng.normal(size=(n, e))
        wanted = printed(jacobians, residuals, damping)
        # Where J is taller than wide, D Dᵀ is singular and the condition is that of λ M.
        rounding = 1e-12 * max(1.0, joints < e and 1.0 / damping)
        np.testing.assert_allclose(by_blocks(jacobians, residuals, damping), wanted, atol=rounding * abs(wanted).max())


def test_says_where_rank_is_lost():
    rng = np.random.default_rng(0)
    jacobians, residuals = rng.normal(size=(3, 3, 4)), rng.normal(size=(3, 3))
    jacobians[1, 2] = jacobians[1, 0]
    assert by_blocks(jacobians, residuals, 0.0) is None
    assert by_blocks(jacobians, residuals, 1e-18) is None
    # From the end of the horizon the last block can be factorised, and the second cannot.
    scratch = np.empty((3, 3)), np.empty((3, 3, 3)), np.empty((3, 3))
    assert damped_horizon_step(jacobians, residuals, 0.0, scratch, np.empty((3, 4))) == 1
    wanted = printed(jacobians, residuals, 1e-4)
    np.testing.assert_allclose(by_blocks(jacobians, residuals, 1e-4), wanted, atol=1e-9 * abs(wanted).max())
