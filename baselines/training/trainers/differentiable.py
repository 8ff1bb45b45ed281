"""The step of the environment and the features of an agent in PyTorch, with gradients through the arm.

What the compiled kernels compute stays with them: kinematics come with their exact Jacobian, and a policy under the
agent, which may be any, is differentiated by differences. All of it is float64; only the network is not.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from baselines.agents.features import LARGEST, Processing, project_rows, speed_rows
from baselines.policy import Memory, SolverPolicy
from ikgym import task_kernels
from ikgym.arms import Arm
from ikgym.cost_kernels import P_X_INSIDE
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.kinematics import forward_and_jacobian
from ikgym.scenarios import Scenario
from ikgym.task_kernels import pose_rows
from ikgym.tasks import Task
from ikgym.validation import FloatArray

#: Step of the differences by joint coordinates, in [rad] or [m]: actions are float32, and kinks are rare.
STEP = 1e-4


class DifferentiableArm:
    """The arm of a scenario, its task and its cost, for N rows at a time.

    Args:
        scenario: What is to be tracked; its joint velocities are what is asked for.

    Raises:
        InvalidInputError: The scenario disturbs the joint velocities, or does not show the pose at its start.
    """

    def __init__(self, scenario: Scenario) -> None:
        if np.any(scenario.disturbance.bias) or np.any(scenario.disturbance.noise):
            raise InvalidInputError(f"Scenario {scenario.name!r}: its disturbance has no gradient that could be known.")
        if scenario.initial_pose is not None:
            raise InvalidInputError(f"Scenario {scenario.name!r}: its first pose is not that of the arm.")
        self.scenario = scenario
        self._limit = torch.from_numpy(scenario.velocity_limit.copy())
        self._prismatic = torch.from_numpy(np.array(scenario.model.chain.prismatic))

    def error(self, q: Tensor, nominal: FloatArray) -> Tensor:
        """What is missing from the pose of the arm to nominal coordinates.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
            nominal: Task coordinates. Shape (N, m).

        Returns:
            As :meth:`ikgym.tasks.Task.error`. Shape (N, e), float64.
        """
        error: Tensor = _TaskError.apply(q, nominal, self.scenario.arm, self.scenario.task)  # type: ignore[no-untyped-call]
        return error

    def step(self, q: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Where the arm is after a step (Varga 2021, eq. 5).

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n).
            action: As fractions of the velocity limit; cut to the box. Shape (N, n).

        Returns:
            Joint coordinates, and joint velocities in [rad/s] or [m/s]. Shapes (N, n).
        """
        qdot = action.clamp(-1.0, 1.0) * self._limit
        return q + self.scenario.dt * qdot, qdot

    def stage_cost(self, error: Tensor, qdot: Tensor) -> Tensor:
        """Φ^X + Φ^U, see :class:`ikgym.TrackingCost`.

        Args:
            error: After the step. Shape (N, e).
            qdot: In the step, in [rad/s] or [m/s]. Shape (N, n).

        Returns:
            Shape (N,).
        """
        cost = self.scenario.cost
        tracking = _powers(error / cost.delta_x, P_X_INSIDE, cost.p_x)
        return tracking + _powers(qdot / cost.delta_qdot, cost.p_in, cost.p_out)

    def features(
        self,
        processing: Processing,
        q: Tensor,
        qdot: Tensor,
        nominal: FloatArray,
        remaining: FloatArray,
        base: Tensor | None,
    ) -> tuple[Tensor, Tensor]:
        """The features of :class:`Processing`, and the speed that they are measured by.

        Args:
            processing: What the agent sees.
            q: Joint coordinates in [rad] or [m]. Shape (N, n).
            qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
            nominal: Nominal coordinates at the offsets. Shape (N, p, m).
            remaining: Steps left. Shape (N, 1).
            base: Actions of the policy under the agent. Shape (N, n).

        Returns:
            Features of shape (N, f), and speeds of shape (N, 1), both float64.
        """
        task, dt = self.scenario.task, self.scenario.dt
        offsets = np.array(processing.offsets)
        ahead = np.empty((*nominal.shape[:2], task.error_size))
        speed = torch.from_numpy(speed_rows(task.kind, dt, offsets, nominal, ahead))[:, None]
        velocity = torch.from_numpy(ahead[:, :-1])
        error, lead = self.error(q, nominal[:, 0]), offsets[0] * dt
        turning = torch.stack([q.sin(), q.cos()], 2)
        sliding = torch.stack([_compressed(q), torch.zeros_like(q)], 2)
        parts = [
            torch.where(self._prismatic[:, None], sliding, turning).flatten(1),
            _compressed(qdot / speed),
            _compressed((error - lead * velocity[:, 0]) / self.scenario.cost.delta_x),
            _compressed(error / (lead * speed)),
            _compressed(velocity / speed[:, :, None]).flatten(1),
            speed.log(),
            torch.from_numpy(np.minimum(remaining / offsets[-1], 1.0)),
        ]
        if base is not None:
            parts.append(_compressed(base * self._limit / speed))
        return torch.cat(parts, 1), speed

    def action(self, processing: Processing, q: Tensor, speed: Tensor, answer: Tensor, base: Tensor | None) -> Tensor:
        """What answers mean, see :meth:`Processing.action`.

        Args:
            processing: What answers mean.
            q: Shape (N, n).
            speed: What :meth:`features` gave. Shape (N, 1).
            answer: Of the network. Shape (N, n).
            base: Actions of the policy under the agent. Shape (N, n).

        Returns:
            Fractions of the velocity limit. Shape (N, n), float64.
        """
        own = answer.double().clamp(-1.0, 1.0)
        if processing.null_space is not None:
            own = _Projected.apply(q, own, self.scenario.model, self.scenario.task, processing.null_space)  # type: ignore[no-untyped-call]
        own = processing.action_scale * speed * own / self._limit
        return own if base is None else base + own


class PolicyUnder:
    """The policy under an agent, with its derivative by the joint coordinates.

    What it sees of the pose moves with the joint coordinates, as the arm does; its memory and what it is shown of the
    nominal trajectory do not.

    Args:
        policy: The policy.
        arm: The arm that is measured.
    """

    def __init__(self, policy: SolverPolicy, arm: Arm) -> None:
        self._policy, self._arm = policy, arm

    def __call__(
        self, q: Tensor, qdot: Tensor, nominal: FloatArray, remaining: FloatArray, memory: Memory, *, slopes: bool
    ) -> tuple[Tensor, Memory]:
        """Actions of the policy, and its memory after them.

        Args:
            q: Shape (N, n).
            qdot: Shape (N, n).
            nominal: As the policy is shown it. Shape (N, p, m).
            remaining: Shape (N, 1).
            memory: What the last call gave, or its `memory` at the start of episodes.
            slopes: Whether gradients are wanted.
        """
        here = q.detach().numpy()
        rows, n = here.shape
        copies = n + 1 if slopes else 1
        moved = np.repeat(here[None], copies, 0)
        for j in range(copies - 1):
            moved[j + 1, :, j] += STEP
        moved = moved.reshape(-1, n)
        pose = np.empty((len(moved), nominal.shape[2]))
        pose_rows(self._arm.chain, self._policy.problem.task.kind, moved, pose)
        seen = {"q": moved, "pose": pose}
        for name, array in {"qdot": qdot.detach().numpy(), "nominal": nominal, "remaining": remaining}.items():
            seen[name] = np.concatenate([array] * copies) if slopes else array
        kept = tuple(np.concatenate([array] * copies) for array in memory) if slopes else memory
        nothing = np.zeros(len(moved), dtype=np.int64)
        action, state = self._policy.predict(seen, (nothing, nothing, *kept))
        after = tuple(array[:rows] for array in self._policy.memory_of(state))
        if not slopes:
            return torch.from_numpy(action.astype(np.float64)), after
        actions = action.astype(np.float64).reshape(copies, rows, n)
        by_q = torch.from_numpy((actions[1:] - actions[0]) / STEP)  # (n of q, N, n of the action)
        result: Tensor = _Linear.apply(q, torch.from_numpy(actions[0].copy()), by_q)  # type: ignore[no-untyped-call]
        return result, after


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


class _Linear(torch.autograd.Function):
    """A function of q that is known by its value and its slopes (n, N, n)."""

    @staticmethod
    def forward(ctx: Any, q: Tensor, value: Tensor, slopes: Tensor) -> Tensor:
        ctx.save_for_backward(slopes)
        return value

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        (slopes,) = ctx.saved_tensors
        return torch.einsum("jra,ra->rj", slopes, gradient), None, None


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


def _compressed(x: Tensor) -> Tensor:
    return x.asinh().clamp(-LARGEST, LARGEST)


def _powers(x: Tensor, inside: float, outside: float) -> Tensor:
    """Σ |x|^p, row by row, with the exponents inside and outside of 1."""
    size = x.abs()
    if inside == outside:
        return size.pow(inside).sum(1)
    # Each branch sees only what it is meant for: the slope of the other would be infinite times 0.
    return torch.where(size > 1.0, size.clamp(min=1.0).pow(outside), size.clamp(max=1.0).pow(inside)).sum(1)


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
        task_kernels.error_jacobian(kind, error[row], task_jacobian, jacobian[row])
