"""Policies that follow a dragged target, without an environment. Frames are rotations and positions, of shape (12,)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from baselines.controller import Controller, Drives, Guards
from baselines.episodes import Seeds
from baselines.evaluation.policies import specification
from baselines.policy import SolverPolicy
from baselines.status import Status
from baselines.viewer.replay import Stage
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.rotations import geodesic_angle
from ikgym.scenarios import Scenario
from ikgym.scenarios.preview import offsets
from ikgym.trajectories import StraightLine
from ikgym.validation import FloatArray

# A target may be dragged out of reach.
GUARDS = Guards(position_error=None, orientation_error=None)
# Share of the way for each parabolic blend of the straight line: next to none.
BLEND = 1e-9


class Approach:
    """A reference that moves from the start of an episode to a target, straight and at a constant pace.

    Position and orientation arrive together; the slower of them moves at its limit.
    """

    def __init__(self, stage: Stage) -> None:
        self._arm, self._pace = stage.scenario.arm, stage.pace
        self.place(stage.frames[0])

    @property
    def frame(self) -> FloatArray:
        """The reference now. Shape (12,)."""
        return self.ahead([0]).ravel()

    def place(self, frame: FloatArray) -> None:
        """Puts reference and target at a frame."""
        self._begin(frame, frame)

    def aim(self, target: FloatArray) -> None:
        """Sets another target."""
        self._begin(self.frame, target)

    def advance(self) -> None:
        """Makes one step."""
        self._made += 1

    def ahead(self, steps: npt.ArrayLike) -> FloatArray:
        """The reference some steps from now. Shapes (p,) and (p, 12)."""
        return self._line.frames(self._made + np.asarray(steps, dtype=np.float64), self._arm)

    def _begin(self, start: FloatArray, target: FloatArray) -> None:
        distance = float(np.linalg.norm(target[9:] - start[9:]))
        angle = geodesic_angle(start[:9].reshape(3, 3), target[:9].reshape(3, 3))
        # At least one step, also if the reference is at the target already.
        steps = max(distance / self._pace[0], angle / self._pace[1], 1.0)
        self._line, self._made = StraightLine(start, target, steps, BLEND * steps), 0


class Follower:
    """One policy and its arm, which moves as commanded within the limits: q(k+1) = q(k) + Δt q̇(k).

    The policy keeps its model of the arm; sensors and drives are ideal. It starts at q in [rad] or [m] (n,).
    """

    def __init__(self, scenario: Scenario, policy: SolverPolicy, q: FloatArray) -> None:
        self._scenario, self._controller = scenario, Controller(scenario, policy, Drives(), guards=GUARDS)
        self._ahead = np.array(offsets(policy.preview))
        self.place(q)

    def place(self, q: FloatArray) -> None:
        """Puts the arm at rest at a posture of shape (n,), and clears the memory of the policy."""
        self._controller.reset()
        self.q = np.array(q, dtype=np.float64)
        self.status = Status.UNKNOWN.label

    def step(self, approach: Approach) -> None:
        """Makes one step. An arm whose policy raises an error does not move, and its status has the message."""
        task, arm = self._scenario.task, self._scenario.arm
        # Only the previewed steps, which may be few and far ahead.
        frames = approach.ahead(self._ahead)
        reference = task.coordinates(frames[:, :9].reshape(-1, 3, 3), frames[:, 9:])
        try:
            qdot = self._controller.step(self.q, arm.forward(self.q), reference)
        except InvalidInputError as e:
            self.status = str(e)
            return
        self.q = np.clip(self.q + self._scenario.dt * qdot, arm.lower, arm.upper)
        stopped = self._controller.stopped
        self.status = Status(int(self._controller.report.status[0])).label if stopped is None else stopped.label


def follower(stage: Stage, policy: str) -> Follower | None:
    """The follower of a policy; None if it has privileged information or needs an environment."""
    player = specification(policy).bind(stage.scenario, Seeds(stage.seed))
    if not isinstance(player, SolverPolicy) or player.reference:
        return None
    return Follower(stage.scenario, player, stage.start)
