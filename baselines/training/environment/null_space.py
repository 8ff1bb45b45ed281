"""What a null motion does, in coordinates of the null space."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from baselines.training.gradients.law import Law
from ikgym.rl.feature_kernels import jacobian_rows
from ikgym.rl.twists import twist_size
from ikgym.validation import FloatArray


def null_maps(law: Law, q: Tensor, features: Tensor) -> FloatArray:
    """From the h that a network gives to the motion of the joints that is left of it.

    With an orthonormal basis B of the null space of the Jacobian J, and G the weighted damped inverse of a network that
    says nothing else, (I - G J) h is B M h, but for what the damping lets through: M = Bᵀ (I - G J). The sign of a
    basis is whatever the singular value decomposition makes it.

    Args:
        law: Of an agent without a matrix.
        q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
        features: What the law gives of them. Shape (N, f), float64.

    Returns:
        M. Shape (N, n - w, n).
    """
    count, n = q.shape
    w = int(twist_size(law.task.kind))
    jacobians = np.empty((count, w, n))
    jacobian_rows(law.task.kind, law.chain, q.numpy(), jacobians.reshape(count, w * n))  # which is a view
    with torch.no_grad():
        held = law.held(q, features, torch.zeros(count, law.outputs, dtype=torch.float64))
    inverses = held.numpy().reshape(count, n, w + 1)[:, :, :w]
    bases = np.linalg.svd(jacobians)[2][:, w:]
    out: FloatArray = bases - bases @ inverses @ jacobians
    return out
