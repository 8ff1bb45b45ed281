"""Kernels of extended Kalman filters of an arm's kinematics."""

from __future__ import annotations

import math

import numpy as np

from baselines.solvers.adaptive.chain_parameters import changed_chain, parameter_twists
from baselines.solvers.adaptive.deviation import deviation_between
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner
from ikgym.kernels.kinematics import forward
from ikgym.validation import FloatArray

#: Second derivatives of a pose by joint zeros and tilts: those of an arm of some 1 m, in [1/m] and [1/rad].
CURVATURE = 1.0


def prior_covariance(joints: int, zero: float, link: float, axis: float) -> FloatArray:
    """The covariance of the parameters before anything is measured, from their standard deviations. Shape (p, p)."""
    out: FloatArray = np.diag(np.repeat([zero, link, axis], [joints, 3 * joints + 3, 2 * joints]) ** 2)
    return out


@inner
def write_deviation(chain, kind, parameters, q, parts, out):
    """The deviation of an arm from its model.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates.
        parameters: Of the arm. Shape (p,).
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        parts: Those of :func:`changed_chain`, changed in place.
        out: Receives the deviation. Shape (6,).

    Returns:
        The chain of the arm.
    """
    rotation, position, model_rotation, model_position = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    forward(chain, q, model_rotation, model_position)
    arm = changed_chain(chain, parameters, *parts)
    forward(arm, q + parameters[: q.shape[0]], rotation, position)
    deviation_between(kind, rotation, position, model_rotation, model_position, out)
    return arm


@inner
def linearise(arm, kind, q, pose, error, sensitivity):
    """The difference of a measured pose from that of an arm, and its derivatives with respect to the arm's parameters.

    Args:
        arm: The chain with the parameters.
        kind: Of task coordinates.
        q: Joint coordinates with the joint zeros. Shape (n,).
        pose: Measured task coordinates. Shape (m,).
        error: Receives the difference. Shape (e,).
        sensitivity: Receives the derivatives. Shape (e, p).
    """
    rotation, position, predicted = np.empty((3, 3)), np.empty(3), np.empty(pose.shape[0])
    twist = np.zeros((6, sensitivity.shape[1]))
    forward(arm, q, rotation, position)
    task_kernels.coordinates(kind, rotation, position, predicted)
    task_kernels.error(kind, pose, predicted, error)
    parameter_twists(arm, q, position, twist)
    task_kernels.jacobian(kind, rotation, twist, sensitivity)


@inner
def absorb(sensitivity, error, variances, change, covariance):
    """The update by all components of an error, one after the other, since their noises are independent.

    Args:
        sensitivity: Derivatives by the parameters. Shape (e, p).
        error: Difference to the measurement. Shape (e,).
        variances: Of the noises. Shape (e,).
        change: Of the parameters, from where the error was linearised, changed in place. Shape (p,).
        covariance: Changed in place. Shape (p, p).

    Returns:
        The sum of squares of the innovations, in their standard deviations: chi-square with e degrees of freedom;
        and the logarithm of the product of the variances.
    """
    p, gain, surprise, size = change.shape[0], np.empty(change.shape[0]), 0.0, 0.0
    for k in range(error.shape[0]):
        variance = gain_of(sensitivity[k], variances[k], CURVATURE, covariance, gain)
        missing = error[k]
        for i in range(p):
            missing -= sensitivity[k, i] * change[i]
        for i in range(p):
            change[i] += gain[i] * missing
        surprise += missing * missing / variance
        size += math.log(variance)
    return surprise, size


@inner
def gain_of(row, variance, curvature, covariance, gain):
    """The Kalman gain for one number, y = h · x + noise, by which the covariance shrinks.

    Args:
        row: h. Shape (p,).
        variance: Of the noise, above 0.
        curvature: By which share of its variance h · x is off where h is a derivative: the second order adds the noise
            that a second derivative of this size leaves. 0 where y is linear in x.
        covariance: Of x, changed in place. Shape (p, p).
        gain: Receives the change of x for each unit of the innovation y − h · x. Shape (p,).

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
