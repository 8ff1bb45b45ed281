"""The arrays of the interior point method."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.solvers.receding_horizon.newton.workspace import NewtonWorkspace, newton_workspace
from ikgym import task_kernels
from ikgym.jit import kernel

Floats = npt.NDArray[np.float64]


# What is kept of a barrier: λ; and φ', what was taken for φ'', and u at the path before.
MULTIPLIER, GRADIENT, CURVATURE, BEYOND = range(4)
BARRIER_SIZE = 4


class InteriorWorkspace(NamedTuple):
    """Arrays of the interior point method, for paths of up to K knots.

    Attributes:
        newton: Those of Newton's method.
        barriers: Of the knots' errors, then of their velocities, changes of velocity and positions, at the upper and at
            the lower bound. Shape (K, e + 3 n, 2, 4).
        before: Velocities of the block before. Shape (n,).
    """

    newton: NewtonWorkspace
    barriers: Floats
    before: Floats


@kernel
def interior_workspace(kind, m, knots, n):
    """The workspace for paths of up to ``knots`` knots, task coordinates of ``m`` numbers and ``n`` joints."""
    barriers = np.zeros((knots, task_kernels.error_size(kind, m) + 3 * n, 2, BARRIER_SIZE))
    return InteriorWorkspace(newton_workspace(kind, m, knots, n), barriers, np.empty(n))


@kernel
def path_workspace(problem, knots):
    """The workspace for paths of up to ``knots`` knots of a problem, without barriers where it needs none."""
    kind, m, n = problem.data.kind, problem.nominal.shape[1], problem.start.shape[0]
    workspace = interior_workspace(kind, m, knots if problem.change_limit.shape[0] > 0 else 0, n)
    return InteriorWorkspace(newton_workspace(kind, m, knots, n), workspace.barriers, workspace.before)
