"""Kernels: which delay and lag the drive of each joint has, from measured joint coordinates and past commands.

A drive applies a command d steps late, and its velocity follows that as v(k) = v(k-1) + (u(k) - v(k-1)) / T, where
T = 1 / (1 - exp(-2π f Δt)) steps belong to a bandwidth of f. Both are linear and do not change, so that their order
does not matter: a drive with delay is where one without has been d steps ago. So a simulated drive for each of a few
lags serves all delays. Lags between two of them, and delays between two steps, are mixtures of their motions.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ikgym.kernels.jit import inlined, kernel
from ikgym.kernels.tasks import pose_rows
from ikgym.validation import BoolArray, FloatArray, IntArray

#: How much of a residual stays from step to step: a drift, such as that of a bias, is no sign of a delay.
HIGH_PASS = 0.98
#: Standard deviations of the guess, in steps of delay and in steps of lag, in units of the noise of one measurement.
DELAY_SPREAD, LAG_SPREAD = 4.0, 5.0
#: By how much the logarithm of the likelihood has to be better before another delay is taken to be right.
EVIDENCE = 7.0
#: Variance in [rad²] or [m²] that is taken for the noise of q at least.
LEAST_VARIANCE = 1e-18
#: By how many steps a delay is changed at a time.
STRIDES = (4.0, 2.0, 1.0, 0.5, 0.25, 0.0625, 0.015625)
#: Doubt of a delay, in steps, up to which it is known.
KNOWN = 1.0
#: Steps over which white noise of q is distinguished from errors of the drives, and samples of the running variances.
SPAN, SAMPLES = 32, 500.0
#: By how many steps the slowest joint may be later than the model is ahead, and earlier; together above 1.
LATER, EARLIER = 0.25, 0.98
# Sums over time: of squares, and of products with the residual of the next lag, of the next delay, and of both, which
# has two.
ALONE, NEXT_LAG, NEXT_DELAY, CROSSED = range(4)
# Doubts: of the delay and the lag together, and of the delay alone.
TOTAL, DELAY = range(2)


class Hypotheses(NamedTuple):
    """Hypotheses about drives.

    Attributes:
        identify: Whether others than the first ones are taken.
        longest: The longest delay that is taken, in steps.
        lags: T in steps, rising. Shape (n, L).
        delay: The delays that are assumed at first, in steps. Shape (n,).
        lag: The T that are assumed at first, in steps. Shape (n,).
    """

    identify: bool
    longest: int
    lags: FloatArray
    delay: FloatArray
    lag: FloatArray


class PredictedMemory(NamedTuple):
    """Estimates of the drives of B arms, and the arms without delay and lag that they follow.

    Attributes:
        begun: Whether there was a step before. Shape (B,).
        measured: Joint coordinates of the step before, in [rad] or [m]. Shape (B, n).
        velocity: Of the simulated drives, in [rad/s] or [m/s]. Shape (B, n, L).
        path: Where they are now, and where they were 1, 2, … steps ago, in [rad] or [m]. Shape (B, n, H, L).
        residual: Difference between the measured joint coordinates and those that a delay of 0, 1, … steps and a lag
            would have led to, without the constant part, in [rad] or [m]. Shape (B, n, D, L).
        sums: Sums over time of its squares and products. Shape (B, n, 4, D, L).
        samples: How many measurements are in a sum. Shape (B,).
        delay: The delay that is taken to be right, in steps. Shape (B, n).
        lag: T that is taken to be right. Shape (B, n).
        doubt: By how many steps a hypothesis that is not refuted differs from those two at most: in their sum, and in
            the delay alone. Shape (B, n, 2).
        sent: The last command in [rad/s] or [m/s]. Shape (B, n).
        lead: How many steps the arm without delay and lag is ahead of the real one. Shape (B,).
        arm_q: Joint coordinates of that arm, now and 1, 2, … steps ago, in [rad] or [m]. Shape (B, A, n).
        arm_qdot: Its joint velocities in [rad/s] or [m/s]. Shape (B, A, n).
        offset: Measured task coordinates minus those that the model has at the same time, filtered. Shape (B, m).
        fastest: The largest velocity of that arm in the last second or so, in [rad/s] or [m/s]. Shape (B, n).
        off: How far the arm was from where the simulated drives should have brought it in the last steps, in [rad] or
            [m]. Shape (B, n, SPAN).
        spread: Running sums of the squared changes of that over one step and over SPAN steps. Shape (B, n, 2).
        moved: By how much the last command differed from the one before, in [rad/s] or [m/s]. Shape (B, n).
        aimed: The velocity that the last command should have led to, where jerk is limited, likewise. Shape (B, n).
    """

    begun: BoolArray
    measured: FloatArray
    velocity: FloatArray
    path: FloatArray
    residual: FloatArray
    sums: FloatArray
    samples: IntArray
    delay: FloatArray
    lag: FloatArray
    doubt: FloatArray
    sent: FloatArray
    lead: IntArray
    arm_q: FloatArray
    arm_qdot: FloatArray
    offset: FloatArray
    fastest: FloatArray
    off: FloatArray
    spread: FloatArray
    moved: FloatArray
    aimed: FloatArray


def longest_lead(delay: FloatArray) -> int:
    """How many steps an arm without delay is ahead of one whose joints have such delays, in steps. Shape (n,)."""
    return max(math.ceil(float(delay.max()) - LATER), 0)


def start_memory(rows: int, coordinates: int, hypotheses: Hypotheses, oldest: int) -> PredictedMemory:
    """The memory at the start of an episode.

    Args:
        rows: B.
        coordinates: m, of the task.
        hypotheses: Candidates for delay and lag.
        oldest: The oldest measurements that there may be, in steps.
    """
    (n, lags), delays = hypotheses.lags.shape, hypotheses.longest + 2
    return PredictedMemory(
        np.zeros(rows, dtype=np.bool_),
        np.zeros((rows, n)),
        np.zeros((rows, n, lags)),
        np.zeros((rows, n, delays + oldest + 1, lags)),
        np.zeros((rows, n, delays, lags)),
        np.zeros((rows, n, 4, delays, lags)),
        np.zeros(rows, dtype=np.int64),
        np.tile(hypotheses.delay, (rows, 1)),
        np.tile(hypotheses.lag, (rows, 1)),
        np.full((rows, n, 2), np.inf),
        np.zeros((rows, n)),
        np.full(rows, longest_lead(hypotheses.delay)),
        np.zeros((rows, delays + 1, n)),
        np.zeros((rows, delays + 1, n)),
        np.zeros((rows, coordinates)),
        np.zeros((rows, n)),
        np.zeros((rows, n, SPAN)),
        np.zeros((rows, n, 2)),
        np.zeros((rows, n)),
        np.zeros((rows, n)),
    )


@kernel
def identify_rows(q, age, hypotheses, memory):
    """Takes in a measurement, and finds delay and lag: of joints in doubt that move, and of the others in turn.

    The sum of the squared residuals of a mixture of two lags and two delays is a parabola in the share of a lag, whose
    coefficients are known: the best lag of each delay is worked out, not searched. While little is known the guess
    counts as one measurement: the mean of the joints whose drives are known, if there are any. Delays differ by more
    than their neighbours' lags can make up for, and the one in use changes where the likelihood ratio says so.

    Args:
        q: Measured joint coordinates in [rad] or [m]. Shape (B, n).
        age: How many steps ago that was. Shape (B,).
        hypotheses: A plain :class:`Hypotheses`.
        memory: A plain :class:`PredictedMemory`, changed in place.
    """
    begun, measured, _, path, residual, sums, samples, _, _, doubt = memory[:10]
    for row in range(q.shape[0]):
        if not begun[row]:
            begun[row] = True
            for j in range(q.shape[1]):
                path[row, j] = q[row, j]
        else:
            for j in range(q.shape[1]):
                _compare(q[row, j] - measured[row, j], age[row], path[row, j], residual[row, j], sums[row, j])
            samples[row] += 1
            for j in range(q.shape[1]):
                moves = path[row, j, 0, 0] != path[row, j, 1, 0]
                if samples[row] % q.shape[1] == j or (moves and doubt[row, j, DELAY] > KNOWN):
                    _weigh(row, j, hypotheses, memory)
        measured[row] = q[row]


@inlined
def _compare(moved, age, path, residual, sums):
    """Brings the residuals of a joint up to date: shapes (H, L), (D, L) and (4, D, L)."""
    delays, lags = residual.shape
    for i in range(delays):
        late = min(i + age, path.shape[0] - 2)
        for f in range(lags):
            residual[i, f] = HIGH_PASS * residual[i, f] + moved - (path[late, f] - path[late + 1, f])
    for i in range(delays):
        for f in range(lags):
            sums[ALONE, i, f] += residual[i, f] ** 2
        for f in range(lags - 1):
            sums[NEXT_LAG, i, f] += residual[i, f] * residual[i, f + 1]
    for i in range(delays - 1):
        for f in range(lags):
            sums[NEXT_DELAY, i, f] += residual[i, f] * residual[i + 1, f]
        for f in range(lags - 1):
            sums[CROSSED, i, f] += residual[i, f] * residual[i + 1, f + 1] + residual[i, f + 1] * residual[i + 1, f]


@inlined
def _weigh(row, j, hypotheses, memory):
    """Takes another delay and lag of a joint where they are better, and says which are not refuted."""
    identify, longest, lags, _, _ = hypotheses
    sums, samples, delay, lag, doubt = memory[5][row, j], memory[6][row], memory[7], memory[8], memory[9]
    factor = math.exp(2.0 * EVIDENCE / samples)
    _, least = _best_lag(sums, delay[row, j], lags[j], 0.0, 0.0)
    if identify:
        guess, guessed_lag = _guess(row, j, hypotheses, memory)
        variance = max(LEAST_VARIANCE, least / samples)
        found, price = _price(sums, delay[row, j], lags[j], guess, guessed_lag, variance)
        other, cheaper = _price(sums, guess, lags[j], guess, guessed_lag, variance)
        if cheaper < price:
            delay[row, j], found, price = guess, other, cheaper
        for stride in STRIDES:
            for sign in (-1.0, 1.0):
                tried = min(max(delay[row, j] + sign * stride, 0.0), longest)
                other, cheaper = _price(sums, tried, lags[j], guess, guessed_lag, variance)
                if factor * cheaper < price:
                    delay[row, j], found, price = tried, other, cheaper
        lag[row, j] = found
    for i in range(sums.shape[1]):
        for f in range(sums.shape[2]):
            least = min(least, sums[ALONE, i, f])
    least = factor * (least + LEAST_VARIANCE * samples) - LEAST_VARIANCE * samples
    total, alone = 0.0, 0.0
    for i in range(sums.shape[1]):
        for f in range(sums.shape[2]):
            if sums[ALONE, i, f] <= least:
                total = max(total, abs(i + lags[j, f] - delay[row, j] - lag[row, j]))
                alone = max(alone, abs(i - delay[row, j]))
    doubt[row, j, TOTAL], doubt[row, j, DELAY] = total, alone


@inlined
def _guess(row, j, hypotheses, memory):
    """Delay and lag that a joint probably has: the means of those that are known, or the first guess."""
    delay, lag, doubt = memory[7], memory[8], memory[9]
    known, delays, lags = 0, 0.0, 0.0
    for i in range(delay.shape[1]):
        if i != j and doubt[row, i, DELAY] <= KNOWN:
            known, delays, lags = known + 1, delays + delay[row, i], lags + lag[row, i]
    if known == 0:
        return hypotheses[3][j], hypotheses[4][j]
    return delays / known, lags / known


@inlined
def _price(sums, delay, lags, guess, guessed_lag, variance):
    """The lag that suits a delay best, and its sum of squares; with a weight on the distance from a guess."""
    lag, price = _best_lag(sums, delay, lags, guessed_lag, variance / LAG_SPREAD**2)
    return lag, price + variance * (1.0 + ((delay - guess) / DELAY_SPREAD) ** 2)


@inlined
def _best_lag(sums, delay, lags, guess, weight):
    """The lag whose mixture has the least sum of squares, and that sum; with a weight on the distance from a guess."""
    i = min(int(delay), sums.shape[1] - 2)
    late = delay - i
    early, crossed = 1.0 - late, late * (1.0 - late)
    a = lags[0] - guess
    here = _of_delays(sums, i, 0, early, late) + weight * a * a
    lag, least = lags[0], here
    for f in range(lags.shape[0] - 1):
        b = lags[f + 1] - guess
        there = _of_delays(sums, i, f + 1, early, late) + weight * b * b
        both = early * early * sums[NEXT_LAG, i, f] + late * late * sums[NEXT_LAG, i + 1, f]
        both += crossed * sums[CROSSED, i, f] + weight * a * b
        bend = here - 2.0 * both + there
        share = min(max((here - both) / bend, 0.0), 1.0) if bend > 0.0 else 0.0
        value = here - 2.0 * share * (here - both) + share * share * bend
        if value < least:
            lag, least = lags[f] + share * (lags[f + 1] - lags[f]), value
        a, here = b, there
    return lag, max(least, 0.0)


@inlined
def _of_delays(sums, i, f, early, late):
    """The sum of squares of a mixture of two delays."""
    both = 2.0 * early * late * sums[NEXT_DELAY, i, f]
    return early * early * sums[ALONE, i, f] + both + late * late * sums[ALONE, i + 1, f]


@inlined
def mixture(lag, lags):
    """Between which of the simulated drives a lag lies: two indices, and the share of the second."""
    last = lags.shape[0] - 1
    if last == 0:
        return 0, 0, 0.0
    i = 0
    while i < last - 1 and lags[i + 1] < lag:
        i += 1
    return i, i + 1, min(max((lag - lags[i]) / (lags[i + 1] - lags[i]), 0.0), 1.0)


@inlined
def past(path, lag, lags, steps):
    """Where a joint was a number of steps ago, by a lag; steps may have fractions. Shapes (H, L) and (L,)."""
    low, high, share = mixture(lag, lags)
    i = min(int(steps), path.shape[0] - 2)
    late = min(steps - i, 1.0)
    now = (1.0 - share) * path[i, low] + share * path[i, high]
    before = (1.0 - share) * path[i + 1, low] + share * path[i + 1, high]
    return (1.0 - late) * now + late * before


@kernel
def lead_rows(dt, memory):
    """Keeps the arm without delay and lag as far ahead of the real one as its slowest joint is late.

    One step at a time, by how it moves and moved, not with a jump: so each joint is shown the same as before.

    Args:
        dt: Δt in [s].
        memory: A plain :class:`PredictedMemory`, changed in place.
    """
    delay, lead, arm_q, arm_qdot = memory[7], memory[11], memory[12], memory[13]
    last = arm_q.shape[1] - 1
    for row in range(delay.shape[0]):
        slowest = np.max(delay[row])
        if slowest > lead[row] + LATER:
            lead[row] += 1
            for i in range(last, 0, -1):
                arm_q[row, i], arm_qdot[row, i] = arm_q[row, i - 1], arm_qdot[row, i - 1]
            arm_q[row, 0] += dt * arm_qdot[row, 0]
        elif slowest < lead[row] - EARLIER:
            lead[row] -= 1
            for i in range(last):
                arm_q[row, i], arm_qdot[row, i] = arm_q[row, i + 1], arm_qdot[row, i + 1]


@kernel
def offset_rows(chain, kind, share, batch, lags, memory, off):
    """How far arms are from where the drives should have brought them, and measured poses from those of the model.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        share: Share of a new offset of the pose. Shape (B,).
        batch: Measured joint coordinates (B, n) and poses (B, m), and how many steps ago that was. Shapes (B,).
        lags: Shape (n, L).
        memory: A plain :class:`PredictedMemory`, changed in place.
        off: Receives the difference of the joint coordinates, in [rad] or [m]. Shape (B, n).
    """
    q, pose, q_age, pose_age = batch
    path, delay, lag, offset = memory[3], memory[7], memory[8], memory[14]
    seen, modelled = np.empty_like(q), np.empty_like(pose)
    for row in range(q.shape[0]):
        for j in range(q.shape[1]):
            off[row, j] = q[row, j] - past(path[row, j], lag[row, j], lags[j], delay[row, j] + q_age[row])
            seen[row, j] = past(path[row, j], lag[row, j], lags[j], delay[row, j] + pose_age[row]) + off[row, j]
    pose_rows(chain, kind, seen, modelled)
    for row in range(q.shape[0]):
        for i in range(pose.shape[1]):
            offset[row, i] += share[row] * (pose[row, i] - modelled[row, i] - offset[row, i])
