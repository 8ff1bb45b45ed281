"""Any policy, whose model is corrected by an offset and a Jacobian that a Kalman filter estimates."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np

from baselines.policy import Batch
from baselines.solvers.adaptive.corrected import Corrected
from baselines.solvers.adaptive.deviation import SIZE, missing_deviation
from baselines.solvers.adaptive.kalman import gain_of
from baselines.solvers.adaptive.measurements import Measurement
from ikgym import task_kernels
from ikgym.jit import kernel
from ikgym.kinematics import forward
from ikgym.validation import BoolArray, FloatArray, number


class JacobianMemory(NamedTuple):
    """What is known of the deviation around the first posture.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`. Shape (B, 1).
        rest: What is not blended in yet of how estimates have changed. Shape (B, 6).
        learnt: The deviation at the first posture, then its derivatives by the joint coordinates. Shape (B, 6, 1 + n).
        covariance: Of the errors of each of the first three rows, and of each of the last three. Shape
            (B, 2, 1 + n, 1 + n).
        first: The first posture, in [rad] or [m]. Shape (B, n).
        known: Whether there has been one. Shape (B,).
    """

    before: FloatArray
    age: FloatArray
    rest: FloatArray
    learnt: FloatArray
    covariance: FloatArray
    first: FloatArray
    known: BoolArray


@dataclasses.dataclass(frozen=True, eq=False)
class KalmanJacobian(Corrected):
    """Estimates what is missing in the model's pose and Jacobian, and takes it from the reference of a base policy.

    The deviation of the arm from the model is d + C (q - q₀), with q₀ the first posture. A Kalman filter estimates d
    and C from measured poses, row by row, with random walks for what changes from posture to posture. Kalman filters
    for the Jacobian of visual servoing (Qian and Su 2002) learn from the differences of successive measurements, as
    Broyden's formula does; at 1 kHz such differences are smaller than the noise. Here the measurements themselves are
    explained, so that motions over the whole episode count, and C is a correction of the model's Jacobian.

    Args:
        problem: What the policy is told of the scenario.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history: See :class:`Corrected`.
        blend: See :class:`Corrected`.
        offset: Standard deviation of d before anything is measured, in [m] and [rad]. Of at least 0.
        slope: The same of C, in [m] and [rad] per unit of the joint coordinate.
        offset_walk: How fast d changes: standard deviation after a second.
        slope_walk: How fast C changes.
        pose_noise: Standard deviation of each part of a measured position, in [m]. Above 0.
        pose_rotation_noise: The same of the orientation, in [rad].

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; a number is out of its range.
    """

    offset: float = 1e-3
    slope: float = 6e-4
    offset_walk: float = 0.0
    slope_walk: float = 3e-4
    pose_noise: float = 3e-4
    pose_rotation_noise: float = 5e-4

    name: ClassVar[str] = "kalman_jacobian"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("offset", "slope", "offset_walk", "slope_walk"):
            object.__setattr__(self, name, number(name, getattr(self, name), at_least=0.0))
        for name in ("pose_noise", "pose_rotation_noise"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))

    def own_memory(self, rows: int) -> JacobianMemory:
        """See :meth:`Wrapper.own_memory`."""
        n = self.problem.model.joints
        prior = np.diag(np.repeat([self.offset, self.slope], [1, n]) ** 2)
        covariance = np.broadcast_to(prior, (rows, 2, 1 + n, 1 + n)).copy()
        learnt, first = np.zeros((rows, SIZE, 1 + n)), np.zeros((rows, n))
        return JacobianMemory(*self.sensors(rows), learnt, covariance, first, np.zeros(rows, np.bool_))

    def learn(
        self, batch: Batch, measured: Measurement, own: JacobianMemory, out: FloatArray, old: FloatArray
    ) -> JacobianMemory:
        """See :meth:`Corrected.learn`."""
        kept = own._replace(**{name: getattr(own, name).copy() for name in own._fields[3:]})
        dt = self.problem.dt
        rule = (
            self.problem.model.chain,
            self.problem.task.kind,
            (self.pose_noise**2, self.pose_rotation_noise**2),
            (self.offset_walk**2 * dt, self.slope_walk**2 * dt),
        )
        learn_rows(rule, batch.q, batch.pose, measured.q, measured.new, kept, out, old)
        return kept


@kernel
def learn_rows(rule, q, pose, then, new, known, deviation, old):
    """Takes the measurements in, and tells the deviations, row by row.

    Args:
        rule: The model of the arm, the kind of task coordinates, the variances of the noises of positions and
            orientations, and those of the changes of d and C in a step.
        q: Present joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        then: Joint coordinates where they were measured. Shape (B, n).
        new: Whether they are new. Shape (B,).
        known: A :class:`JacobianMemory`, changed in place.
        deviation: Receives the deviations. Shape (B, 6).
        old: Receives what they would be without the measurements. Shape (B, 6).
    """
    chain, kind, variances, walks = rule
    n = q.shape[1]
    rotation, position, modelled = np.empty((3, 3)), np.empty(3), np.empty(pose.shape[1])
    regressor, missing, gain = np.empty(1 + n), np.empty(SIZE), np.empty(1 + n)
    for row in range(q.shape[0]):
        learnt, first = known.learnt[row], known.first[row]
        if not known.known[row]:
            first[:], known.known[row] = q[row], True
        for part in range(2):
            for i in range(1 + n):
                known.covariance[row, part, i, i] += walks[0] if i == 0 else walks[1]
        _deviation_at(learnt, q[row], first, regressor, old[row])
        if new[row]:
            _deviation_at(learnt, then[row], first, regressor, deviation[row])
            forward(chain, then[row], rotation, position)
            task_kernels.coordinates(kind, rotation, position, modelled)
            missing_deviation(kind, pose[row], modelled, deviation[row], missing)
            for part in range(2):
                gain_of(regressor, variances[part], 0.0, known.covariance[row, part], gain)
                for i in range(3 * part, 3 * part + 3):
                    for k in range(1 + n):
                        learnt[i, k] += gain[k] * missing[i]
        _deviation_at(learnt, q[row], first, regressor, deviation[row])


@kernel
def _deviation_at(learnt, q, first, regressor, out):
    """The deviation d + C (q - q₀), and the regressor (1, q - q₀)."""
    regressor[0] = 1.0
    for k in range(q.shape[0]):
        regressor[1 + k] = q[k] - first[k]
    for i in range(out.shape[0]):
        out[i] = 0.0
        for k in range(regressor.shape[0]):
            out[i] += learnt[i, k] * regressor[k]
