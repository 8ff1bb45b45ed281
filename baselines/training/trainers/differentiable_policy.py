"""Any policy in PyTorch, differentiated by finite differences."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from baselines.policy import Memory, SolverPolicy
from baselines.training.trainers.arm_gradients import STEP
from ikgym.arms import Arm
from ikgym.task_kernels import pose_rows
from ikgym.validation import FloatArray


class DifferentiablePolicy:
    """A base policy, with its derivative by the joint coordinates.

    What it sees of the pose moves with the joint coordinates, as the arm does; its memory and what it is shown of the
    nominal trajectory do not.

    Args:
        policy: The policy.
        arm: The arm that is measured.
    """

    def __init__(self, policy: SolverPolicy, arm: Arm) -> None:
        self._policy, self._arm = policy, arm

    def __call__(
        self,
        q: Tensor,
        qdot: Tensor,
        nominal: FloatArray,
        remaining: FloatArray,
        memory: Memory,
        *,
        with_gradient: bool,
    ) -> tuple[Tensor, Memory]:
        """Actions of the policy, and its memory after them.

        Args:
            q: Shape (N, n).
            qdot: Shape (N, n).
            nominal: As the policy is shown it. Shape (N, p, m).
            remaining: Shape (N, 1).
            memory: What the last call gave, or its `memory` at the start of episodes.
            with_gradient: Whether gradients are wanted.
        """
        here = q.detach().numpy()
        rows, n = here.shape
        copies = n + 1 if with_gradient else 1
        moved = np.repeat(here[None], copies, 0)
        for j in range(copies - 1):
            moved[j + 1, :, j] += STEP
        moved = moved.reshape(-1, n)
        pose = np.empty((len(moved), nominal.shape[2]))
        pose_rows(self._arm.chain, self._policy.problem.task.kind, moved, pose)
        seen = {"q": moved, "pose": pose}
        for name, array in {"qdot": qdot.detach().numpy(), "nominal": nominal, "remaining": remaining}.items():
            seen[name] = np.concatenate([array] * copies) if with_gradient else array
        kept = tuple(np.concatenate([array] * copies) for array in memory) if with_gradient else memory
        nothing = np.zeros(len(moved), dtype=np.int64)
        action, state = self._policy.predict(seen, (nothing, nothing, *kept))
        after = tuple(array[:rows] for array in self._policy.memory_of(state))
        if not with_gradient:
            return torch.from_numpy(action.astype(np.float64)), after
        actions = action.astype(np.float64).reshape(copies, rows, n)
        by_q = torch.from_numpy((actions[1:] - actions[0]) / STEP)  # (n of q, N, n of the action)
        result: Tensor = _Linear.apply(q, torch.from_numpy(actions[0].copy()), by_q)  # type: ignore[no-untyped-call]
        return result, after


class _Linear(torch.autograd.Function):
    """A function of q that is known by its value and its derivatives (n, N, n)."""

    @staticmethod
    def forward(ctx: Any, q: Tensor, value: Tensor, by_q: Tensor) -> Tensor:
        ctx.save_for_backward(by_q)
        return value

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        (by_q,) = ctx.saved_tensors
        return torch.einsum("jra,ra->rj", by_q, gradient), None, None
