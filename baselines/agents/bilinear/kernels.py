"""Kernels of the law of the bilinear agent."""

from __future__ import annotations

import numpy as np

from baselines.agents.bilinear.damped_kernels import held_rows
from baselines.agents.bilinear.features import feature_rows, mean_twists, metric_rows
from baselines.agents.network import forward_rows
from ikgym.kernels.jit import inlined, inner, kernel
from ikgym.rl.twists import is_turned, turn, twist, twist_size


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
            out[row, j] = commanded(output[row], j, due, speed, dt) / velocity_limit[j]


@inlined
def commanded(output, j, due, speed, dt):
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
        damping: See :func:`baselines.agents.bilinear.damped_kernels.held_rows`.
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
            own = slice(row, row + 1)
            feature_rows(kind, chain, dt, offsets, q[own], nominal[own], remaining[own], features, speed)
            forward_rows(weights, biases, sizes, activation, squash, features, output)
            metric_rows(kind, chain.prismatic, offsets.shape[0] - 1, features, output)
            held_rows(kind, chain, damping, q[own], output, held[own])
        left[row] -= 1
    action_rows(scene, velocity_limit, q, pose, nominal, held, out)
