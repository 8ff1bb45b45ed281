"""Base of policies that correct the model of a base policy, which sees its model's poses and a shifted reference."""

from __future__ import annotations

import abc
import dataclasses
import math
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch, Memory, Solution
from baselines.solvers.adaptive.deviation import SIZE, add_deviation
from baselines.wrapper import NamedWrapper
from ikgym.kernels.jit import kernel
from ikgym.kernels.tasks import pose_rows
from ikgym.scenarios.preview import furthest
from ikgym.validation import Bounds, FloatArray


class Measurement(NamedTuple):
    """Measurements of a step, and the memory of the sensors.

    Attributes:
        new: Whether the pose has not been seen before, and the joints are known where it was measured. Shape (B,).
        first: Whether an episode begins. Shape (B,).
        q: The joint coordinates there, in [rad] or [m]. Shape (B, n).
        before: Joint coordinates of the last h steps, the present one first. Shape (B, h, n).
        age: How old the pose is, in steps. Shape (B, 1).
    """

    new: npt.NDArray[np.bool_]
    first: npt.NDArray[np.bool_]
    q: FloatArray
    before: FloatArray
    age: FloatArray


def nothing_measured(rows: int, steps: int, joints: int) -> tuple[FloatArray, FloatArray]:
    """Joint coordinates before and the age of the pose, below 0, at the start of an episode.

    Args:
        rows: B.
        steps: h, how old a pose may be to be of use.
        joints: n.
    """
    return np.zeros((rows, steps, joints)), np.full((rows, 1), -1.0)


def recall(batch: Batch, dt: float, past: FloatArray, age: FloatArray) -> Measurement:
    """Joint coordinates where the pose was measured.

    A pose that is not new is one step older than the step before. Where observations do not say how old they are,
    they are of the present step.

    Args:
        batch: Observations.
        dt: Δt in [s].
        past: Joint coordinates before, as :func:`nothing_measured` or the last call gave them. Shape (B, h, n).
        age: The age of the pose at the step before. Shape (B, 1).
    """
    rows, n = batch.q.shape
    none = np.zeros((rows, 1))
    q_age = none if batch.q_age is None else batch.q_age
    pose_age = none if batch.pose_age is None else batch.pose_age
    out = Measurement(
        np.empty(rows, np.bool_), age[:, 0] < 0.0, np.empty((rows, n)), np.empty(past.shape), pose_age.copy()
    )
    recall_rows(batch.q, batch.qdot, dt, (q_age, pose_age), past, age, out.new, out.q, out.before)
    return out


@kernel
def recall_rows(q, qdot, dt, ages, past, age, new, then, before):
    """:func:`recall` row by row.

    Args:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        dt: Δt in [s].
        ages: How old q and the pose are, in steps. Shapes (B, 1).
        past: Joint coordinates before. Shape (B, h, n).
        age: The age of the pose at the step before; below 0 where there was none. Shape (B, 1).
        new: Receives :attr:`Measurement.new`. Shape (B,).
        then: Receives :attr:`Measurement.q`. Shape (B, n).
        before: Receives :attr:`Measurement.before`. Shape (B, h, n).
    """
    q_age, pose_age = ages
    steps = past.shape[1]
    for row in range(q.shape[0]):
        starting = age[row, 0] < 0.0
        for i in range(steps - 1, 0, -1):
            # The arm stood before the episode.
            before[row, i] = q[row] if starting else past[row, i - 1]
        before[row, 0] = q[row]
        late = int(pose_age[row, 0] - q_age[row, 0])
        new[row] = (starting or pose_age[row, 0] < age[row, 0] + 1.0) and late < steps
        then[row] = before[row, min(max(late, 0), steps - 1)]
        for j in range(q.shape[1]):
            # Joint coordinates older than the pose are taken to have gone on.
            then[row, j] += dt * max(-late, 0) * qdot[row, j]


@dataclasses.dataclass(frozen=True, eq=False)
class Corrected(NamedWrapper, abc.ABC):
    """Base of wrappers that estimate how far the arm's pose is from that of the model, and take it from the reference.

    With R = exp(δ) R̂(q) and p = p̂(q) + d, the arm reaches the reference (R*, p*) where the model reaches
    (exp(-δ) R*, p* - d). The base policy is shown that reference, ahead as far as it looks, and as `pose` that of its
    model at q: its observation is as consistent as on an ideal plant, neither noisy nor late, whatever the sensors.
    Subclasses estimate the deviation from measured poses and the joint coordinates where they were measured. A
    change of the estimate is blended in: poses that come one in many steps would make the reference jump, to which
    policies that plan only some Newton steps, or drives that lag, answer with oscillations.

    Args:
        problem: The scenario as the policy knows it.
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
    history: Annotated[int, Bounds(at_least=1)] = 64
    blend: Annotated[float, Bounds(at_least=0.0)] = 0.01

    @abc.abstractmethod
    def learn(self, batch: Batch, measured: Measurement, outer: Any, out: FloatArray, old: FloatArray) -> Any:
        """Takes a measurement in.

        Args:
            batch: Observations.
            measured: Which rows have a new pose, and the joint coordinates where it was measured.
            outer: The wrapper's memory, a NamedTuple whose fields `before`, `age` and `rest` are left to the base;
                must not be changed in place.
            out: Receives the deviations at the present joint coordinates. Shape (B, 6).
            old: Receives the ones without the measurement. Shape (B, 6).

        Returns:
            The next memory.
        """

    def sensors(self, rows: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The fields `before`, `age` and `rest` of the memory at the start, see :func:`nothing_measured`."""
        return *nothing_measured(rows, self.history, self.problem.model.joints), np.zeros((rows, SIZE))

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        outer, inside = self.split(memory)
        rows, task = len(batch.q), self.problem.task
        deviation, old = np.empty((rows, SIZE)), np.empty((rows, SIZE))
        measured = recall(batch, self.problem.dt, outer.before, outer.age)
        rest = outer.rest
        outer = self.learn(batch, measured, outer._replace(before=measured.before, age=measured.age), deviation, old)
        # The motion of the arm is followed at once, the change by a measurement little by little.
        stays = math.exp(-self.problem.dt / self.blend) if self.blend > 0.0 else 0.0
        rest = np.where(measured.first[:, None], 0.0, stays * (rest + old - deviation))
        outer, shown = outer._replace(rest=rest), deviation + rest
        nominal = np.ascontiguousarray(batch.nominal[:, : furthest(self.inner.preview)])
        pose, shifted = np.empty((rows, task.size)), np.empty(nominal.shape)
        show_rows(self.problem.model.chain, task.kind, batch.q, shown, nominal, pose, shifted)
        step = self.ask(batch._replace(pose=pose, nominal=shifted, pose_age=batch.q_age), inside)
        return self.solution(step.qdot, outer, step)


@kernel
def show_rows(chain, kind, q, deviation, nominal, pose, shifted):
    """Observations of the base policy, row by row.

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
