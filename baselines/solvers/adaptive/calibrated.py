"""Any policy, whose model is calibrated on the way by an extended Kalman filter."""

from __future__ import annotations

import dataclasses
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch
from baselines.policy.parameters import parameter
from baselines.solvers.adaptive.chain_parameters import changed_chain, parameter_twists
from baselines.solvers.adaptive.corrected import Corrected, Measurement
from baselines.solvers.adaptive.deviation import deviation_between
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.kernels.kinematics import forward
from ikgym.validation import FloatArray, flag, number

#: Second derivatives of a pose by joint zeros and tilts: those of an arm of some 1 m, in [1/m] and [1/rad].
CURVATURE = 1.0
#: In squared standard deviations a measurement is expected to be e from what was expected. What it is farther than
#: TOLERATED e adds up, and beyond ALARM the arm has changed: by noise alone about once in a million measurements.
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
    are independent. What no posture tells apart stays with the prior, and does no harm: only the pose matters. The base
    policy is shown the reference without the deviation F(q, θ) − F(q, 0) at the present q, see :class:`Corrected`.

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
        keep: Whether what is known of the arm survives the start of an episode, and is cleared with the state alone.

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
        n = self.problem.model.joints
        deviations = np.repeat([self.zero, self.link, self.axis], [n, 3 * n + 3, 2 * n])
        covariance = np.repeat(np.diag(deviations**2)[None], rows, axis=0)
        parameters, quiet = np.zeros((rows, len(deviations))), np.full(rows, PAUSE)
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
        old: Receives what they would be without the measurements. Shape (B, 6).
    """
    chain, kind, variances, walk, jump = rule
    n = q.shape[1]
    offsets, axes, tool = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    rotation, position, model_rotation, model_position = np.empty((3, 3)), np.empty(3), np.empty((3, 3)), np.empty(3)
    for row in range(q.shape[0]):
        parameters, covariance = known.parameters[row], known.covariance[row]
        for i in range(n):
            covariance[i, i] += walk
        forward(chain, q[row], model_rotation, model_position)
        arm = changed_chain(chain, parameters, offsets, axes, tool)
        forward(arm, q[row] + parameters[:n], rotation, position)
        deviation_between(kind, rotation, position, model_rotation, model_position, old[row])
        deviation[row] = old[row]
        if new[row]:
            known.quiet[row] += 1
            allowed = jump if known.quiet[row] > PAUSE else 0.0
            test = variances, allowed, known.surprise[row]
            known.surprise[row], jumped = improve(arm, kind, test, then[row], pose[row], parameters, covariance)
            if jumped:
                known.quiet[row] = 0
            arm = changed_chain(chain, parameters, offsets, axes, tool)
            forward(arm, q[row] + parameters[:n], rotation, position)
            deviation_between(kind, rotation, position, model_rotation, model_position, deviation[row])


@kernel
def improve(arm, kind, rule, q, pose, parameters, covariance):
    """One step of the extended Kalman filter.

    Args:
        arm: The chain with the parameters.
        kind: Of task coordinates.
        rule: Variances of the noises, of shape (e,); what is added to the variances of the joint zeros if the arm seems
            to have changed, 0 for nothing; and what the measurements before were farther than expected.
        q: Joint coordinates in [rad] or [m]. Shape (n,).
        pose: Measured task coordinates. Shape (m,).
        parameters: Changed in place. Shape (p,).
        covariance: Changed in place. Shape (p, p).

    Returns:
        What this measurement and those before were farther than expected, and whether the arm is taken to have changed.
    """
    variances, jump, before = rule
    n, e, p = q.shape[0], variances.shape[0], parameters.shape[0]
    rotation, position, predicted = np.empty((3, 3)), np.empty(3), np.empty(pose.shape[0])
    error, twist, sensitivity = np.empty(e), np.zeros((6, p)), np.empty((e, p))
    shifted, change, after = q + parameters[:n], np.zeros(p), covariance.copy()
    forward(arm, shifted, rotation, position)
    task_kernels.coordinates(kind, rotation, position, predicted)
    task_kernels.error(kind, pose, predicted, error)
    parameter_twists(arm, shifted, position, twist)
    task_kernels.jacobian(kind, rotation, twist, sensitivity)
    surprise = max(before + absorb(sensitivity, error, variances, change, after) - TOLERATED * e, 0.0)
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


@inner
def absorb(sensitivity, error, variances, change, covariance):
    """The update by all components of an error, one after the other, since their noises are independent.

    Args:
        sensitivity: Derivatives by the parameters. Shape (e, p).
        error: Difference to the measurement. Shape (e,).
        variances: Of the noises. Shape (e,).
        change: Of the parameters, from 0. Shape (p,).
        covariance: Changed in place. Shape (p, p).

    Returns:
        The sum of squares of what was not expected, in its standard deviations: chi-square with e degrees of freedom.
    """
    p, gain, surprise = change.shape[0], np.empty(change.shape[0]), 0.0
    for k in range(error.shape[0]):
        variance = gain_of(sensitivity[k], variances[k], CURVATURE, covariance, gain)
        missing = error[k]
        for i in range(p):
            missing -= sensitivity[k, i] * change[i]
        for i in range(p):
            change[i] += gain[i] * missing
        surprise += missing * missing / variance
    return surprise


@inner
def gain_of(row, variance, curvature, covariance, gain):
    """The Kalman gain for one number, y = h · x + noise, by which the covariance shrinks.

    Args:
        row: h. Shape (p,).
        variance: Of the noise, above 0.
        curvature: By which share of its variance h · x is off where h is a derivative: the second order adds the noise
            that a second derivative of this size leaves. 0 where y is linear in x.
        covariance: Of x, changed in place. Shape (p, p).
        gain: Receives what x has to change by for each unit by which y is beyond h · x. Shape (p,).

    Returns:
        The variance of y.
    """
    p, spread = row.shape[0], 0.0
    for i in range(p):
        gain[i] = 0.0
        for j in range(p):
            gain[i] += covariance[i, j] * row[j]
        spread += row[i] * gain[i]
    total = spread + variance + (curvature * spread) ** 2
    for i in range(p):
        for j in range(p):
            covariance[i, j] -= gain[i] * gain[j] / total
    for i in range(p):
        gain[i] /= total
    return total
