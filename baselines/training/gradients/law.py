"""The bilinear law in PyTorch: features and segments with compiled gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from baselines.agents.bilinear.features import feature_rows, metric_rows
from baselines.agents.bilinear.kernels import LARGEST
from baselines.agents.bilinear.processing import Bilinear
from baselines.policy import Problem
from baselines.training.gradients.adjoint import Gradient, adjoint
from baselines.training.gradients.jacobian import jacobian_gradient_rows, jacobian_rows
from baselines.training.gradients.segment import Path, Rows, segment
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.threads import in_chunks
from ikgym.rl.twists import twist_size
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: Smallest number of rows of a thread.
GRAIN = 32


class Law:
    """The bilinear actor's law on the arm of a scenario, for N rows at a time, in float64.

    Args:
        scenario: The scenario.
        processing: The features and outputs of the network.

    Raises:
        InvalidInputError: The scenario's plant is not ideal, or it does not show the pose at its start.
    """

    def __init__(self, scenario: Scenario, processing: Bilinear) -> None:
        if not scenario.plant.ideal:
            raise InvalidInputError(
                f"Scenario {scenario.name!r}: expected an ideal plant with a known gradient, got {scenario.plant}."
            )
        if scenario.initial_pose is not None:
            raise InvalidInputError(f"Scenario {scenario.name!r}: its first pose is not that of the arm.")
        problem = Problem.of(scenario)
        self.inputs, self.outputs = processing.size(problem), processing.outputs(problem)
        self.task = Problem.of(scenario.replace(model=scenario.arm)).kernel_model
        self.chain, self._offsets, self._damping = (
            scenario.model.chain,
            np.array(processing.offsets),
            processing.damping,
        )

    def features(self, q: Tensor, nominal: FloatArray, remaining: FloatArray) -> tuple[Tensor, FloatArray]:
        """The features of :class:`Bilinear`.

        They are constants for the gradient, which goes through the arm and its law alone.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
            nominal: Reference task coordinates at the offsets. Shape (N, p, m).
            remaining: Steps left. Shape (N, 1).

        Returns:
            Features of shape (N, f), float64, and speeds of shape (N,).
        """
        task, joints = self.task, q.detach().numpy()
        out, speed = np.empty((len(nominal), self.inputs)), np.empty(len(nominal))

        def work(start: int, stop: int) -> None:
            some = slice(start, stop)
            arrays = joints[some], nominal[some], remaining[some], out[some], speed[some]
            feature_rows(task.kind, self.chain, task.dt, self._offsets, *arrays)

        in_chunks(work, len(out), GRAIN)
        return torch.from_numpy(out), speed

    def gains(self, q: Tensor, features: Tensor, output: Tensor) -> Tensor:
        """(G, h) from the output of the network, as :func:`baselines.agents.bilinear.kernels.held_rows` gives them.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
            features: From :meth:`features`. Shape (N, f), float64.
            output: Shape (N, outputs), float64.

        Returns:
            Shape (N, n (w + 1)), float64.
        """
        shift = np.zeros(output.shape)
        metric_rows(self.task.kind, self.chain.prismatic, len(self._offsets) - 1, features.numpy(), shift)
        n, w = q.shape[1], twist_size(self.task.kind)
        given, lambda_, metric = torch.split(output + torch.from_numpy(shift), [n * (w + 1), 1, n], dim=1)
        lambda_, metric = (self._damping * from_logarithm(lambda_))[:, :, None], from_logarithm(metric)
        matrix, null = torch.split(given.view(-1, n, w + 1), [w, 1], dim=2)
        jacobian: Tensor = _Jacobian.apply(q, self)  # type: ignore[no-untyped-call]
        jacobian = jacobian[:, :w]
        weighted = (jacobian * metric[:, None]).transpose(1, 2)
        gram = jacobian @ weighted + lambda_ * torch.eye(w, dtype=q.dtype)
        matrix = matrix + weighted @ torch.linalg.inv_ex(gram).inverse  # without an error where a number is NaN
        return torch.cat([matrix, null - matrix @ (jacobian @ null)], dim=2).flatten(1)

    def move(self, q: Tensor, qdot: Tensor, output: Tensor, rows: Rows) -> tuple[Tensor, Tensor, Tensor, FloatArray]:
        """A segment of steps, see :func:`baselines.training.gradients.segment.segment`.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
            qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n), float64.
            output: (G, h). Shape (N, n (w + 1)), float64.
            rows: The input of the segment; must not be changed before the gradient is computed.

        Returns:
            Joint coordinates and velocities after it, the costs of shape (N,), and the position errors at its end in
            [m], of shape (N,).
        """
        path = Path.empty(len(rows.steps), rows.nominal.shape[1], q.shape[1])
        ends: Any = _Segment.apply(q, qdot, output, self, rows, path)  # type: ignore[no-untyped-call]
        return *ends, path.distance


def from_logarithm(number: Tensor) -> Tensor:
    """The numbers whose logarithms are an output, which is clipped."""
    return number.clamp(-LARGEST, LARGEST).exp()


class _Jacobian(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, q: Tensor, law: Law) -> Tensor:
        out = np.empty((len(q), 6, q.shape[1]))
        jacobian_rows(law.task.kind, law.chain, q.detach().numpy(), out)
        ctx.law, ctx.jacobian = law, out
        return torch.from_numpy(out)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, gradient: Tensor) -> tuple[Tensor, None]:
        law, out = ctx.law, np.empty(ctx.jacobian.shape[::2])
        by = np.ascontiguousarray(gradient.numpy())
        jacobian_gradient_rows(law.task.kind, law.chain, ctx.jacobian, by, out)
        return torch.from_numpy(out), None


class _Segment(torch.autograd.Function):
    @staticmethod
    def forward(
        ctx: Any, q: Tensor, qdot: Tensor, output: Tensor, law: Law, rows: Rows, path: Path
    ) -> tuple[Tensor, Tensor, Tensor]:
        count, held = len(q), np.ascontiguousarray(output.detach().numpy())
        path.q[:, 0], path.qdot[:, 0] = q.detach().numpy(), qdot.detach().numpy()
        in_chunks(lambda start, stop: segment(law.task, rows, held, path, start, stop), count, GRAIN)
        ctx.law, ctx.rows, ctx.path, ctx.held = law, rows, path, held
        last = np.arange(count), rows.steps
        return torch.from_numpy(path.q[last]), torch.from_numpy(path.qdot[last]), torch.from_numpy(path.cost)

    @staticmethod
    @once_differentiable
    def backward(
        ctx: Any, by_q: Tensor, by_qdot: Tensor, by_cost: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, None, None, None]:
        gradient = Gradient(by_q.numpy().copy(), by_qdot.numpy().copy(), np.empty(ctx.held.shape))
        by_costs = np.ascontiguousarray(by_cost.numpy())
        in_chunks(
            lambda start, stop: adjoint(ctx.law.task, ctx.rows, ctx.held, ctx.path, by_costs, gradient, start, stop),
            len(by_costs),
            GRAIN,
        )
        by = [torch.from_numpy(array) for array in gradient]
        return by[0], by[1], by[2], None, None, None
