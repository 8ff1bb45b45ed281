"""Kernels: the Kalman filter's update by one number, y = h · x + noise."""

from __future__ import annotations

from ikgym.kernels.jit import kernel


@kernel
def gain_of(row, variance, curvature, covariance, gain):
    """The gain, by which the covariance shrinks.

    Args:
        row: h. Shape (p,).
        variance: Of the noise, above 0.
        curvature: By which share of its variance h · x is off where h is a derivative: the second order adds the noise
            that a second derivative of this size leaves. 0 where y is linear in x.
        covariance: Of x, changed in place. Shape (p, p).
        gain: Receives what x has to change by for each unit by which y is beyond h · x. Shape (p,).

    Returns:
        The variance of y.
    """
    p, spread = row.shape[0], 0.0
    for i in range(p):
        gain[i] = 0.0
        for j in range(p):
            gain[i] += covariance[i, j] * row[j]
        spread += row[i] * gain[i]
    total = spread + variance + (curvature * spread) ** 2
    for i in range(p):
        for j in range(p):
            covariance[i, j] -= gain[i] * gain[j] / total
    for i in range(p):
        gain[i] /= total
    return total
