"""Kernels of the bilinear agent: its features with their gradient, and its law."""

from __future__ import annotations

import numpy as np

from baselines.agents.bilinear.damped_kernels import held_rows
from baselines.agents.bilinear.features import context_rows, mean_twists
from baselines.agents.bilinear.rates import metric_rows, rate_rows
from baselines.agents.network import forward_rows
from ikgym.kernels.jit import inlined, inner, kernel
from ikgym.rl.twists import is_turned, turn, turn_gradient, twist, twist_size


@kernel
def seen_rows(kind, chain, dt, offsets, rates, q, nominal, remaining, out, speed):
    """The features of the network, row by row.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        rates: Whether joint rates are among them.
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        out: Receives the features. Shape (B, f).
        speed: Receives the speeds. Shape (B,).
    """
    context_rows(kind, chain.prismatic, chain.axes[0], dt, offsets, q, nominal, remaining, out, speed)
    if rates:
        rate_rows(kind, chain, dt, offsets, q, nominal, speed, out)


@kernel
def feature_gradient_rows(kind, prismatic, axis, twists, features, gradient, out):
    """From the gradient with respect to context features to that with respect to joint coordinates, row by row.

    The speed of the reference ahead does not depend on where the arm is.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        twists: How many are seen ahead.
        features: As :func:`baselines.agents.bilinear.features.context_rows` gives them. Shape (B, f).
        gradient: With respect to the features. Shape (B, f).
        out: Receives the gradient. Shape (B, n).
    """
    turned, n = is_turned(kind, prismatic), prismatic.shape[0]
    for row in range(features.shape[0]):
        x, g, at = features[row], gradient[row], 0
        out[row, 0] = 0.0
        for j in range(1 if turned else 0, n):
            if prismatic[j]:
                out[row, j] = g[at]
                at += 1
            else:
                out[row, j] = g[at] * x[at + 1] - g[at + 1] * x[at]
                at += 2
        if turned:
            end = at + twists * twist_size(kind)
            out[row, 0] = turn_gradient(axis, x[at:end], g[at:end])


@inlined
def seen_twist(kind, turned, axis, angle, pose, nominal, error, due):
    """The motion from a pose to the next one of the reference, seen from the frame of joint 1 where `turned`."""
    twist(kind, nominal, pose, error, due)
    if turned:
        turn(axis, -angle, due)


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
        speed, lead = mean_twists(kind, dt, offsets, nominal[row], error, ahead), offsets[0] * dt
        seen_twist(kind, turned, axis, q[row, 0], pose[row], nominal[row, 0], error, due)
        for j in range(n):
            own = output[row, j * (w + 1) : (j + 1) * (w + 1)]
            qdot = own[w] * speed
            for a in range(w):
                qdot += own[a] * due[a] / lead
            out[row, j] = qdot / velocity_limit[j]


@kernel
def law_rows(scene, damping, velocity_limit, network, batch, interval, held, left, out):
    """Features and network where they are due, and actions, row by row.

    Args:
        scene: Kind of task coordinates, the arm, Δt in [s], and the offsets.
        damping: Of :func:`baselines.agents.bilinear.damped_kernels.held_rows`, which is left out where it is 0.
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
            seen_rows(kind, chain, dt, offsets, damping > 0.0, q[own], nominal[own], remaining[own], features, speed)
            forward_rows(weights, biases, sizes, activation, squash, features, output)
            if damping > 0.0:
                metric_rows(kind, chain.prismatic, offsets.shape[0] - 1, features, output)
                held_rows(kind, chain, damping, q[own], output, held[own])
            else:
                held[row] = output[0]
        left[row] -= 1
    action_rows(scene, velocity_limit, q, pose, nominal, held, out)
