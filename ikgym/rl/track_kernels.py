"""Kernels of the environments by id: observation and reward of one arm."""

from __future__ import annotations

import math

import numpy as np

from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import kernel
from ikgym.rl.twists import is_turned, turn, twist, twist_size

#: Bound of the features.
MOST = 5.0


@kernel
def track_rows(kind, chain, scales, home, units, fastest, q, qdot, pose, nominal, out):
    """The features row by row, see :class:`ikgym.rl.Task`.

    Args:
        kind: Of task coordinates.
        chain: The arm's model, see :class:`ikgym.kernels.kinematics.Chain`.
        scales: Weight of 1 rad in [m], and the coarse and the fine unit of distances in [m].
        home: Posture in [rad] or [m] from which joints are seen. Shape (n,).
        units: Of joint coordinates in [rad] or [m]. Shape (n,).
        fastest: Largest joint velocities in [rad/s] or [m/s]. Shape (n,).
        q: Shape (N, n).
        qdot: Shape (N, n).
        pose: Shape (N, m).
        nominal: Shape (N, p, m).
        out: Receives the features. Shape (N, 2 n + 2 p w).
    """
    radian, coarse, fine = scales
    n, w, turned = q.shape[1], twist_size(kind), is_turned(kind, chain.prismatic)
    error, missing = np.empty(6), np.empty(w)
    for row in range(q.shape[0]):
        for j in range(n):
            out[row, j] = min(max((q[row, j] - home[j]) / units[j], -MOST), MOST)
            out[row, n + j] = min(max(qdot[row, j] / fastest[j], -MOST), MOST)
        at = 2 * n
        for i in range(nominal.shape[1]):
            twist(kind, nominal[row, i], pose[row], error, missing)
            if turned:
                turn(chain.axes[0], -q[row, 0], missing)
            for a in range(w):
                turning = (a < 3) == (kind == task_kernels.SKEW)  # skew coordinates begin with the orientation
                distance = radian * missing[a] if turning else missing[a]
                out[row, at + a] = min(max(distance / coarse, -MOST), MOST)
                out[row, at + w + a] = math.tanh(distance / fine)
            at += 2 * w
