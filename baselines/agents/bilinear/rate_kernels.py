"""Kernels of what each twist ahead would ask of the joints where the arm is now, of its gradient, and of a metric.

With J the Jacobian of the twist, in the frame in which twists are seen, a mean twist v_i ahead, and the speed s of what
is ahead, the joint rates are the damped least-squares ones, Jᵀ (J Jᵀ + λ I)⁻¹ v_i / s.

Those of the first twist give the metric that a network changes, so that a joint that would be fast counts less. With
U = |q̇|⁻² a weighted least-squares step goes towards the least sum of fourth powers, which joint velocities cost
(iteratively reweighted least squares, Burrus 1994); the exponent is a step that one can take without iterating.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.agents.bilinear.damped_kernels import empty_inverse, invert, jacobian_gradient, through_inverse
from ikgym.jit import kernel
from ikgym.rl.feature_kernels import CONTEXT
from ikgym.rl.twists import is_turned, shown_joints, twist_size

#: Which joint rates are seen, if any: where the arm is now, where it will be, or of the latter the first alone, which
#: the metric depends on.
NONE, HERE, PREDICTED, FIRST = range(4)
#: λ of the joint rates: near a singularity they grow, but not without bounds.
DAMPING = 1e-2
#: θ of the metric U_j = (q̇_j² / mean q̇² + ε)^-θ, and ε, from which a joint at rest has it.
EXPONENT, AT_REST = 0.3, 0.1
#: Added to the mean of the squares: nothing may be due.
LITTLE = 1e-6


@kernel
def rate_rows(kind, chain, twists, q, features):
    """Appends the joint rates to features, twist by twist.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        twists: p, how many are seen ahead.
        q: Shape (B, n).
        features: As :func:`baselines.agents.bilinear.kernels.feature_rows` fills them, and room for the rates, which
            are written. Shape (B, f + p n).
    """
    n, w = q.shape[1], twist_size(kind)
    begin = shown_joints(kind, chain.prismatic)
    first = begin + twists * w + 2
    found, plain = empty_inverse(w, n), np.zeros(1 + n)
    for row in range(q.shape[0]):
        invert(kind, chain, DAMPING, q[row], plain, found)
        for i in range(twists):
            for j in range(n):
                rate = 0.0
                for a in range(w):
                    rate += found.products[a, j] * features[row, begin + i * w + a]
                features[row, first + i * n + j] = CONTEXT * rate


@kernel
def rate_gradient_rows(kind, chain, twists, q, features, gradient, out):
    """From the gradient by the joint rates to those by the twists and by the joint coordinates, row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        twists: p.
        q: Shape (B, n).
        features: What :func:`rate_rows` gave. Shape (B, f + p n).
        gradient: By the features; that by the twists is added to. Shape (B, f + p n).
        out: Receives that by the joint coordinates. Shape (B, n).
    """
    n, w = q.shape[1], twist_size(kind)
    begin = shown_joints(kind, chain.prismatic)
    first = begin + twists * w + 2
    found, plain = empty_inverse(w, n), np.zeros(1 + n)
    by, by_jacobian, by_logarithms = np.empty(n * (w + 1)), np.zeros((6, n)), np.empty(1 + n)
    for row in range(q.shape[0]):
        lambda_ = invert(kind, chain, DAMPING, q[row], plain, found)
        by[:] = 0.0
        for i in range(twists):
            at = begin + i * w
            for j in range(n):
                by_rate = CONTEXT * gradient[row, first + i * n + j]
                for a in range(w):
                    by[j * (w + 1) + a] += by_rate * features[row, at + a]
                    gradient[row, at + a] += by_rate * found.products[a, j]
        through_inverse(found, lambda_, by, by_logarithms, by_jacobian)
        jacobian_gradient(found.jacobian, by_jacobian, out[row])
        if is_turned(kind, chain.prismatic):
            out[row, 0] = 0.0


@kernel
def metric_rows(kind, prismatic, twists, features, output):
    """Adds the logarithm of the metric to what a network says of it, row by row.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        twists: p.
        features: What :func:`rate_rows` gave. Shape (B, f + p n).
        output: Of the network, in the end ln U; written. Shape (B, n (w + 1) + 1 + n).
    """
    n = prismatic.shape[0]
    first, last = shown_joints(kind, prismatic) + twists * twist_size(kind) + 2, output.shape[1] - n
    for row in range(output.shape[0]):
        mean = LITTLE
        for j in range(n):
            mean += features[row, first + j] ** 2 / n
        for j in range(n):
            output[row, last + j] -= EXPONENT * math.log(features[row, first + j] ** 2 / mean + AT_REST)
