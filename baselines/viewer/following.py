"""Policies that follow a dragged target, without an environment."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from baselines.controller import Controller
from baselines.episodes import Seeds
from baselines.evaluation.policies import specification
from baselines.policy import SolverPolicy
from baselines.status import Status
from baselines.viewer.approach import Approach
from baselines.viewer.replay import Stage
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.rotations import geodesic_angle
from ikgym.scenarios import Scenario
from ikgym.scenarios.preview import offsets
from ikgym.validation import FloatArray


class Follower:
    """One policy and its arm, which moves as commanded within the limits: q(k+1) = q(k) + Δt q̇(k).

    The policy keeps its own model of the arm; sensors and drives are ideal.

    Args:
        scenario: The scenario of the policy.
        policy: The policy.
        q: Joint coordinates at the start, in [rad] or [m]. Shape (n,).
    """

    def __init__(self, scenario: Scenario, policy: SolverPolicy, q: FloatArray) -> None:
        self._scenario, self._controller = scenario, Controller(policy)
        self._ahead = np.array(offsets(policy.preview))
        self.place(q)

    def place(self, q: FloatArray) -> None:
        """Puts the arm at rest at a posture of shape (n,), and clears the memory of the policy."""
        self._controller.reset()
        self.q = np.array(q, dtype=np.float64)
        self.status = Status.UNKNOWN.label

    def step(self, approach: Approach) -> None:
        """Makes one step. An arm whose policy raises an error stands still, and its status has the message."""
        task, arm = self._scenario.task, self._scenario.arm
        # Only the previewed steps, which may be few and far ahead.
        reference = task.coordinates(*approach.ahead(self._ahead))
        try:
            qdot = self._controller.step(self.q, arm.forward(self.q), reference)
        except InvalidInputError as e:
            self.status = str(e)
            return
        self.q = np.clip(self.q + self._scenario.dt * qdot, arm.lower, arm.upper)
        self.status = Status(int(self._controller.report.status[0])).label

    def errors(self, approach: Approach) -> tuple[float, float]:
        """Distance in [m] and angle in [rad] from where the reference is now; NaN where the task has no orientation."""
        (rotation, position), reference = self._scenario.arm.forward(self.q), approach.pose
        angle = geodesic_angle(reference.rotation, rotation) if self._scenario.task.has_orientation else np.nan
        return float(np.linalg.norm(reference.position - position)), float(angle)


def followers(stage: Stage, policies: Sequence[str]) -> list[Follower | None]:
    """The followers of policies; None for those with privileged information, and those that need an environment.

    Args:
        stage: The episode.
        policies: Their names.
    """
    return [_follower(stage, policy) for policy in policies]


def _follower(stage: Stage, policy: str) -> Follower | None:
    one = specification(policy)
    player = one.bind(stage.scenario, one.given(stage.scenario, Seeds(stage.seed)), None)
    if not isinstance(player, SolverPolicy) or player.reference:
        return None
    return Follower(stage.scenario, player, stage.start)
