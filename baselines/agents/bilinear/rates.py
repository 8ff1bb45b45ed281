"""Kernels of joint rates at predicted postures, and of the metric that follows from the first of them.

From where the arm is, damped least-squares steps lead to one reference pose ahead after the other,

    q_0 = q + S(q) e_0(q),  q_(i+1) = q_i + S(q_i) e_(i+1)(q_i),  S = Jᵀ (J Jᵀ + λ I)⁻¹,

with e_i(q) the twist from the pose at q to the reference at offset o_i. The step divided by its time is a joint rate. A
singularity ahead shows in the rates that it will require, while there is time to go around it.

The rates of the first twist give the metric that a network changes, so that a fast joint counts less. With U = |q̇|⁻² a
weighted least-squares step approaches the least sum of fourth powers, which joint velocities cost (iteratively
reweighted least squares, Burrus 1994); the exponent allows for a single step.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.agents.bilinear.features import CONTEXT, shown_joints
from baselines.solvers.linear_algebra import damped_step
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner
from ikgym.kernels.kinematics import forward_and_jacobian
from ikgym.kernels.limits import within
from ikgym.rl.twists import twist, twist_size

#: λ of the joint rates, which bounds them near a singularity.
DAMPING = 1e-2
#: Largest step of a joint in [rad] or [m]: far off the path, predictions would be wild.
FARTHEST = 0.5
#: θ of the metric U_j = (q̇_j² / mean q̇² + ε)^-θ, and ε, which bounds it for a joint at rest.
EXPONENT, AT_REST = 0.3, 0.1
#: Added to the mean of the squares, which may be 0.
LITTLE = 1e-6


@inner
def rate_rows(kind, chain, dt, offsets, q, nominal, speed, features):
    """Appends the joint rates between the offsets to features, in units of the speed of the reference ahead.

    Args:
        kind: Of task coordinates, except skew ones, whose errors are no twists.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Shape (B, n).
        nominal: Reference task coordinates at the offsets. Shape (B, p, m).
        speed: Shape (B,).
        features: Receives the rates in its last columns. Shape (B, f + (p - 1) n).
    """
    n, w, first = q.shape[1], twist_size(kind), features.shape[1] - (offsets.shape[0] - 1) * q.shape[1]
    rotation, position, jacobian, pose = np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(nominal.shape[2])
    gram, scratch, error, due = np.empty((w, w)), np.empty(w), np.empty(6), np.empty(w)
    posture, step = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        posture[:] = q[row]
        for i in range(offsets.shape[0]):
            forward_and_jacobian(chain, posture, rotation, position, jacobian)
            task_kernels.coordinates(kind, rotation, position, pose)
            twist(kind, nominal[row, i], pose, error, due)
            if not damped_step(jacobian[:w], due, DAMPING, gram, scratch, step):
                step[:] = np.nan  # an unknown rate must not look like a rate of 0
            for j in range(n):
                step[j] = within(step[j], FARTHEST)
                posture[j] += step[j]
                if i > 0:
                    unit = (offsets[i] - offsets[i - 1]) * dt * speed[row]
                    features[row, first + (i - 1) * n + j] = CONTEXT * step[j] / unit


@inner
def metric_rows(kind, prismatic, twists, features, output):
    """Adds the logarithm of the metric to the last outputs of a network, row by row.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        twists: p - 1.
        features: With joint rates, see :func:`rate_rows`. Shape (B, f).
        output: Of the network; in the end ln U. Shape (B, n (w + 1) + 1 + n).
    """
    n = prismatic.shape[0]
    first, last = shown_joints(kind, prismatic) + twists * twist_size(kind) + 2, output.shape[1] - n
    for row in range(output.shape[0]):
        mean = LITTLE
        for j in range(n):
            mean += features[row, first + j] ** 2 / n
        for j in range(n):
            output[row, last + j] -= EXPONENT * math.log(features[row, first + j] ** 2 / mean + AT_REST)
