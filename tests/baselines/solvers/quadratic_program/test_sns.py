"""Saturation in the null space against its source and a linear program; in motion against `qp`."""

import numpy as np

import baselines
import ikgym
from baselines.solvers.quadratic_program.sns import saturate
from tests.baselines.solvers.quadratic_program.paths import most_possible


def saturated(jacobian, shift, lower, upper, smooth=False, damping=0.0):
    qdot = np.empty(jacobian.shape[1])
    return qdot, *saturate(jacobian, shift, damping, lower, upper, smooth, qdot)


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


def test_where_no_factor_fits_narrow_bounds_leave_as_much_of_the_task_as_they_can():
    """The first joint is too fast for any share of the task; the second goes on to make its part."""
    jacobian, shift = np.eye(2), np.array([0.3, 0.3])
    qdot, _, scaled = saturated(jacobian, shift, np.array([0.5, -1.0]), np.array([0.6, 1.0]), smooth=True)
    np.testing.assert_allclose(qdot, [0.5, 0.3], rtol=1e-12)
    assert scaled


def test_comes_back_to_its_reference_with_a_third_of_the_jerk_of_the_panda():
    base = ikgym.scenarios.get("panda-circle").replace(jerk_limit=2500.0, steps=800)
    q = base.first_q(base.episode(0))
    off = 5e-3 * np.linalg.pinv(base.arm.jacobian(q)[:3]) @ [0.0, 0.6, 0.8]
    error = baselines.track(base.replace(start=q + off), "sns").position_error
    assert error.max() < 5.1e-3
    assert error[-1] < 5e-6
