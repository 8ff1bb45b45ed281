"""Policies that follow a target moved by hand, without an environment."""

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
from ikgym.preview import offsets
from ikgym.rotations import geodesic_angle
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray


class Follower:
    """One policy and its arm, which makes what the policy asks for within the limits: q(k+1) = q(k) + Δt q̇(k).

    The arm is the scenario's, the policy's model is its own; sensors measure what is, and drives do what they are told.

    Args:
        scenario: What the policy was made for.
        policy: The policy.
        q: Where the arm begins, in [rad] or [m]. Shape (n,).
    """

    def __init__(self, scenario: Scenario, policy: SolverPolicy, q: FloatArray) -> None:
        self._scenario, self._controller = scenario, Controller(policy)
        self._ahead = np.array(offsets(policy.preview))
        self.place(q)

    def place(self, q: FloatArray) -> None:
        """Puts the arm at a posture, at rest, and clears what the policy remembers. Shape (n,)."""
        self._controller.reset()
        self.q = np.array(q, dtype=np.float64)
        self.status = Status.UNKNOWN.label

    def step(self, approach: Approach) -> None:
        """Makes one step towards where the reference will be behind it.

        A policy that refuses what it is shown stands still, and its status says why.
        """
        task, arm = self._scenario.task, self._scenario.arm
        # Just the rows that the policy looks at, which may be few and far ahead.
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
    """Who follows a target that nobody knew before: None for policies with privileged information on an episode.

    Nor can those follow that are no :class:`baselines.SolverPolicy`, as they are shown an environment.

    Args:
        stage: What they are shown on.
        policies: Their names, all of which have played the episode.
    """
    return [_follower(stage, policy) for policy in policies]


def _follower(stage: Stage, policy: str) -> Follower | None:
    one = specification(policy)
    player = one.bind(stage.scenario, one.given(stage.scenario, Seeds(stage.seed)), None)
    if not isinstance(player, SolverPolicy) or player.reference:
        return None
    return Follower(stage.scenario, player, stage.start)
