"""Compiled law of agents whose velocities are in units of what is asked for."""

from __future__ import annotations

import math

import numpy as np

from baselines.agents.bilinear.damped_kernels import held_rows
from baselines.agents.network import forward_rows
from ikgym.jit import kernel
from ikgym.rl.feature_kernels import LEAST, observe_rows
from ikgym.rl.twists import twist_size


@kernel
def velocity_rows(bilinear, squashed, gain, largest, velocity_limit, features, unit, output, out):
    """Network outputs as fractions of the velocity limit, see :class:`baselines.agents.relative.processing.Relative`.

    Args:
        bilinear: Whether outputs are the rows of G and h, joint by joint.
        squashed: Whether tanh keeps velocities within their bounds.
        gain: See there.
        largest: See there.
        velocity_limit: In [rad/s] or [m/s]. Shape (n,).
        features: Shape (B, f).
        unit: In [rad/s] or [m/s]. Shape (B,).
        output: Shape (B, n), of a bilinear network (B, n (w + 1)).
        out: Receives the fractions. Shape (B, n).
    """
    n = out.shape[1]
    width = output.shape[1] // n
    for row in range(out.shape[0]):
        for j in range(n):
            said = float(output[row, j * width + width - 1])
            if bilinear:  # h_j · 1 / (0.2 + |v̂|), and row j of G times what is due
                said *= features[row, width - 1] / LEAST
                for a in range(width - 1):
                    said += float(output[row, j * width + a]) * features[row, a]
            said *= gain
            said = largest * math.tanh(said / largest) if squashed else min(max(said, -largest), largest)
            out[row, j] = said * unit[row] / velocity_limit[j]


@kernel
def law_rows(ahead, meaning, damping, velocity_limit, network, batch, out):
    """The whole law, row by row: :func:`ikgym.rl.feature_kernels.observe_rows`, the network, :func:`velocity_rows`.

    Args:
        ahead: The first five arguments of `observe_rows`.
        meaning: The first four of :func:`velocity_rows`.
        damping: Of :func:`baselines.agents.bilinear.damped_kernels.held_rows`, which is left out where it is 0.
        velocity_limit: In [rad/s] or [m/s]. Shape (n,).
        network: The first five of :func:`baselines.agents.network.forward_rows`.
        batch: q, q̇, pose, reference and steps left, as of `observe_rows`.
        out: Receives fractions of the velocity limit. Shape (B, n).
    """
    kind, chain, dt, offsets, furthest = ahead
    bilinear, squashed, gain, largest = meaning
    weights, biases, sizes, activation, squash = network
    q, qdot, pose, nominal, remaining = batch
    features, unit = np.empty((q.shape[0], sizes[0]), np.float32), np.empty(q.shape[0])
    observe_rows(kind, chain, dt, offsets, furthest, q, qdot, pose, nominal, remaining, features, unit)
    output = np.empty((q.shape[0], sizes[sizes.shape[0] - 1]), np.float32)
    forward_rows(weights, biases, sizes, activation, squash, features, output)
    if damping > 0.0:
        held = np.empty((q.shape[0], q.shape[1] * (twist_size(kind) + 1)))
        held_rows(kind, chain, damping, q, output, held)
        velocity_rows(bilinear, squashed, gain, largest, velocity_limit, features, unit, held, out)
    else:
        velocity_rows(bilinear, squashed, gain, largest, velocity_limit, features, unit, output, out)
