"""What policies share that correct the model of another one: it is shown its model's poses and a shifted reference."""

from __future__ import annotations

import abc
import dataclasses
import math
from typing import Any

import numpy as np

from baselines.policy import Batch, Memory, Solution
from baselines.policy.parameters import parameter
from baselines.solvers.adaptive.deviation import SIZE, add_deviation
from baselines.solvers.adaptive.measurements import Measurement, nothing_measured, recall
from baselines.wrapper import NamedWrapper
from ikgym.kernels.jit import kernel
from ikgym.kernels.tasks import pose_rows
from ikgym.scenarios.preview import furthest
from ikgym.validation import FloatArray, number, whole_number


@dataclasses.dataclass(frozen=True, eq=False)
class Corrected(NamedWrapper, abc.ABC):
    """Base of wrappers that estimate how far the arm's pose is from that of the model, and take it from the reference.

    With R = exp(δ) R̂(q) and p = p̂(q) + d, the arm reaches the reference (R*, p*) where the model reaches
    (exp(-δ) R*, p* - d). The base policy is shown that reference, ahead as far as it looks, and as `pose` that of its
    own model at q: what it sees is as consistent as on an ideal plant, neither noisy nor late, whatever the sensors.
    Subclasses estimate the deviation from measured poses and the joint coordinates where they were measured. What an
    estimate changes by is blended in: poses that come one in many steps would make the reference jump, which policies
    that plan only some Newton steps, or drives that lag, answer with swings.

    Args:
        problem: What the policy is told of the scenario.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history: How many steps ago a pose may have been measured to be of use, counted from the newest joint
            coordinates.
        blend: Time constant in [s] by which the reference follows an estimate within an episode; 0 for at once.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; the history is below 1, or the
            time constant below 0.
    """

    policy: str = "rhc_foresight"
    history: int = parameter(64, whole_number, at_least=1)
    blend: float = parameter(0.01, number, at_least=0.0)

    @abc.abstractmethod
    def learn(self, batch: Batch, measured: Measurement, own: Any, out: FloatArray, old: FloatArray) -> Any:
        """Takes a measurement in.

        Args:
            batch: Observations.
            measured: Which rows have a new pose, and the joint coordinates where it was measured.
            own: The wrapper's own memory, a NamedTuple whose fields `before`, `age` and `rest` are left to the base;
                must not be changed in place.
            out: Receives the deviations at the present joint coordinates. Shape (B, 6).
            old: Receives what they would be without the measurement. Shape (B, 6).

        Returns:
            What is to be remembered.
        """

    def sensors(self, rows: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The fields `before`, `age` and `rest` of the memory at the start, see :func:`nothing_measured`."""
        return *nothing_measured(rows, self.history, self.problem.model.joints), np.zeros((rows, SIZE))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        own, inside = self.split(memory)
        rows, task = len(batch.q), self.problem.task
        deviation, old = np.empty((rows, SIZE)), np.empty((rows, SIZE))
        measured = recall(batch, self.problem.dt, own.before, own.age)
        rest = own.rest
        own = self.learn(batch, measured, own._replace(before=measured.before, age=measured.age), deviation, old)
        # The motion of the arm is followed at once, what a measurement has changed little by little.
        stays = math.exp(-self.problem.dt / self.blend) if self.blend > 0.0 else 0.0
        rest = np.where(measured.first[:, None], 0.0, stays * (rest + old - deviation))
        own, shown = own._replace(rest=rest), deviation + rest
        nominal = np.ascontiguousarray(batch.nominal[:, : furthest(self.inner.preview)])
        pose, shifted = np.empty((rows, task.size)), np.empty(nominal.shape)
        show_rows(self.problem.model.chain, task.kind, batch.q, shown, nominal, pose, shifted)
        step = self.ask(batch._replace(pose=pose, nominal=shifted, pose_age=batch.q_age), inside)
        return self.solution(step.action * self.problem.velocity_limit, own, step)


@kernel
def show_rows(chain, kind, q, deviation, nominal, pose, shifted):
    """What the base policy is shown, row by row.

    Args:
        chain: The model of the arm.
        kind: Of task coordinates.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        deviation: From the model's pose to the arm's. Shape (B, 6).
        nominal: Nominal task coordinates ahead. Shape (B, p, m).
        pose: Receives those of the model. Shape (B, m).
        shifted: Receives the nominal coordinates without the deviation. Shape (B, p, m).
    """
    pose_rows(chain, kind, q, pose)
    for row in range(q.shape[0]):
        add_deviation(kind, deviation[row], -1.0, nominal[row], shifted[row])
