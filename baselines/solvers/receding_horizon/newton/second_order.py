"""Kernels: the second derivatives of the tracking error by the joint coordinates of a knot."""

from __future__ import annotations

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.axes import across
from ikgym.kernels.jit import inlined, uncounted


@uncounted
def second_order(kind, workspace, out):
    """Σ gradient_i ∂²error_i / ∂q², the lower triangle; for POSE and AXIS as if the rotation error were small.

    With the geometric columns (v_j, w_j) and joint b not behind joint a: ∂v_a / ∂q_b = w_b × v_a, and for the rotation
    R, and so for its axis z, the second derivative is w_b × (w_a × R).

    Args:
        kind: The kind of task coordinates.
        workspace: A :class:`workspace.KnotWorkspace` with ``rotation``, ``geometric`` and ``gradient`` of the knot.
        out: Receives the matrix. Shape (n, n).
    """
    g, rotation, gradient, moment = workspace.geometric, workspace.rotation, workspace.gradient, workspace.moment
    n, e = out.shape[0], gradient.shape[0]
    # The error falls as the coordinates rise: forces are minus the gradient.
    where = 0 if kind in (task_kernels.POSE, task_kernels.AXIS) else e - 3
    fx, fy, fz = -gradient[where], -gradient[where + 1], -gradient[where + 2]
    tx = ty = tz = zx = zy = zz = 0.0
    if kind == task_kernels.POSE:
        tx, ty, tz = -0.5 * gradient[3], -0.5 * gradient[4], -0.5 * gradient[5]
    elif kind == task_kernels.AXIS:
        # The error of the direction is (z · b, -z · a) with the two directions a and b across z*.
        zx, zy, zz = rotation[0, 2], rotation[1, 2], rotation[2, 2]
        ax, ay, az, bx, by, bz = across(zx, zy, zz)
        tx, ty, tz = (
            gradient[3] * bx - gradient[4] * ax,
            gradient[3] * by - gradient[4] * ay,
            gradient[3] * bz - gradient[4] * az,
        )
    by_rotation = kind in (task_kernels.SKEW, task_kernels.MATRIX)
    if by_rotation:
        set_moment(kind, gradient, rotation, moment)
    for a in range(n):
        vx, vy, vz = g[0, a], g[1, a], g[2, a]
        wx, wy, wz = g[3, a], g[4, a], g[5, a]
        # f · (w_b × v_a) = w_b · (v_a × f)
        ux, uy, uz = vy * fz - vz * fy, vz * fx - vx * fz, vx * fy - vy * fx
        if by_rotation:
            ux += wx * moment[0, 0] + wy * moment[1, 0] + wz * moment[2, 0]
            uy += wx * moment[0, 1] + wy * moment[1, 1] + wz * moment[2, 1]
            uz += wx * moment[0, 2] + wy * moment[1, 2] + wz * moment[2, 2]
        elif kind == task_kernels.POSE:
            # ω = Σ w_j q_j' has ∂w_a / ∂q_b = w_b × w_a, of which half is left in the rotation vector.
            ux += wy * tz - wz * ty
            uy += wz * tx - wx * tz
            uz += wx * ty - wy * tx
        elif kind == task_kernels.AXIS:
            # t · (w_b × (w_a × z)) = w_b · ((w_a × z) × t)
            sx, sy, sz = wy * zz - wz * zy, wz * zx - wx * zz, wx * zy - wy * zx
            ux += sy * tz - sz * ty
            uy += sz * tx - sx * tz
            uz += sx * ty - sy * tx
        for b in range(a + 1):
            out[a, b] = g[3, b] * ux + g[4, b] * uy + g[5, b] * uz


@inlined
def set_moment(kind, gradient, rotation, moment):
    """G Rᵀ - tr(G Rᵀ) I with G = ∂Φ / ∂R: then Σ G : w_b × (w_a × R) = w_aᵀ moment w_b. For SKEW and MATRIX."""
    trace = 0.0
    for i in range(3):
        for j in range(3):
            total = 0.0
            for c in range(3):
                total += rotation_gradient(kind, gradient, i, c) * rotation[j, c]
            moment[i, j] = total
        trace += moment[i, i]
    for i in range(3):
        moment[i, i] -= trace


@inlined
def rotation_gradient(kind, gradient, i, j):
    """∂Φ / ∂R_ij, from ∂Φ / ∂error (e,)."""
    if kind == task_kernels.MATRIX:
        return -gradient[3 * i + j]
    if i == j:
        return 0.0
    # O^A_12, O^A_13, O^A_23 are at 0, 1, 2.
    return -0.5 * gradient[i + j - 1] if i < j else 0.5 * gradient[i + j - 1]
