"""Kernels: the Jacobians with which bilinear agents see their arms, and their gradient."""

from __future__ import annotations

import numpy as np

from baselines.agents.bilinear.features import seen_jacobian
from ikgym.kernels.jit import inner, kernel
from ikgym.rl.twists import is_turned


@kernel
def jacobian_rows(kind, chain, q, out):
    """:func:`baselines.agents.bilinear.features.seen_jacobian`, row by row: shapes (N, n) and (N, 6, n)."""
    joints, rotation, position = np.empty(q.shape[1]), np.empty((3, 3)), np.empty(3)
    for row in range(q.shape[0]):
        seen_jacobian(kind, chain, q[row], joints, rotation, position, out[row])


@kernel
def jacobian_gradient_rows(kind, chain, jacobian, by, out):
    """The adjoint of :func:`jacobian_rows`.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        jacobian: Shape (N, 6, n).
        by: The gradient with respect to it. Shape (N, 6, n).
        out: Receives that with respect to the joint coordinates. Shape (N, n).
    """
    for row in range(jacobian.shape[0]):
        jacobian_gradient(jacobian[row], by[row], out[row])
        if is_turned(kind, chain.prismatic):
            out[row, 0] = 0.0


@inner
def jacobian_gradient(jacobian, by, out):
    """From the gradient with respect to the geometric Jacobian to that with respect to the joint coordinates.

    With columns (v_i, ω_i), joint j rotates the columns i ≥ j and moves the tool for those before it:
    ∂v_i/∂q_j = ω_j × v_i and ∂ω_i/∂q_j = ω_j × ω_i for j ≤ i, ∂v_i/∂q_j = ω_i × v_j else. ω of a prismatic joint is 0.

    Args:
        jacobian: Shape (6, n).
        by: The gradient with respect to it. Shape (6, n).
        out: Receives that with respect to the joint coordinates. Shape (n,).
    """
    n = jacobian.shape[1]
    out[:] = 0.0
    for i in range(n):
        vx, vy, vz, wx, wy, wz = (
            jacobian[0, i], jacobian[1, i], jacobian[2, i], jacobian[3, i], jacobian[4, i], jacobian[5, i],
        )  # fmt: skip
        ax, ay, az, bx, by_, bz = by[0, i], by[1, i], by[2, i], by[3, i], by[4, i], by[5, i]
        # The factors of ω_j, v × a + ω × b, and of v_j, a × ω.
        tx = vy * az - vz * ay + wy * bz - wz * by_
        ty = vz * ax - vx * az + wz * bx - wx * bz
        tz = vx * ay - vy * ax + wx * by_ - wy * bx
        mx, my, mz = ay * wz - az * wy, az * wx - ax * wz, ax * wy - ay * wx
        for j in range(i + 1):
            out[j] += jacobian[3, j] * tx + jacobian[4, j] * ty + jacobian[5, j] * tz
        for j in range(i + 1, n):
            out[j] += jacobian[0, j] * mx + jacobian[1, j] * my + jacobian[2, j] * mz
