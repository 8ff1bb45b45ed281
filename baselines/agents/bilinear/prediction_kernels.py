"""Kernel of what the reference ahead will ask of the joints: their rates at the postures where the arm will be then.

From where the arm is, damped least-squares steps lead to one reference pose ahead after the other,

    q_0 = q + S(q) e_0(q),  q_(i+1) = q_i + S(q_i) e_(i+1)(q_i),  S = Jᵀ (J Jᵀ + λ I)⁻¹,

with e_i(q) the twist from the pose at q to the reference at offset o_i. The step over the time that it takes is a joint
rate. A singularity that lies ahead is seen by the rates that it will ask for, while there is time to go around it; at
the posture of now (:func:`baselines.agents.bilinear.rate_kernels.rate_rows`) it is not.
"""

from __future__ import annotations

import numpy as np

from baselines.agents.bilinear.rate_kernels import DAMPING
from baselines.solvers.linear_algebra import damped_step
from ikgym import task_kernels
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.limit_kernels import within
from ikgym.rl.feature_kernels import CONTEXT
from ikgym.rl.twists import twist, twist_size

#: A joint goes no farther in one step, in [rad] or [m]: an arm that is far off its path is no reason to guess wildly.
FARTHEST = 0.5


@kernel
def predicted_rate_rows(kind, chain, dt, offsets, q, nominal, speed, features, twists):
    """Appends the joint rates between the offsets to features, in units of the speed of what is ahead.

    Args:
        kind: Of task coordinates, but for skew ones, which are no twists.
        chain: The arm.
        dt: Δt in [s].
        offsets: Shape (p,).
        q: Shape (B, n).
        nominal: Reference task coordinates at the offsets. Shape (B, p, m).
        speed: Shape (B,).
        features: Receives the rates in its last columns. Shape (B, f + (p - 1) n).
        twists: Of how many twists, at most p - 1; the columns of the others stay as they were.
    """
    n, w, first = q.shape[1], twist_size(kind), features.shape[1] - (offsets.shape[0] - 1) * q.shape[1]
    rotation, position, jacobian, pose = np.empty((3, 3)), np.empty(3), np.empty((6, n)), np.empty(nominal.shape[2])
    gram, scratch, error, due = np.empty((w, w)), np.empty(w), np.empty(6), np.empty(w)
    posture, step = np.empty(n), np.empty(n)
    for row in range(q.shape[0]):
        posture[:] = q[row]
        for i in range(1 + twists):
            forward_and_jacobian(chain, posture, rotation, position, jacobian)
            task_kernels.coordinates(kind, rotation, position, pose)
            twist(kind, nominal[row, i], pose, error, due)
            if not damped_step(jacobian[:w], due, DAMPING, gram, scratch, step):
                step[:] = np.nan  # no Jacobian: what is not known must not look as if nothing was asked
            for j in range(n):
                step[j] = within(step[j], FARTHEST)
                posture[j] += step[j]
                if i > 0:
                    unit = (offsets[i] - offsets[i - 1]) * dt * speed[row]
                    features[row, first + (i - 1) * n + j] = CONTEXT * step[j] / unit
