"""The printed descent, interpreted: with 4 × 4 matrices in NumPy, one forward difference after another.

For times only, compared with compiled kernels; the results are those of ``rhc_gradient``.
"""

from __future__ import annotations

import numpy as np

from ikgym.arms import Arm
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


def _joint(arm: Arm, i: int, q: float) -> FloatArray:
    """H_i of a joint (eq. 6), its rotation by eq. 8. Shape (4, 4)."""
    h, axis = np.eye(4), arm.axes[i]
    h[:3, 3] = arm.offsets[i] + (q * axis if arm.prismatic[i] else 0.0)
    if not arm.prismatic[i]:
        generator = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
        h[:3, :3] += np.sin(q) * generator + (1.0 - np.cos(q)) * generator @ generator
    return h


def _task_coordinates(arm: Arm, q: FloatArray) -> FloatArray:
    """F(q): the skew part of the orientation, and the position in [m]. Shape (6,)."""
    h = np.eye(4)
    for i in range(len(q)):
        h = h @ _joint(arm, i, q[i])
    rotation, position = h[:3, :3] @ arm.tool_rotation, h[:3, 3] + h[:3, :3] @ arm.tool
    skew = 0.5 * (rotation - rotation.T)
    return np.concatenate([[skew[0, 1], skew[0, 2], skew[1, 2]], position])


def _cost(scenario: Scenario, q: FloatArray, nominal: FloatArray, qdot: FloatArray) -> float:
    """Φ of section III. Shapes (n,), (HL - 1, 6), (HL - 1, n)."""
    cost, total = scenario.cost, 0.0
    for velocity, target in zip(qdot, nominal, strict=True):
        q = q + scenario.dt * velocity
        x = np.abs((target - _task_coordinates(scenario.arm, q)) / cost.delta_x)
        u = np.abs(velocity / cost.delta_qdot)
        total += float(np.sum(np.where(x > 1.0, x**cost.p_x, x**2)))
        total += float(np.sum(np.where(u > 1.0, u**cost.p_out, u**cost.p_in)))
    return total


def descend(scenario: Scenario, q: FloatArray, nominal: FloatArray, steps: int) -> FloatArray:
    """Joint velocities of the horizon after some steps of the descent of section IV from rest, without its stop test.

    Joint coordinates at the first grid point (n,), in [rad] or [m], and skew coordinates of the later ones (HL - 1, 6).
    """
    qdot, alpha, last = np.zeros((len(nominal), len(q))), 1e-8, 0.0
    for step in range(steps):
        here, gradient = _cost(scenario, q, nominal, qdot), np.empty_like(qdot)
        for index in np.ndindex(qdot.shape):
            shifted = qdot.copy()
            shifted[index] += 1e-3
            gradient[index] = (_cost(scenario, q, nominal, shifted) - here) / 1e-3
        norm = float(np.linalg.norm(gradient))
        if step > 0:
            alpha = min(max(alpha * 1.2 if norm < last else alpha / 1.2, 1e-8), 5e-4)
        last = norm
        qdot = qdot - alpha * gradient
    return qdot
