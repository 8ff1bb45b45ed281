"""Any policy, whose model is calibrated on the way by a bank of Kalman filters with different noises and changes."""

from __future__ import annotations

import abc
import dataclasses
import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy import Batch
from baselines.solvers.adaptive.corrected import Corrected, Measurement
from baselines.solvers.adaptive.kalman import absorb, linearise, prior_covariance, write_deviation
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.jit import inner, kernel
from ikgym.validation import Bounds, Flag, FloatArray, float_array, number

#: Logarithm of the probability below which a filter is dropped.
LEAST = -20.0
#: Changes of joint zeros between two measurements: none, of all joints alike, of each joint by itself.
NONE, ALIKE, EACH = range(3)
#: The squared innovation of a measurement, in standard deviations, has the mean e. The part above TOLERATED e adds up,
#: and beyond ALARM the arm has changed: by noise alone about once in a million measurements.
TOLERATED, ALARM = 2.0, 30.0
#: Measurements after such a change before the next one: where all are surprises, the noise is larger than stated.
PAUSE = 20


class BankMemory(NamedTuple):
    """Estimates of the arm by K filters.

    Attributes:
        before: See :class:`Measurement`. Shape (B, h, n).
        age: See :class:`Measurement`. Shape (B, 1).
        rest: Part of the change of the estimate that is not blended in yet. Shape (B, 6).
        since: Steps since the last measurement. Shape (B,).
        estimates: Parameters of the arm, see :mod:`baselines.solvers.adaptive.chain_parameters`. Shape (B, K, p).
        covariances: Of their errors. Shape (B, K, p, p).
        weights: Logarithms of the filters' probabilities. Shape (B, K).
        surprise: Sums of the excess of innovations over their expectation. Shape (B, K).
        quiet: How many measurements ago joint zeros were last taken to have changed suddenly. Shape (B,).
    """

    before: FloatArray
    age: FloatArray
    rest: FloatArray
    since: npt.NDArray[np.int64]
    estimates: FloatArray
    covariances: FloatArray
    weights: FloatArray
    surprise: FloatArray
    quiet: npt.NDArray[np.int64]


class ChangeModel(NamedTuple):
    """How joint zeros may change.

    Attributes:
        rate: The probability of a change in a step, of all alike or of each, equally likely.
        alike: Variance of a change of all joint zeros alike, in [rad²] or [m²].
        each: Likewise of a change of each alone.
        walk: Variance of the change in each step.
        jump: Variance of a change where poses are farther from what was expected than noise brings them (the cumulative
            sum of Page 1954); 0 for none.
    """

    rate: float = 0.0
    alike: float = 0.0
    each: float = 0.0
    walk: float = 0.0
    jump: float = 0.0


@dataclasses.dataclass(frozen=True, eq=False)
class ArmFilters(Corrected, abc.ABC):
    """Base of policies that estimate joint zeros, links and axes by Kalman filters, and correct a base policy.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history: See :class:`Corrected`.
        blend: See :class:`Corrected`.
        zero: Standard deviation of the joint zeros before anything is measured, in [rad] or [m]. Of at least 0.
        link: Standard deviation of each part of the offsets from joint to joint, and of the tool point, in [m].
        axis: Standard deviation of each of the two tilts of an axis, in [rad].
        start: How far from its reference the arm begins an episode, as a standard deviation in [m] and [rad]: where it
            has been jogged there, that is the best measurement of all. None where it may begin anywhere.
        keep: Whether the estimate of the arm survives the start of an episode, and is cleared with the state alone.
    """

    zero: Annotated[float, Bounds(at_least=0.0)] = 5e-4
    link: Annotated[float, Bounds(at_least=0.0)] = 3e-4
    axis: Annotated[float, Bounds(at_least=0.0)] = 5e-4
    start: Annotated[float, Bounds(above=0.0)] | None = None
    keep: Flag = False

    @abc.abstractmethod
    def variances(self) -> FloatArray:
        """Of the noise of each component of the error, filter by filter. Shape (K, e)."""

    @abc.abstractmethod
    def changes(self) -> ChangeModel:
        """How joint zeros may change."""

    def own_memory(self, rows: int) -> BankMemory:
        """See :meth:`Wrapper.own_memory`."""
        prior = prior_covariance(self.problem.model.joints, self.zero, self.link, self.axis)
        covariances = np.tile(prior, (rows, len(self.variances()), 1, 1))
        weights = np.full(covariances.shape[:2], -math.log(covariances.shape[1]))
        estimates, surprise, quiet = np.zeros(covariances.shape[:3]), np.zeros(weights.shape), np.full(rows, PAUSE)
        since = np.zeros(rows, np.int64)
        return BankMemory(*self.sensors(rows), since, estimates, covariances, weights, surprise, quiet)

    def begin_own_episodes(self, outer: BankMemory, rows: npt.NDArray[np.bool_]) -> BankMemory:
        """See :meth:`Wrapper.begin_own_episodes`; the arm is the same one as before, if it is kept."""
        fresh = BankMemory(*super().begin_own_episodes(outer, rows))
        kept = outer._replace(before=fresh.before, age=fresh.age, rest=fresh.rest)
        return kept if self.keep else fresh

    def learn(
        self, batch: Batch, measured: Measurement, outer: BankMemory, out: FloatArray, old: FloatArray
    ) -> BankMemory:
        """See :meth:`Corrected.learn`."""
        changes, kept = self.changes(), outer._replace(since=outer.since + 1)
        if measured.new.any() or measured.first.any() or changes.walk > 0.0:
            kept = kept._replace(**{name: getattr(outer, name).copy() for name in outer._fields[4:]})
        known, variances = (self.problem.model.chain, self.problem.task.kind), self.variances()
        if self.start is not None and measured.first.any():
            exact, first = np.full_like(variances, self.start**2), np.ascontiguousarray(batch.nominal[:, 0])
            bank_rows((*known, exact, ChangeModel()), batch.q, first, batch.q, measured.first, kept, out, old)
        bank_rows((*known, variances, changes), batch.q, batch.pose, measured.q, measured.new, kept, out, old)
        kept.since[measured.new] = 0
        return kept


def _noises(name: str, value: Sequence[float]) -> tuple[float, ...]:
    """One or more standard deviations above 0.

    Raises:
        InvalidInputError: There is none, or one is out of its range.
    """
    deviations = float_array(name, value, (None,))
    if not deviations.size:
        raise InvalidInputError(f"{name}: expected one or more standard deviations, got none.")
    return tuple(number(name, float(deviation), above=0.0) for deviation in deviations)


@dataclasses.dataclass(frozen=True, eq=False)
class FilterBank(ArmFilters):
    """Estimates an arm by Kalman filters, each with another noise, and mixes them by their probabilities.

    Multiple-model estimation (Magill 1965; Bar-Shalom, Li and Kirubarajan 2001, ch. 11): filters like that of
    :class:`Calibrated` run in parallel, and the likelihood of each pose that is measured weighs them by Bayes' rule.
    Within a filter, joint zeros may have changed since the last measurement: not at all, all alike, as by a payload,
    or each by itself. These three are weighed likewise, and merged to one mean and covariance at each measurement, as
    by an interacting multiple-model filter whose modes are drawn anew each time.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the base policy.
        options: Its parameters; those left out have its defaults.
        history, blend: See :class:`Corrected`.
        zero, link, axis, start, keep: See :class:`ArmFilters`.
        noises: Standard deviation of each part of a measured pose, one a filter, in [m] and [rad]. Above 0.
        alike: Standard deviation of a sudden change of all joint zeros alike, in [rad] or [m].
        each: Likewise of a change of each alone.
        rate: How often joint zeros change in either way, in [1/s].

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The base policy is a reference, or it refuses its parameters; a number is out of its range.
    """

    noises: Annotated[tuple[float, ...], _noises] = (1e-5, 1e-4, 2e-4, 3e-4, 4.5e-4, 7e-4, 1e-3, 1.5e-3)
    alike: Annotated[float, Bounds(at_least=0.0)] = 1e-3
    each: Annotated[float, Bounds(at_least=0.0)] = 1e-2
    rate: Annotated[float, Bounds(at_least=0.0)] = 0.2

    name: ClassVar[str] = "filter_bank"

    def variances(self) -> FloatArray:
        """See :meth:`ArmFilters.variances`."""
        return np.repeat(np.array(self.noises)[:, None] ** 2, self.problem.task.error_size, axis=1)

    def changes(self) -> ChangeModel:
        """See :meth:`ArmFilters.changes`."""
        return ChangeModel(self.rate * self.problem.dt, self.alike**2, self.each**2)


@kernel
def bank_rows(rule, q, pose, then, new, known, deviation, old):
    """Kalman update, row by row; writes the estimated deviations.

    Args:
        rule: The model of the arm, the kind of task coordinates, the variances of the noises, of shape (K, e), and a
            :class:`ChangeModel`.
        q: Present joint coordinates in [rad] or [m]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        then: Joint coordinates where they were measured. Shape (B, n).
        new: Whether they are new. Shape (B,).
        known: A :class:`BankMemory`, changed in place.
        deviation: Receives the deviations. Shape (B, 6).
        old: Receives the ones without the measurements. Shape (B, 6).
    """
    chain, kind, variances, changes = rule
    n, p = q.shape[1], known.estimates.shape[2]
    parts = np.empty((n, 3)), np.empty((n, 3)), np.empty(3)
    error, sensitivity = np.empty(variances.shape[1]), np.empty((variances.shape[1], p))
    for row in range(q.shape[0]):
        estimates, weights, surprise = known.estimates[row], known.weights[row], known.surprise[row]
        if changes.walk > 0.0:
            for k in range(variances.shape[0]):
                add_to_zeros(changes.walk, n, known.covariances[row, k])
        mean = mix_rows(weights, estimates)
        arm = write_deviation(chain, kind, mean, q[row], parts, old[row])
        deviation[row] = old[row]
        if new[row]:
            linearise(arm, kind, then[row] + mean[:n], pose[row], error, sensitivity)
            known.quiet[row] += 1
            rate = min(changes.rate * known.since[row], 0.5)
            jump = changes.jump if known.quiet[row] > PAUSE else 0.0
            now = ChangeModel(rate, changes.alike, changes.each, 0.0, jump)
            for k in range(variances.shape[0]):
                if weights[k] > -np.inf:
                    measured = sensitivity, error, variances[k]
                    estimates[k] -= mean
                    weights[k] += update(measured, now, n, estimates[k], known.covariances[row, k], surprise[k : k + 1])
                    estimates[k] += mean
                    if surprise[k] < 0.0:
                        known.quiet[row], surprise[k] = 0, 0.0
            normalise(weights)
            write_deviation(chain, kind, mix_rows(weights, estimates), q[row], parts, deviation[row])


@inner
def update(measured, changes, n, change, covariance, surprise):
    """One step of a filter, over the three ways in which joint zeros may have changed.

    Args:
        measured: Derivatives of the pose by the parameters, its error, and the variances of its noise.
        changes: A :class:`ChangeModel`, with the probability of a change since the last measurement.
        n: Joints.
        change: Of the parameters, from where the error was linearised, changed in place. Shape (p,).
        covariance: Changed in place. Shape (p, p).
        surprise: Excess of the innovations before, to which that of this one is added; -1 where a jump of the joint
            zeros explains it. Shape (1,).

    Returns:
        The logarithm of the likelihood without a constant term.
    """
    means, covariances = np.zeros((3, change.shape[0])), np.zeros((3, *covariance.shape))
    weights = np.full(3, -np.inf)
    for mode in range(3 if changes.rate > 0.0 else 1):
        means[mode], covariances[mode] = change, covariance
        if mode == ALIKE:
            covariances[mode, :n, :n] += changes.alike
        elif mode == EACH:
            add_to_zeros(changes.each, n, covariances[mode])
        square, size = absorb(*measured, means[mode], covariances[mode])
        if mode == NONE:
            surprise[0] = max(surprise[0] + square - TOLERATED * measured[1].shape[0], 0.0)
            if changes.jump > 0.0 and surprise[0] > ALARM:
                surprise[0], means[mode], covariances[mode] = -1.0, change, covariance
                add_to_zeros(changes.jump, n, covariances[mode])
                square, size = absorb(*measured, means[mode], covariances[mode])
        weights[mode] = math.log(1.0 - changes.rate if mode == NONE else 0.5 * changes.rate) - 0.5 * (square + size)
    likelihood = normalise(weights)
    merge(weights, means, covariances, change, covariance)
    return likelihood


@inner
def add_to_zeros(variance, n, covariance):
    """Adds a variance to that of each of n joint zeros. Shape (p, p)."""
    for i in range(n):
        covariance[i, i] += variance


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
    mean[:], covariance[:] = mix_rows(weights, means), 0.0
    for k in range(weights.shape[0]):
        share, away = math.exp(weights[k]), means[k] - mean
        if share > 0.0:
            for i in range(mean.shape[0]):
                for j in range(mean.shape[0]):
                    covariance[i, j] += share * (covariances[k, i, j] + away[i] * away[j])


@inner
def normalise(weights):
    """Normalises log-likelihoods to log-probabilities, in place.

    Args:
        weights: Shape (K,). Those below LEAST become minus infinity.

    Returns:
        The logarithm of the sum of the likelihoods.
    """
    most = weights.max()
    total = most + math.log(np.exp(weights - most).sum())
    for k in range(weights.shape[0]):
        weights[k] = weights[k] - total if weights[k] - total > LEAST else -np.inf
    return total


@inner
def mix_rows(weights, values):
    """The mean of some rows, by the logarithms of their probabilities. Shapes (K,), (K, p)."""
    out = np.zeros(values.shape[1])
    for k in range(values.shape[0]):
        share = math.exp(weights[k])
        for i in range(out.shape[0]):
            out[i] += share * values[k, i]
    return out
