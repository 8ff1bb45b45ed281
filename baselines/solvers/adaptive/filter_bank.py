"""Any policy, whose model is calibrated on the way by a bank of Kalman filters with different noises and changes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch
from baselines.policy.parameters import parameter
from baselines.solvers.adaptive.corrected import Corrected, Measurement
from baselines.solvers.adaptive.kalman import absorb, linearise, prior_covariance, write_deviation
from ikgym.exceptions import InvalidInputError
from ikgym.kernels import tasks as task_kernels
from ikgym.kernels.jit import inner, kernel
from ikgym.validation import FloatArray, flag, float_array, number

#: Logarithm of the probability below which a filter is dropped.
LEAST = -20.0
#: Changes of joint zeros between two measurements: none, of all joints alike, of each joint by itself.
NONE, ALIKE, EACH = range(3)


class BankMemory(NamedTuple):
    """Estimates of the arm by K filters.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`. Shape (B, 1).
        rest: Part of the change of the estimate that is not blended in yet. Shape (B, 6).
        estimates: Parameters of the arm, see :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (B, K, p).
        covariances: Of their errors. Shape (B, K, p, p).
        weights: Logarithms of the filters' probabilities. Shape (B, K).
        since: Steps since the last measurement. Shape (B,).
    """

    before: FloatArray
    age: FloatArray
    rest: FloatArray
    estimates: FloatArray
    covariances: FloatArray
    weights: FloatArray
    since: npt.NDArray[np.int64]


def _noises(name: str, value: Sequence[float]) -> tuple[float, ...]:
    """One or more standard deviations above 0.

    Raises:
        InvalidInputError: There is none, or one is out of its range.
    """
    given = float_array(name, value, (None,))
    if not given.size:
        raise InvalidInputError(f"{name}: expected one or more standard deviations, got none.")
    return tuple(number(name, float(one), above=0.0) for one in given)


@dataclasses.dataclass(frozen=True, eq=False)
class FilterBank(Corrected):
    """Estimates an arm by Kalman filters, each with another noise, and mixes them by their probabilities.

    Multiple-model estimation (Magill 1965; Bar-Shalom, Li and Kirubarajan 2001, ch. 11): the filters of
    :class:`Calibrated` run side by side, and the likelihood of each pose that is measured weighs them by Bayes' rule.
    Within a filter, joint zeros may have changed since the last measurement: not at all, all alike, as by a payload,
    or each by itself. These three are weighed likewise, and merged to one mean and covariance at each measurement, as
    by an interacting multiple-model filter whose modes are drawn anew each time.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history: See :class:`Corrected`.
        blend: See :class:`Corrected`.
        zero: See :class:`Calibrated`.
        link: See :class:`Calibrated`.
        axis: See :class:`Calibrated`.
        noises: Standard deviation of each part of a measured pose, one a filter, in [m] and [rad]. Above 0.
        alike: Standard deviation of a sudden change of all joint zeros alike, in [rad] or [m].
        each: The same of a change of each by itself.
        rate: How often joint zeros change in either way, in [1/s].
        start: See :class:`Calibrated`.
        keep: See :class:`Calibrated`.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; a number is out of its range.
    """

    zero: float = parameter(5e-4, number, at_least=0.0)
    link: float = parameter(3e-4, number, at_least=0.0)
    axis: float = parameter(5e-4, number, at_least=0.0)
    noises: tuple[float, ...] = parameter((1e-5, 1e-4, 2e-4, 3e-4, 4.5e-4, 7e-4, 1e-3, 1.5e-3), _noises)
    alike: float = parameter(1e-3, number, at_least=0.0)
    each: float = parameter(1e-2, number, at_least=0.0)
    rate: float = parameter(0.2, number, at_least=0.0)
    start: float | None = parameter(None, number, above=0.0)
    keep: bool = parameter(False, flag)

    name: ClassVar[str] = "filter_bank"

    def own_memory(self, rows: int) -> BankMemory:
        """See :meth:`Wrapper.own_memory`."""
        prior = prior_covariance(self.problem.model.joints, self.zero, self.link, self.axis)
        covariances = np.tile(prior, (rows, len(self.noises), 1, 1))
        weights = np.full(covariances.shape[:2], -math.log(len(self.noises)))
        since = np.zeros(rows, np.int64)
        return BankMemory(*self.sensors(rows), np.zeros(covariances.shape[:3]), covariances, weights, since)

    def own_restarted(self, own: BankMemory, rows: npt.NDArray[np.bool_]) -> BankMemory:
        """See :meth:`Wrapper.own_restarted`; the arm is the same one as before, if it is kept."""
        fresh = BankMemory(*super().own_restarted(own, rows))
        kept = own._replace(before=fresh.before, age=fresh.age, rest=fresh.rest)
        return kept if self.keep else fresh

    def learn(
        self, batch: Batch, measured: Measurement, own: BankMemory, out: FloatArray, old: FloatArray
    ) -> BankMemory:
        """See :meth:`Corrected.learn`."""
        kept = own._replace(since=own.since + 1)
        if measured.new.any() or measured.first.any():
            kept = kept._replace(**{name: getattr(own, name).copy() for name in own._fields[3:6]})
        known, noises = (self.problem.model.chain, self.problem.task.kind), np.array(self.noises)
        if self.start is not None and measured.first.any():
            exact, first = np.full_like(noises, self.start**2), np.ascontiguousarray(batch.nominal[:, 0])
            bank_rows((*known, exact, (0.0, 0.0, 0.0)), batch.q, first, batch.q, measured.first, kept, out, old)
        changes = self.rate * self.problem.dt, self.alike**2, self.each**2
        bank_rows((*known, noises**2, changes), batch.q, batch.pose, measured.q, measured.new, kept, out, old)
        kept.since[measured.new] = 0
        return kept


@kernel
def bank_rows(rule, q, pose, then, new, known, deviation, old):
    """Takes the measurements in, and tells the deviations, row by row.

    Args:
        rule: The model of the arm, the kind of task coordinates, the variances of the noise, of shape (K,); and the
            probability of a change in a step, and the variances of a change of all joint zeros alike and of each.
        q: Present joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        then: Joint coordinates where they were measured. Shape (B, n).
        new: Whether they are new. Shape (B,).
        known: A :class:`BankMemory`, changed in place.
        deviation: Receives the deviations. Shape (B, 6).
        old: Receives the ones without the measurements. Shape (B, 6).
    """
    chain, kind, variances, (rate, alike, each) = rule
    n, p = q.shape[1], known.estimates.shape[2]
    parts = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    e = task_kernels.error_size(kind, pose.shape[1])
    error, sensitivity = np.empty(e), np.empty((e, p))
    for row in range(q.shape[0]):
        estimates, weights = known.estimates[row], known.weights[row]
        mean = mixed(weights, estimates)
        arm = write_deviation(chain, kind, mean, q[row], parts, old[row])
        deviation[row] = old[row]
        if new[row]:
            linearise(arm, kind, then[row] + mean[:n], pose[row], error, sensitivity)
            changes = min(rate * known.since[row], 0.5), alike, each
            for k in range(variances.shape[0]):
                if weights[k] > -np.inf:
                    measured = sensitivity, error, np.full(e, variances[k])
                    estimates[k] -= mean
                    weights[k] += update(measured, changes, n, estimates[k], known.covariances[row, k])
                    estimates[k] += mean
            normalise(weights)
            write_deviation(chain, kind, mixed(weights, estimates), q[row], parts, deviation[row])


@inner
def update(measured, changes, n, change, covariance):
    """One step of a filter, over the three ways in which joint zeros may have changed.

    Args:
        measured: Derivatives of the pose by the parameters, its error, and the variances of its noise.
        changes: The probability of a change, and the variances of one of all joint zeros alike and of each.
        n: Joints.
        change: Of the parameters, from where the error was linearised, changed in place. Shape (p,).
        covariance: Changed in place. Shape (p, p).

    Returns:
        The logarithm of the likelihood, but for a constant.
    """
    rate, alike, each = changes
    means, covariances = np.zeros((3, change.shape[0])), np.zeros((3, *covariance.shape))
    weights = np.full(3, -np.inf)
    for mode in range(3 if rate > 0.0 else 1):
        means[mode], covariances[mode] = change, covariance
        if mode == ALIKE:
            covariances[mode, :n, :n] += alike
        elif mode == EACH:
            for i in range(n):
                covariances[mode, i, i] += each
        surprise, size = absorb(*measured, means[mode], covariances[mode])
        weights[mode] = math.log(1.0 - rate if mode == NONE else 0.5 * rate) - 0.5 * (surprise + size)
    likelihood = normalise(weights)
    merge(weights, means, covariances, change, covariance)
    return likelihood


@inner
def merge(weights, means, covariances, mean, covariance):
    """The mean and the covariance of a mixture of normal distributions.

    Args:
        weights: Logarithms of their probabilities. Shape (K,).
        means: Shape (K, p).
        covariances: Shape (K, p, p).
        mean: Receives the mean. Shape (p,).
        covariance: Receives the covariance. Shape (p, p).
    """
    mean[:], covariance[:] = mixed(weights, means), 0.0
    for k in range(weights.shape[0]):
        share, away = math.exp(weights[k]), means[k] - mean
        if share > 0.0:
            for i in range(mean.shape[0]):
                for j in range(mean.shape[0]):
                    covariance[i, j] += share * (covariances[k, i, j] + away[i] * away[j])


@inner
def normalise(weights):
    """Makes probabilities of likelihoods, both as logarithms, in place.

    Args:
        weights: Shape (K,). Those that become too small become minus infinity.

    Returns:
        The logarithm of the sum of the likelihoods.
    """
    most = weights.max()
    total = most + math.log(np.exp(weights - most).sum())
    for k in range(weights.shape[0]):
        weights[k] = weights[k] - total if weights[k] - total > LEAST else -np.inf
    return total


@inner
def mixed(weights, values):
    """The mean of some rows, by the logarithms of their probabilities. Shapes (K,), (K, p)."""
    out = np.zeros(values.shape[1])
    for k in range(values.shape[0]):
        share = math.exp(weights[k])
        for i in range(out.shape[0]):
            out[i] += share * values[k, i]
    return out
