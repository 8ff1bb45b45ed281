"""The step of the environment and the features of an agent in PyTorch, with gradients through the arm.

All of it is float64; only the network is not.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from baselines.agents.features import LARGEST, Processing, speed_rows
from baselines.training.trainers.arm_gradients import projected, task_error
from ikgym.arms.limits import limit_rows
from ikgym.cost_kernels import P_X_INSIDE
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class DifferentiableArm:
    """The arm of a scenario, its task and its cost, for N rows at a time.

    Args:
        scenario: What is to be tracked; its joint velocities are what is asked for.

    Raises:
        InvalidInputError: The scenario's plant is not ideal, or it does not show the pose at its start.
    """

    def __init__(self, scenario: Scenario) -> None:
        if not scenario.plant.ideal:
            raise InvalidInputError(
                f"Scenario {scenario.name!r}: expected an ideal plant, whose gradient is known, got {scenario.plant}."
            )
        if scenario.initial_pose is not None:
            raise InvalidInputError(f"Scenario {scenario.name!r}: its first pose is not that of the arm.")
        self.scenario = scenario
        self._limit = torch.from_numpy(scenario.velocity_limit.copy())
        self._limits = torch.from_numpy(limit_rows(scenario.arm, scenario.largest_qdot, scenario.dt))
        self._prismatic = torch.from_numpy(np.array(scenario.model.chain.prismatic))

    def error(self, q: Tensor, nominal: FloatArray) -> Tensor:
        """The error of the arm's task coordinates from nominal ones.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n), float64.
            nominal: Task coordinates. Shape (N, m).

        Returns:
            As :meth:`ikgym.tasks.Task.error`. Shape (N, e), float64.
        """
        return task_error(q, nominal, self.scenario.arm, self.scenario.task)

    def step(self, q: Tensor, last: Tensor, action: Tensor) -> tuple[Tensor, Tensor]:
        """Where the arm is after a step (Varga 2021, eq. 5), within its limits: what they hold back has no gradient.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (N, n).
            last: Joint velocities last applied, in [rad/s] or [m/s]. Shape (N, n).
            action: As fractions of the velocity limit; clipped to the box. Shape (N, n).

        Returns:
            Joint coordinates, and joint velocities in [rad/s] or [m/s]. Shapes (N, n).
        """
        dt, qdot = self.scenario.dt, action.clamp(-1.0, 1.0) * self._limit
        if not len(self._limits):
            return q + dt * qdot, qdot
        lower, upper, fastest, change = self._limits
        qdot = torch.minimum(torch.maximum(qdot, -fastest), fastest)
        qdot = torch.minimum(torch.maximum(qdot, last - change), last + change)
        free = q + dt * qdot
        reached = torch.minimum(torch.maximum(free, lower), upper)
        return reached, torch.where(reached == free, qdot, (reached - q) / dt)

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
            base: Actions of the base policy. Shape (N, n).

        Returns:
            Features of shape (N, f), and speeds of shape (N, 1), both float64.
        """
        task, dt = self.scenario.task, self.scenario.dt
        offsets = np.array(processing.offsets)
        ahead = np.empty((*nominal.shape[:2], task.error_size))
        speed = torch.from_numpy(speed_rows(task.kind, dt, offsets, nominal, ahead))[:, None]
        velocity = torch.from_numpy(ahead[:, :-1])
        error, lead = self.error(q, nominal[:, 0]), offsets[0] * dt
        revolute = torch.stack([q.sin(), q.cos()], 2)
        prismatic = torch.stack([_compressed(q), torch.zeros_like(q)], 2)
        parts = [
            torch.where(self._prismatic[:, None], prismatic, revolute).flatten(1),
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

    def action(self, processing: Processing, q: Tensor, speed: Tensor, output: Tensor, base: Tensor | None) -> Tensor:
        """What network outputs mean, see :meth:`Processing.action`.

        Args:
            processing: What network outputs mean.
            q: Shape (N, n).
            speed: What :meth:`features` gave. Shape (N, 1).
            output: Of the network. Shape (N, n).
            base: Actions of the base policy. Shape (N, n).

        Returns:
            Fractions of the velocity limit. Shape (N, n), float64.
        """
        own = output.double().clamp(-1.0, 1.0)
        if processing.null_space is not None:
            own = projected(q, own, self.scenario.model, self.scenario.task, processing.null_space)
        own = processing.action_scale * speed * own / self._limit
        return own if base is None else base + own


def _compressed(x: Tensor) -> Tensor:
    return x.asinh().clamp(-LARGEST, LARGEST)


def _powers(x: Tensor, inside: float, outside: float) -> Tensor:
    """Σ |x|^p, row by row, with the exponents inside and outside of 1."""
    size = x.abs()
    if inside == outside:
        return size.pow(inside).sum(1)
    # Each branch sees only its own arguments: the gradient of the other would be infinite times 0.
    return torch.where(size > 1.0, size.clamp(min=1.0).pow(outside), size.clamp(max=1.0).pow(inside)).sum(1)
