"""Any policy, whose model is calibrated on the way by an extended Kalman filter."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch
from baselines.policy.parameters import parameter
from baselines.solvers.adaptive.corrected import Corrected, Measurement
from baselines.solvers.adaptive.kalman import absorb, linearise, prior_covariance, write_deviation
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import kernel
from ikgym.validation import FloatArray, flag, number

#: The squared innovation of a measurement, in standard deviations, has the mean e. The part above TOLERATED e adds up,
#: and beyond ALARM the arm has changed: by noise alone about once in a million measurements.
TOLERATED, ALARM = 2.0, 30.0
#: Measurements after a sudden change before the next one: where all are surprises, the noise is larger than said.
PAUSE = 20


class CalibrationMemory(NamedTuple):
    """Estimate of the arm.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`. Shape (B, 1).
        rest: Part of the change of the estimate that is not blended in yet. Shape (B, 6).
        parameters: See :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (B, p).
        covariance: Of their errors. Shape (B, p, p).
        quiet: How many measurements ago joint zeros were last taken to have changed suddenly. Shape (B,).
        surprise: Sum of the excess of innovations over their expectation. Shape (B,).
    """

    before: FloatArray
    age: FloatArray
    rest: FloatArray
    parameters: FloatArray
    covariance: FloatArray
    quiet: npt.NDArray[np.int64]
    surprise: FloatArray


@dataclasses.dataclass(frozen=True, eq=False)
class Calibrated(Corrected):
    """Estimates joint zeros, links and axes from pairs of joint coordinates and pose, and corrects a base policy.

    An extended Kalman filter: the parameters start at 0, with the prior's standard deviations, and a measured pose y at
    the joint coordinates q improves them, θ ← θ + K (y − F(q, θ)), one component after the other, since their noises
    are independent. Parameters that no posture tells apart stay at the prior and do no harm: only the pose matters. The
    base policy is shown the reference without the deviation F(q, θ) − F(q, 0) at the present q, see :class:`Corrected`.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history: See :class:`Corrected`.
        blend: See :class:`Corrected`.
        zero: Standard deviation of the joint zeros before anything is measured, in [rad] or [m]. Of at least 0.
        link: The same of each part of the offsets from joint to joint, and of the tool point, in [m].
        axis: The same of each of the two tilts of an axis, in [rad].
        pose_noise: Standard deviation of each part of a measured position, in [m]. Above 0.
        pose_rotation_noise: The same of the orientation, in [rad] (or as a number, for parts of a rotation matrix).
        walk: How fast joint zeros change, as a payload changes them: standard deviation after a second, in [rad/√s] or
            [m/√s].
        jump: Standard deviation of a sudden change of joint zeros, in [rad] or [m], that is reckoned with where poses
            are farther from what was expected than noise brings them (the sum of Page 1954). 0 for none.
        start: How far from its reference the arm begins an episode, as a standard deviation in [m] and [rad]: where it
            has been jogged there, that is the best measurement of all. None where it may begin anywhere.
        keep: Whether the estimate of the arm survives the start of an episode, and is cleared with the state alone.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; a number is out of its range.
    """

    zero: float = parameter(5e-4, number, at_least=0.0)
    link: float = parameter(3e-4, number, at_least=0.0)
    axis: float = parameter(5e-4, number, at_least=0.0)
    pose_noise: float = parameter(3e-4, number, above=0.0)
    pose_rotation_noise: float = parameter(5e-4, number, above=0.0)
    walk: float = parameter(0.0, number, at_least=0.0)
    jump: float = parameter(1e-3, number, at_least=0.0)
    start: float | None = parameter(None, number, above=0.0)
    keep: bool = parameter(False, flag)

    name: ClassVar[str] = "calibrated"

    def own_memory(self, rows: int) -> CalibrationMemory:
        """See :meth:`Wrapper.own_memory`."""
        prior = prior_covariance(self.problem.model.joints, self.zero, self.link, self.axis)
        covariance = np.repeat(prior[None], rows, axis=0)
        parameters, quiet = np.zeros((rows, len(prior))), np.full(rows, PAUSE)
        return CalibrationMemory(*self.sensors(rows), parameters, covariance, quiet, np.zeros(rows))

    def own_restarted(self, own: CalibrationMemory, rows: npt.NDArray[np.bool_]) -> CalibrationMemory:
        """See :meth:`Wrapper.own_restarted`; the arm is the same one as before, if it is kept."""
        fresh = CalibrationMemory(*super().own_restarted(own, rows))
        kept = own._replace(before=fresh.before, age=fresh.age, rest=fresh.rest)
        return kept if self.keep else fresh

    def learn(
        self, batch: Batch, measured: Measurement, own: CalibrationMemory, out: FloatArray, old: FloatArray
    ) -> CalibrationMemory:
        """See :meth:`Corrected.learn`."""
        kept = own._replace(**{name: getattr(own, name).copy() for name in own._fields[3:]})
        known, variances = (self.problem.model.chain, self.problem.task.kind), self._variances()
        changes = self.walk**2 * self.problem.dt, self.jump**2
        if self.start is not None and measured.first.any():
            exact, none = np.full_like(variances, self.start**2), (0.0, 0.0)
            first = np.ascontiguousarray(batch.nominal[:, 0])
            calibrate_rows((*known, exact, *none), batch.q, first, batch.q, measured.first, kept, out, old)
        calibrate_rows((*known, variances, *changes), batch.q, batch.pose, measured.q, measured.new, kept, out, old)
        return kept

    def _variances(self) -> FloatArray:
        """Of the noise of each component of the error. Shape (e,)."""
        task = self.problem.task
        out = np.full(task.error_size, self.pose_rotation_noise**2)
        first = task.kind in (task_kernels.POSITION, task_kernels.POSE, task_kernels.AXIS)
        out[slice(0, 3) if first else slice(-3, None)] = self.pose_noise**2
        return out


@kernel
def calibrate_rows(rule, q, pose, then, new, known, deviation, old):
    """Takes the measurements in, and tells the deviations, row by row.

    Args:
        rule: The model of the arm, the kind of task coordinates, the variances of the noises, of shape (e,), and those
            of the joint zeros' change in a step and of that at a surprise.
        q: Present joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        then: Joint coordinates where they were measured. Shape (B, n).
        new: Whether they are new. Shape (B,).
        known: A :class:`CalibrationMemory`, changed in place.
        deviation: Receives the deviations. Shape (B, 6).
        old: Receives the ones without the measurements. Shape (B, 6).
    """
    chain, kind, variances, walk, jump = rule
    n = q.shape[1]
    parts = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    for row in range(q.shape[0]):
        parameters, covariance = known.parameters[row], known.covariance[row]
        for i in range(n):
            covariance[i, i] += walk
        arm = write_deviation(chain, kind, parameters, q[row], parts, old[row])
        deviation[row] = old[row]
        if new[row]:
            known.quiet[row] += 1
            allowed = jump if known.quiet[row] > PAUSE else 0.0
            test = variances, allowed, known.surprise[row]
            known.surprise[row], jumped = improve(arm, kind, test, then[row], pose[row], parameters, covariance)
            if jumped:
                known.quiet[row] = 0
            write_deviation(chain, kind, parameters, q[row], parts, deviation[row])


@kernel
def improve(arm, kind, rule, q, pose, parameters, covariance):
    """One step of the extended Kalman filter.

    Args:
        arm: The chain with the parameters.
        kind: Of task coordinates.
        rule: Variances of the noises, of shape (e,); the increase of the variances of the joint zeros if the arm seems
            to have changed, 0 for none; and the excess of the innovations before.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        pose: Measured task coordinates. Shape (m,).
        parameters: Changed in place. Shape (p,).
        covariance: Changed in place. Shape (p, p).

    Returns:
        The excess of this innovation and those before, and whether the arm is taken to have changed.
    """
    variances, jump, before = rule
    n, e, p = q.shape[0], variances.shape[0], parameters.shape[0]
    error, sensitivity = np.empty(e), np.empty((e, p))
    change, after = np.zeros(p), covariance.copy()
    linearise(arm, kind, q + parameters[:n], pose, error, sensitivity)
    surprise = max(before + absorb(sensitivity, error, variances, change, after)[0] - TOLERATED * e, 0.0)
    jumped = jump > 0.0 and surprise > ALARM
    if jumped:
        surprise = 0.0
        after[:], change[:] = covariance, 0.0
        for i in range(n):
            after[i, i] += jump
        absorb(sensitivity, error, variances, change, after)
    covariance[:] = after
    for i in range(p):
        parameters[i] += change[i]
    return surprise, jumped
