"""Small dense kernels against NumPy."""

import numpy as np
import pytest

from ikgym.kernels.linear_algebra import cholesky, ldl, orthogonal_columns


@pytest.mark.parametrize("matrix", [[[0.0]], [[1.0, 1.0], [1.0, 1.0]], [[1.0, 2.0], [2.0, 1.0]], [[np.nan]]])
def test_what_is_not_positive_definite_is_refused(matrix):
    assert not ldl(np.array(matrix))
    assert matrix[0] == [1.0, 1.0] or not cholesky(np.array(matrix))


def check(matrix):
    columns, rotations = matrix.copy(), np.empty((matrix.shape[1],) * 2)
    orthogonal_columns(columns, rotations)
    scale = max(np.linalg.norm(matrix), 1e-300)
    np.testing.assert_allclose(columns @ rotations.T / scale, matrix / scale, atol=1e-14)
    np.testing.assert_allclose(rotations.T @ rotations, np.eye(len(rotations)), atol=1e-13)
    gram = columns.T @ columns
    np.testing.assert_allclose(gram - np.diag(np.diag(gram)), 0, atol=1e-14 * scale**2)
    wanted = np.linalg.svd(matrix, compute_uv=False)
    got = np.sort(np.sqrt(np.diag(gram)))[::-1][: len(wanted)]
    np.testing.assert_allclose(got, wanted, rtol=1e-12, atol=1e-15 * scale)


@pytest.mark.parametrize("shape", [(7, 6), (3, 3), (8, 12), (6, 6), (1, 3)])
def test_singular_values(shape):
    rng = np.random.default_rng(0)
    for _ in range(20):
        check(rng.normal(size=shape))


def test_singular_values_of_matrices_without_full_rank():
    rng = np.random.default_rng(1)
    check(np.zeros((7, 6)))
    check(rng.normal(size=(7, 3)) @ rng.normal(size=(3, 6)))
    check(np.outer(np.arange(7.0), np.ones(6)))


def test_small_singular_values_keep_their_digits():
    """Graded columns: the eigenvalues of AᵀA would lose these at 1e-16."""
    rng = np.random.default_rng(2)
    q = np.linalg.qr(rng.normal(size=(7, 6)))[0]
    wanted = 10.0 ** -np.arange(0, 18, 3)
    columns, rotations = q * wanted, np.empty((6, 6))
    orthogonal_columns(columns, rotations)
    np.testing.assert_allclose(np.sort(np.linalg.norm(columns, axis=0))[::-1], wanted, rtol=1e-10)
