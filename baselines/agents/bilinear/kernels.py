"""Kernels of the law of the bilinear agent, and of the damped inverse that its network tunes.

With J the Jacobian of the twist, in the frame in which twists are seen, U a diagonal metric of the joints and λ a
damping, which are network outputs like G and h,

    G' = G + U Jᵀ (J U Jᵀ + λ I)⁻¹

replaces G (weighted damped least squares, as in Nakamura and Hanafusa 1986), and its projection into the null space,
h' = (I - G' J) h, replaces h. An output holds G and h, then ln λ relative to the initial λ, then ln U; both logarithms
are clipped at ±:data:`LARGEST`.
"""

from __future__ import annotations

import math

import numpy as np

from baselines.agents.bilinear.features import feature_rows, mean_twists, metric_rows, seen_jacobian
from baselines.agents.network import forward_rows
from ikgym.kernels.jit import inlined, inner, kernel
from ikgym.kernels.linear_algebra import damped_gram, ldl, ldl_scaled_inverse
from ikgym.rl.twists import is_turned, turn, twist, twist_size

#: Bound of the logarithms.
LARGEST = 6.0


@kernel
def gain_rows(kind, chain, damping, q, output, out):
    """(G', h'), row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The initial λ, above 0.
        q: Shape (B, n).
        output: Of the network. Shape (B, n (w + 1) + 1 + n).
        out: Receives (G', h'), float64. Shape (B, n (w + 1)).
    """
    n, w = q.shape[1], twist_size(kind)
    jacobian, metric, products, moved = np.empty((6, n)), np.empty(n), np.empty((w, n)), np.empty(w)
    for row in range(q.shape[0]):
        outputs, gains = output[row], out[row]
        invert(kind, chain, damping, q[row], outputs[n * (w + 1) :], jacobian, metric, products)
        for a in range(w):  # J h, the motion of the tool that h alone causes
            moved[a] = 0.0
            for j in range(n):
                moved[a] += jacobian[a, j] * outputs[j * (w + 1) + w]
        for j in range(n):
            first = j * (w + 1)
            gains[first + w] = outputs[first + w]
            for a in range(w):
                gains[first + a] = outputs[first + a] + metric[j] * products[a, j]
                gains[first + w] -= gains[first + a] * moved[a]


@inner
def invert(kind, chain, damping, q, given, jacobian, metric, products):
    """The damped inverse of one arm; an output that is NaN leads to NaN.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        damping: The initial λ.
        q: Shape (n,).
        given: ln λ relative to the initial one, and ln U. Shape (1 + n,).
        jacobian: Receives J, see :func:`baselines.agents.bilinear.features.seen_jacobian`. Shape (6, n).
        metric: Receives the diagonal of U. Shape (n,).
        products: Receives (J U Jᵀ + λ I)⁻¹ J. Shape (w, n).
    """
    w, n = products.shape
    scaled, factor, inverse = np.empty((w, n)), np.empty((w, w)), np.empty((w, w))
    seen_jacobian(kind, chain, q, np.empty(n), np.empty((3, 3)), np.empty(3), jacobian)
    lambda_ = damping * from_logarithm(given[0])
    for j in range(n):
        metric[j] = from_logarithm(given[1 + j])
        root = math.sqrt(metric[j])
        for a in range(w):
            scaled[a, j] = jacobian[a, j] * root
    damped_gram(scaled, lambda_, factor)
    if ldl(factor):
        ldl_scaled_inverse(factor, 1.0, inverse)
    else:
        inverse[:] = np.nan
    for a in range(w):
        for j in range(n):
            total = 0.0
            for b in range(w):
                total += inverse[a, b] * jacobian[b, j]
            products[a, j] = total


@inlined
def from_logarithm(number):
    """The number whose logarithm is an output."""
    return math.exp(min(max(number, -LARGEST), LARGEST))


@inner
def action_rows(scene, velocity_limit, q, pose, nominal, output, out):
    """Actions from (G, h), row by row: q̇ = G v + h s.

    Args:
        scene: See :func:`law_rows`.
        velocity_limit: Shape (n,).
        q: Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: At the offsets. Shape (B, p, m).
        output: Row j of G and h_j, joint by joint. Shape (B, n (w + 1)).
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    kind, chain, dt, offsets = scene
    turned, n, w, axis = is_turned(kind, chain.prismatic), q.shape[1], twist_size(kind), chain.axes[0]
    error, due, ahead = np.empty(6), np.empty(w), np.empty((offsets.shape[0] - 1, w))
    for row in range(q.shape[0]):
        speed = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        twist(kind, nominal[row, 0], pose[row], error, due)
        if turned:  # seen from the frame of joint 1
            turn(axis, -q[row, 0], due)
        for j in range(n):
            out[row, j] = joint_command(output[row], j, due, speed, dt) / velocity_limit[j]


@inlined
def joint_command(output, j, due, speed, dt):
    """The velocity command of joint ``j``: row j of G times the remaining twist, plus h_j s."""
    w = due.shape[0]
    velocity = output[j * (w + 1) + w] * speed
    for a in range(w):
        velocity += output[j * (w + 1) + a] * due[a] / dt
    return velocity


@kernel
def law_rows(scene, damping, velocity_limit, network, batch, interval, held, left, out):
    """Features and network where they are due, and actions, row by row.

    Args:
        scene: Kind of task coordinates, the arm, Δt in [s], and the offsets.
        damping: See :func:`gain_rows`.
        velocity_limit: Shape (n,).
        network: The first five arguments of :func:`baselines.agents.network.forward_rows`.
        batch: q, q̇, pose, reference at the offsets and steps left. Shape (B, …).
        interval: Steps from one evaluation of the network to the next.
        held: (G, h) of the last evaluation, replaced where one is due. Shape (B, n (w + 1)).
        left: Steps until the next evaluation, counted down. Shape (B,).
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    kind, chain, dt, offsets = scene
    q, _, pose, nominal, remaining = batch
    weights, biases, sizes, activation, squash = network
    features, speed = np.empty((1, sizes[0]), np.float32), np.empty(1)
    output = np.empty((1, sizes[sizes.shape[0] - 1]), np.float32)
    for row in range(q.shape[0]):
        if left[row] == 0:
            left[row] = interval
            one = slice(row, row + 1)
            feature_rows(kind, chain, dt, offsets, q[one], nominal[one], remaining[one], features, speed)
            forward_rows(weights, biases, sizes, activation, squash, features, output)
            metric_rows(kind, chain.prismatic, offsets.shape[0] - 1, features, output)
            gain_rows(kind, chain, damping, q[one], output, held[one])
        left[row] -= 1
    action_rows(scene, velocity_limit, q, pose, nominal, held, out)
