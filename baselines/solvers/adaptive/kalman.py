"""Kernels: the Kalman filter's update by one number, y = h · x + noise."""

from __future__ import annotations

from ikgym.jit import kernel


@kernel
def gain_of(row, variance, covariance, gain):
    """The gain, by which the covariance shrinks.

    Args:
        row: h. Shape (p,).
        variance: Of the noise, above 0.
        covariance: Of x, changed in place. Shape (p, p).
        gain: Receives what x has to change by for each unit by which y is beyond h · x. Shape (p,).
    """
    p, total = row.shape[0], variance
    for i in range(p):
        gain[i] = 0.0
        for j in range(p):
            gain[i] += covariance[i, j] * row[j]
        total += row[i] * gain[i]
    for i in range(p):
        for j in range(p):
            covariance[i, j] -= gain[i] * gain[j] / total
    for i in range(p):
        gain[i] /= total
