"""Saturation in the null space against its source and a linear program; in motion against `qp`."""

import numpy as np

from baselines.solvers.quadratic_program.sns import saturate
from tests.baselines.solvers.quadratic_program.paths import most_possible


def saturated(jacobian, shift, lower, upper, damping=0.0):
    qdot = np.empty(jacobian.shape[1])
    return qdot, *saturate(jacobian, shift, damping, lower, upper, qdot)


def test_the_others_make_up_for_a_joint_at_its_bound():
    """One task coordinate, two joints: each should make half of it, and the first may make a tenth."""
    jacobian, shift, bound = np.array([[1.0, 1.0]]), np.array([1.0]), np.array([0.1, 2.0])
    qdot, made, scaled = saturated(jacobian, shift, -bound, bound)
    np.testing.assert_allclose(qdot, [0.1, 0.9], rtol=1e-12)
    assert (made, scaled) == (2, False)
    # With 0.1 + 0.5 at most, the whole is scaled down.
    qdot, _, scaled = saturated(jacobian, shift, -np.array([0.1, 0.5]), np.array([0.1, 0.5]))
    np.testing.assert_allclose(qdot, [0.1, 0.5], rtol=1e-12)
    assert scaled


def test_keeps_the_direction_and_never_makes_more_than_possible():
    rng, whole, scaled_down, best = np.random.default_rng(1), 0, 0, 0
    for _ in range(60):
        e, n = rng.integers(1, 7), 7
        jacobian, shift = rng.normal(size=(e, n)), rng.normal(size=e)
        shift *= rng.uniform(0.2, 3)
        lower, upper = -rng.uniform(0.1, 1, n), rng.uniform(0.1, 1, n)
        qdot, made, scaled = saturated(jacobian, shift, lower, upper)
        assert ((lower <= qdot) & (qdot <= upper)).all()
        assert made <= n + 1
        s, most = jacobian @ qdot @ shift / (shift @ shift), most_possible(jacobian, shift, lower, upper)
        np.testing.assert_allclose(jacobian @ qdot, s * shift, atol=1e-9)
        assert 0.0 < s <= most + 1e-9
        assert scaled == (s < 1.0 - 1e-9)
        # Cut as a whole, the pseudoinverse never makes more.
        plain = np.linalg.pinv(jacobian) @ shift
        factor = min(1.0, np.min(np.where(plain > 0, upper, lower) / plain))
        assert s >= factor - 1e-9
        whole += made > 1 and not scaled
        scaled_down += scaled
        best += s > most - 1e-6
    assert min(whole, scaled_down) > 10
    assert best > 40  # the basic algorithm is not optimal, though mostly it is


def test_bounds_that_leave_out_0_are_kept():
    jacobian, shift = np.array([[1.0, 1.0, 0.5]]), np.array([0.3])
    lower, upper = np.array([0.5, -1.0, -1.0]), np.array([0.6, 1.0, 1.0])
    qdot, _, scaled = saturated(jacobian, shift, lower, upper)
    np.testing.assert_allclose(jacobian @ qdot, shift, rtol=1e-12)
    assert qdot[0] == 0.5
    assert not scaled
    # Nothing can be made of it: within bounds all the same.
    qdot, _, scaled = saturated(jacobian[:, :1], shift, lower[:1], upper[:1])
    assert (qdot[0], scaled) == (0.5, True)
    assert saturated(np.zeros((2, 3)), np.ones(2), lower, upper)[0].tolist() == [0.5, 0.0, 0.0]
