"""What the compiled kernels compute, as functions of PyTorch with gradients.

Kinematics come with their exact Jacobian; the projector into the null space is differentiated by differences.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from baselines.agents.features import project_rows
from ikgym import task_kernels
from ikgym.arms import Arm
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.tasks import Task
from ikgym.validation import FloatArray

#: Step of the differences by joint coordinates, in [rad] or [m]: actions are float32, and kinks are rare.
STEP = 1e-4


def task_error(q: Tensor, nominal: FloatArray, arm: Arm, task: Task) -> Tensor:
    """The error of the task coordinates.

    Args:
        q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
        nominal: Task coordinates. Shape (N, m).
        arm: The arm.
        task: Which coordinates.

    Returns:
        As :meth:`ikgym.tasks.Task.error`. Shape (N, e), float64.
    """
    error: Tensor = _TaskError.apply(q, nominal, arm, task)  # type: ignore[no-untyped-call]
    return error


def projected(q: Tensor, velocity: Tensor, model: Arm, task: Task, damping: float) -> Tensor:
    """Velocities projected into the null space, see :func:`baselines.agents.features.project_rows`.

    Args:
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        velocity: What is projected. Shape (N, n).
        model: Whose task Jacobian is meant.
        task: Which coordinates.
        damping: λ of the projector.

    Returns:
        Shape (N, n), float64.
    """
    out: Tensor = _Projected.apply(q, velocity, model, task, damping)  # type: ignore[no-untyped-call]
    return out


class _TaskError(torch.autograd.Function):
    """The error of the task coordinates, with its exact Jacobian."""

    @staticmethod
    def forward(ctx: Any, q: Tensor, nominal: FloatArray, arm: Arm, task: Task) -> Tensor:
        joints = q.detach().numpy()
        error = np.empty((len(joints), task.error_size))
        jacobian = np.empty((*error.shape, joints.shape[1]))
        error_rows(arm.chain, task.kind, joints, np.ascontiguousarray(nominal), error, jacobian)
        ctx.save_for_backward(torch.from_numpy(jacobian))
        return torch.from_numpy(error)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None, None]:
        (jacobian,) = ctx.saved_tensors
        return torch.einsum("ra,raj->rj", gradient, jacobian), None, None, None


class _Projected(torch.autograd.Function):
    """Velocities through the null space, see :func:`baselines.agents.features.project_rows`."""

    @staticmethod
    def forward(ctx: Any, q: Tensor, velocity: Tensor, model: Arm, task: Task, damping: float) -> Tensor:
        ctx.save_for_backward(q, velocity)
        ctx.projector = model, task, damping
        return _project(q.detach().numpy(), velocity.detach().numpy(), *ctx.projector)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, Tensor, None, None, None]:
        q, velocity = (tensor.numpy() for tensor in ctx.saved_tensors)
        rows, n = q.shape
        moved = np.repeat(q[None], n + 1, 0)
        for j in range(n):
            moved[j + 1, :, j] += STEP
        results = _project(moved.reshape(-1, n), np.concatenate([velocity] * (n + 1)), *ctx.projector)
        results = results.reshape(n + 1, rows, n)
        by_q = torch.einsum("jra,ra->rj", (results[1:] - results[0]) / STEP, gradient)
        # The projector is symmetric.
        return by_q, _project(q, gradient.numpy(), *ctx.projector), None, None, None


def _project(q: FloatArray, velocity: FloatArray, model: Arm, task: Task, damping: float) -> Tensor:
    out = np.array(velocity)
    project_rows(model.chain, task.kind, damping, task.error_size, q, out)
    return torch.from_numpy(out)


@kernel
def error_rows(chain, kind, q, nominal, error, jacobian):
    """Errors of the task coordinates and their derivatives, row by row.

    Args:
        chain: The arm.
        kind: Of task coordinates, see :mod:`ikgym.task_kernels`.
        q: Joint coordinates in [rad] or [m]. Shape (N, n).
        nominal: Task coordinates. Shape (N, m).
        error: Receives the errors. Shape (N, e).
        jacobian: Receives ∂error/∂q. Shape (N, e, n).
    """
    rotation, position, pose = np.empty((3, 3)), np.empty(3), np.empty(nominal.shape[1])
    geometric, task_jacobian = np.empty((6, q.shape[1])), np.empty(jacobian.shape[1:])
    for row in range(q.shape[0]):
        forward_and_jacobian(chain, q[row], rotation, position, geometric)
        task_kernels.coordinates(kind, rotation, position, pose)
        task_kernels.jacobian(kind, rotation, geometric, task_jacobian)
        task_kernels.error(kind, nominal[row], pose, error[row])
        task_kernels.error_jacobian(kind, nominal[row], pose, error[row], task_jacobian, jacobian[row])
