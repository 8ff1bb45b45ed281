"""Kernels of the bilinear actor: its features, their gradient, and what the output of its network means."""

from __future__ import annotations

import numpy as np

from baselines.agents.bilinear.damped_kernels import held_rows, with_matrix
from baselines.agents.bilinear.prediction_kernels import predicted_rate_rows
from baselines.agents.bilinear.rate_kernels import FIRST, HERE, NONE, PREDICTED, metric_rows, rate_rows
from baselines.agents.network import forward_rows
from ikgym.jit import inlined, kernel
from ikgym.rl.feature_kernels import feature_row, mean_twists
from ikgym.rl.twists import is_turned, shown_joints, turn, turn_gradient, twist, twist_size


@kernel
def feature_rows(kind, prismatic, axis, dt, offsets, q, nominal, remaining, out, speed):
    """:func:`feature_row`, row by row.

    Entered once a `predict`, with its arrays one by one as in :func:`baselines.agents.feature_kernels.feature_rows`.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        out: Receives the features. Shape (B, f).
        speed: Receives the speeds. Shape (B,).
    """
    error, ahead = np.empty(6), np.empty((offsets.shape[0] - 1, twist_size(kind)))
    for row in range(q.shape[0]):
        speed[row] = mean_twists(kind, dt, offsets, nominal[row], error, ahead)
        feature_row(kind, prismatic, axis, q[row], ahead, speed[row], remaining[row, 0], out[row])


@kernel
def seen_rows(kind, chain, dt, offsets, rates, q, nominal, remaining, out, speed):
    """All that a network sees, row by row: :func:`feature_rows` and the joint rates.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        rates: Which joint rates are shown: NONE, HERE (:func:`baselines.agents.bilinear.rate_kernels.rate_rows`),
            PREDICTED (:func:`baselines.agents.bilinear.prediction_kernels.predicted_rate_rows`), or FIRST, which leaves
            all but the first of these as they were.
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        out: Receives the features. Shape (B, f).
        speed: Receives the speeds. Shape (B,).
    """
    feature_rows(kind, chain.prismatic, chain.axes[0], dt, offsets, q, nominal, remaining, out, speed)
    if rates == HERE:
        rate_rows(kind, chain, offsets.shape[0] - 1, q, out)
    elif rates == PREDICTED:
        predicted_rate_rows(kind, chain, dt, offsets, q, nominal, speed, out, offsets.shape[0] - 1)
    elif rates == FIRST:
        predicted_rate_rows(kind, chain, dt, offsets, q, nominal, speed, out, 1)


@kernel
def new_features(kind, chain, dt, offsets, rates, q, nominal, remaining):
    """:func:`seen_rows` in an array of their own, as float32: made here, it takes a fifth of the time.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        rates: See :func:`seen_rows`.
        q: Shape (B, n).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).

    Returns:
        Shape (B, f), float32.
    """
    prismatic, twists = chain.prismatic, offsets.shape[0] - 1
    size = shown_joints(kind, prismatic) + twists * twist_size(kind) + 2
    shown = size + (twists * q.shape[1] if rates != NONE else 0)
    out, speed = np.empty((q.shape[0], shown), np.float32), np.empty(q.shape[0])
    seen_rows(kind, chain, dt, offsets, rates, q, nominal, remaining, out, speed)
    return out


@kernel
def feature_gradient_rows(kind, prismatic, axis, twists, features, gradient, out):
    """From the gradient by the features of :func:`feature_rows` to that by the joint coordinates, row by row.

    The speed of what is ahead does not depend on where the arm is.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        twists: How many are seen ahead.
        features: What :func:`feature_rows` gave, perhaps more. Shape (B, f).
        gradient: By the features. Shape (B, f).
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


@kernel
def due_rows(kind, prismatic, axis, dt, offsets, q, pose, nominal, due, speed):
    """What G and h are multiplied by, row by row, in units of the speed: q̇ / s = G v / s + h.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: At the offsets. Shape (B, p, m).
        due: Receives v / s. Shape (B, w).
        speed: Receives s. Shape (B,).
    """
    turned, w = is_turned(kind, prismatic), due.shape[1]
    error, ahead = np.empty(6), np.empty((offsets.shape[0] - 1, w))
    for row in range(q.shape[0]):
        speed[row], lead = mean_twists(kind, dt, offsets, nominal[row], error, ahead), offsets[0] * dt
        seen_twist(kind, turned, axis, q[row, 0], pose[row], nominal[row, 0], error, due[row])
        for a in range(w):
            due[row, a] /= lead * speed[row]


@kernel
def action_rows(kind, prismatic, axis, dt, offsets, velocity_limit, q, pose, nominal, output, out):
    """The actions that network outputs mean, row by row: q̇ = G v + h s.

    Args:
        kind: Of task coordinates.
        prismatic: Shape (n,).
        axis: Shape (3,).
        dt: Δt in [s].
        offsets: Shape (p,).
        velocity_limit: Shape (n,).
        q: Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: At the offsets. Shape (B, p, m).
        output: Row j of G and h_j, joint by joint. Shape (B, n (w + 1)).
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    turned, n, w = is_turned(kind, prismatic), q.shape[1], twist_size(kind)
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
def law_rows(
    kind,
    chain,
    dt,
    offsets,
    rates,
    damping,
    velocity_limit,
    weights,
    biases,
    sizes,
    activation,
    squash,
    q,
    pose,
    nominal,
    remaining,
    out,
):
    """The whole law, row by row: :func:`new_features`, the network, :func:`action_rows`, in one call from Python.

    Args:
        kind: Of task coordinates.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        rates: See :func:`seen_rows`.
        damping: Of :func:`baselines.agents.bilinear.damped_kernels.held_rows`, which is left out where it is 0.
        velocity_limit: Shape (n,).
        weights: See :func:`baselines.agents.network.forward_rows`.
        biases: See there.
        sizes: See there.
        activation: See there.
        squash: See there.
        q: Shape (B, n).
        pose: Shape (B, m).
        nominal: At the offsets. Shape (B, p, m).
        remaining: Shape (B, 1).
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    prismatic, axis, n = chain.prismatic, chain.axes[0], q.shape[1]
    features = new_features(kind, chain, dt, offsets, rates, q, nominal, remaining)
    output = np.empty((q.shape[0], sizes[sizes.shape[0] - 1]), np.float32)
    forward_rows(weights, biases, sizes, activation, squash, features, output)
    if damping > 0.0:
        held = np.empty((q.shape[0], n * (twist_size(kind) + 1)))
        if output.shape[1] == 2 * n + 1:
            output = with_matrix(twist_size(kind), output)
        metric_rows(kind, prismatic, offsets.shape[0] - 1, features, output)
        held_rows(kind, chain, damping, q, output, held)
        action_rows(kind, prismatic, axis, dt, offsets, velocity_limit, q, pose, nominal, held, out)
    else:
        action_rows(kind, prismatic, axis, dt, offsets, velocity_limit, q, pose, nominal, output, out)
