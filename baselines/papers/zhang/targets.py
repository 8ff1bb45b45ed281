"""Zhang 2020: sets of poses whose inverse kinematics is sought, at random and at singular points."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from baselines.papers.runs import Runs
from baselines.papers.zhang.episodes import HELIX, LINE
from baselines.policy import Batch, SolverPolicy
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

#: The scenario whose arm it is, how far off a target is in [rad], and the joint that is straight there.
TARGETS: dict[str, tuple[str, float, int | None]] = {
    "3 joints": (HELIX, np.pi, None),
    "6 joints": (LINE, np.pi, None),
    "3 joints, stretched": (HELIX, 0.5, 2),
    "6 joints, wrist straight": (LINE, 0.5, 4),
}


@dataclasses.dataclass(frozen=True, eq=False)
class Targets:
    """Starts and the task coordinates sought from there.

    Args:
        scenario: Whose arm and task they are of.
        q: Joint coordinates at the start in [rad]. Shape (rows, n).
        coordinates: Those sought. Shape (rows, m).
    """

    scenario: Scenario
    q: FloatArray
    coordinates: FloatArray

    def error(self, q: FloatArray) -> FloatArray:
        """What is left to the targets, in the units of the task. Shape (rows, e) for q of shape (rows, n)."""
        return np.asarray(self.scenario.task.error(self.coordinates, self._reached(q)))

    def solved(self, policy: SolverPolicy) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """Where a policy goes in one period, in [rad], and its statuses. Shapes (rows, n) and (rows,)."""
        rows = len(self.q)
        nominal = self.coordinates[:, None]
        batch = Batch(self.q, np.zeros_like(self.q), self._reached(self.q), nominal, np.ones((rows, 1)))
        solution = policy.solve(batch, policy.memory(rows))
        return self.q + solution.qdot * self.scenario.dt, solution.status

    def _reached(self, q: FloatArray) -> FloatArray:
        return np.asarray(self.scenario.task.coordinates(*self.scenario.model.forward(q)))


def drawn(runs: Runs, name: str) -> Targets:
    """1000 targets of a set of :data:`TARGETS`; fewer in a trial."""
    of, far, straight = TARGETS[name]
    scenario, rng = runs.scenario(of), np.random.default_rng(0)
    shape = min(1000, runs.steps or 1000), scenario.joints
    q = rng.uniform(-np.pi, np.pi, shape)
    goal = rng.uniform(-np.pi, np.pi, shape) if straight is None else q + rng.uniform(-far, far, shape)
    if straight is not None:
        goal[:, straight] = 0.0
    return Targets(scenario, q, np.asarray(scenario.task.coordinates(*scenario.model.forward(goal))))
