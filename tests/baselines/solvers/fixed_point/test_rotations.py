"""Rotations in n dimensions as matrices, and the paper's listing once more in plain NumPy."""

import numpy as np
import pytest
from scipy.linalg import expm

from baselines.solvers.fixed_point.rotations import adaptive_deform, plane, turn

DIMENSIONS = [2, 8]


def matrix(e_a, e_b, angle):
    """The rotation column by column."""
    columns = np.eye(len(e_a))
    for column in columns:
        turn(e_a, e_b, angle, column)
    return columns.T


def rotation(source, goal):
    e_a, e_b = np.empty_like(source), np.empty_like(source)
    angle = plane(source, goal, e_a, e_b)
    return matrix(e_a, e_b, angle), angle, e_a, e_b


def unit(vector):
    return vector / np.linalg.norm(vector)


def pairs(n):
    """Vectors at all kinds of angles: any, nearly none, nearly opposite, opposite, of very different lengths."""
    rng = np.random.default_rng(n)
    for _ in range(10):
        yield rng.normal(size=n), rng.normal(size=n)
    b, other = rng.normal(size=n), rng.normal(size=n)
    for share in (1e-3, 1e-8, 1e-12, 1e-15, 1e-17):
        yield b, b + share * other
        yield b, -b + share * other
    yield b, 3.0 * b
    yield b, -3.0 * b
    yield np.eye(n)[0], -np.eye(n)[0]
    yield 1e-9 * b, 1e9 * other


@pytest.mark.parametrize("n", DIMENSIONS)
def test_turns_one_direction_into_the_other_and_nothing_else(n):
    for source, goal in pairs(n):
        o, angle, e_a, e_b = rotation(source, goal)
        np.testing.assert_allclose(o @ o.T, np.eye(n), atol=1e-14)
        assert np.linalg.det(o) == pytest.approx(1.0, abs=1e-13)
        np.testing.assert_allclose(o @ unit(source), unit(goal), atol=1e-14)
        cosine = np.clip(unit(source) @ unit(goal), -1.0, 1.0)
        assert np.cos(angle) == pytest.approx(cosine, abs=1e-14)
        assert 0.0 <= angle <= np.pi
        v = np.random.default_rng(1).normal(size=n)
        v -= (v @ e_a) * e_a + (v @ e_b) * e_b
        np.testing.assert_allclose(o @ v, v, atol=1e-14)


@pytest.mark.parametrize("n", DIMENSIONS)
def test_is_the_exponential_of_the_generator(n):
    """Eq. 2.10 and 2.11."""
    rng = np.random.default_rng(n)
    _, _, e_a, e_b = rotation(rng.normal(size=n), rng.normal(size=n))
    generator = np.outer(e_a, e_b) - np.outer(e_b, e_a)
    for angle in (1e-9, 0.3, 2.0, -1.0):
        np.testing.assert_allclose(matrix(e_a, e_b, angle), expm(angle * generator), atol=1e-13)


def test_the_zero_vector_turns_nothing():
    for source, goal in ((np.zeros(4), np.ones(4)), (np.ones(4), np.zeros(4)), (np.zeros(4), np.zeros(4))):
        o, angle, _, _ = rotation(source, goal)
        assert angle == 0.0
        np.testing.assert_array_equal(o, np.eye(4))


def listing(realized_prev, deformed_prev, desired_now, R, lambda_, epsa, q_pp_max):  # noqa: N803  # the listing's name
    """AdaptiveDeform of section 4.1, line by line, with A'*B for the misprinted B'*B."""
    n = len(realized_prev)
    A, B, C = np.zeros(n + 1), np.zeros(n + 1), np.zeros(n + 1)  # noqa: N806  # the listing's names
    A[:n] = desired_now
    A[n] = np.sqrt(abs(R**2 - desired_now @ desired_now))
    B[:n] = realized_prev
    B[n] = np.sqrt(abs(R**2 - realized_prev @ realized_prev))
    C[:n] = deformed_prev
    C[n] = np.sqrt(abs(R**2 - deformed_prev @ deformed_prev))
    AortB = A - (A @ B) * B / R**2  # noqa: N806
    norm_AortB = np.sqrt(abs(AortB @ AortB))  # noqa: N806
    ea = AortB / (epsa + norm_AortB)
    eb = B / R
    fi = np.arcsin(min(1.0, norm_AortB / R))
    Gen = np.outer(ea, eb) - np.outer(eb, ea)  # noqa: N806
    Gen2 = Gen @ Gen  # noqa: N806
    O = np.eye(n + 1) + np.sin(lambda_ * fi) * Gen + Gen2 * (1 - np.cos(lambda_ * fi))  # noqa: N806, E741
    transformed = O @ C
    return q_pp_max * np.tanh(transformed[:n] / q_pp_max), lambda_ * fi


def deformed(b, c, a, rule):
    out = np.full_like(b, 7.0)
    angle = adaptive_deform(b, c, a, rule, np.empty((3, len(b) + 1)), out)
    return out, angle


@pytest.mark.parametrize(("share", "epsa"), [(5e-4, 1e-12), (0.3, 1e-3), (1.0, 1.0), (1.7, 1.0)])
@pytest.mark.parametrize("n", DIMENSIONS)
def test_is_the_listing(n, share, epsa):
    """A large epsa shows that the rank-two form is exact also where e_a is no unit vector."""
    rng = np.random.default_rng(n)
    for _ in range(20):
        a, b, c = (unit(rng.normal(size=n)) * rng.uniform(0, 99) for _ in range(3))
        out, angle = deformed(b, c, a, (100.0, share, epsa, 1e3))
        wanted, wanted_angle = listing(b, c, a, 100.0, share, epsa, 1e3)
        np.testing.assert_allclose(out, wanted, atol=1e-11)
        assert angle == pytest.approx(wanted_angle, rel=1e-12)


@pytest.mark.parametrize(("which", "length"), [(0, 100.0), (1, 101.0), (2, np.inf), (0, np.nan)])
def test_a_vector_that_is_too_long_is_no_rotation(which, length):
    vectors = [np.zeros(8) for _ in range(3)]
    vectors[which][2] = length
    out, angle = deformed(*vectors, (100.0, 5e-4, 1e-12, 1e3))
    assert np.isnan(angle)
    np.testing.assert_array_equal(out, 7.0)
