"""A policy on a real arm, without an environment: what was measured goes in, joint velocities come out."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from baselines.policy import Memory, Report, SolverPolicy
from ikgym.arms.limits import limit_rows
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.limits import applied
from ikgym.scenarios.preview import furthest
from ikgym.validation import FloatArray, float_array, whole_number

#: Task coordinates, or rotation and position.
Pose = npt.ArrayLike | tuple[npt.ArrayLike, npt.ArrayLike]

#: Steps left where nobody says when the episode ends.
ENDLESS = 1_000_000


class Controller:
    """Calls a policy once in each control period, and keeps what it wants to remember.

    Where the model of the arm has limits, what the policy asks for is kept within them, as the environment does: first
    the velocity, then the change from the velocity before, then the stops. The policy sees what was applied.

    >>> controller = Controller(policy)
    >>> while running:
    ...     qdot = controller.step(q, pose, reference)

    Args:
        policy: The policy, made for a scenario with the arm's model, the task, Δt and the velocity limit.
        steps: Control periods until the end of the task, for policies that look at it; no end in sight if left out.

    Raises:
        InvalidInputError: The policy is none, or has privileged information on an episode that is not said to end.
    """

    def __init__(self, policy: SolverPolicy, steps: int | None = None) -> None:
        if not isinstance(policy, SolverPolicy):
            raise InvalidInputError(f"policy: expected a SolverPolicy, got {policy!r}.")
        if policy.reference and steps is None:
            raise InvalidInputError(f"{policy.name} has privileged information on one episode: give its steps.")
        self.policy = policy
        self._steps = None if steps is None else whole_number("steps", steps, at_least=1)
        problem = policy.problem
        self._limits = limit_rows(problem.model, problem.largest_qdot, problem.dt)
        self.reset()

    def reset(self) -> None:
        """Begins anew: the memory is cleared, the arm stands."""
        self._state: Memory | None = None
        self._qdot = np.zeros(self.policy.problem.model.joints)
        self._made = 0

    def step(
        self,
        q: npt.ArrayLike,
        pose: Pose | None,
        reference: Pose,
        *,
        qdot: npt.ArrayLike | None = None,
    ) -> FloatArray:
        """The joint velocities for the next control period.

        Args:
            q: Measured joint coordinates in [rad] or [m]. Shape (n,).
            pose: Measured pose of the tool: task coordinates of shape (m,), or rotation (3, 3) and position (3,) in
                [m]. None where it is not measured: then it is the model's at q.
            reference: The pose wanted at the end of this period, and then as many as the policy looks ahead, see
                :attr:`ahead`: task coordinates (p, m), or rotations (p, 3, 3) and positions (p, 3) in [m].
            qdot: Measured joint velocities in [rad/s] or [m/s]; what was returned last if left out. Shape (n,).

        Returns:
            Joint velocities in [rad/s] or [m/s], within the limits of the model and no faster than actions allow.
            Shape (n,).

        Raises:
            InvalidInputError: Something has a wrong shape, is not finite, or is too short.
        """
        problem = self.policy.problem
        n, m = problem.model.joints, problem.task.size
        measured = float_array("q", q, (n,))
        last = self._qdot if qdot is None else float_array("qdot", qdot, (n,))
        left = ENDLESS if self._steps is None else max(self._steps - self._made, 0)
        observation = {
            "q": measured,
            "qdot": last,
            "pose": self._coordinates("pose", problem.model.forward(measured) if pose is None else pose, (m,)),
            "nominal": self._coordinates("reference", reference, (None, m)),
            "remaining": np.array([float(left)]),
        }
        action, self._state = self.policy.predict(observation, self._state)
        self._made += 1
        self._qdot = self._applied(measured, np.asarray(action, dtype=np.float64) * problem.velocity_limit, last)
        return self._qdot.copy()

    @property
    def ahead(self) -> int:
        """Number of reference poses that the policy looks ahead."""
        return furthest(self.policy.preview)

    @property
    def report(self) -> Report:
        """Status and iterations of the last step.

        Raises:
            InvalidInputError: There was no step yet.
        """
        if self._state is None:
            raise InvalidInputError("report: expected a step to be made first.")
        return self.policy.report(self._state)

    def _applied(self, q: FloatArray, command: FloatArray, last: FloatArray) -> FloatArray:
        """A command within the limits of the model. Shapes (n,)."""
        if not len(self._limits):
            return command
        out = np.empty_like(command)
        applied(self._limits, q, command, last, self.policy.problem.dt, out)
        return out

    def _coordinates(self, name: str, pose: Any, shape: tuple[int | None, ...]) -> FloatArray:
        """Task coordinates of what is given as such, or as rotation and position."""
        if isinstance(pose, tuple) and len(pose) == 2 and np.ndim(pose[0]) == np.ndim(pose[1]) + 1:
            pose = self.policy.problem.task.coordinates(*pose)
        return float_array(name, pose, shape)
