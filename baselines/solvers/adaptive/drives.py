"""Kernels: which delay and lag drives have, from measured joint coordinates and past commands.

A drive applies a command d steps late, and its velocity follows that as v(k) = v(k-1) + (u(k) - v(k-1)) / T, where
T = 1 / (1 - exp(-2π f Δt)) steps belong to a bandwidth of f. Both are linear and do not change, so that their order
does not matter: a drive with delay is where one without has been d steps ago. So a simulated drive for each of a few
lags serves all delays, and lags between two of them are mixtures of their motions.
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
EVIDENCE = 10.0
#: Variance in [rad²] or [m²] that is taken for the noise of q at least.
LEAST_VARIANCE = 1e-18


class Hypotheses(NamedTuple):
    """Hypotheses about drives.

    Attributes:
        delays: In steps, rising by 1. Shape (D,).
        lags: T in steps, rising. Shape (L,).
        delay: The delay that is assumed at first, in steps.
        lag: The T that is assumed at first, in steps.
    """

    delays: IntArray
    lags: FloatArray
    delay: int
    lag: float


class PredictedMemory(NamedTuple):
    """Estimates of the drives of B arms, and the arms without delay and lag that they follow.

    Attributes:
        begun: Whether there was a step before. Shape (B,).
        measured: Joint coordinates of the step before, in [rad] or [m]. Shape (B, n).
        velocity: Of the simulated drives, in [rad/s] or [m/s]. Shape (B, L, n).
        path: Where they are now, and where they were 1, 2, … steps ago, in [rad] or [m]. Shape (B, L, H, n).
        residual: Difference between the measured joint coordinates and those that a delay and a lag would have led to,
            without the constant part, in [rad] or [m]. Shape (B, D, L, n).
        squares: Sums over time of its squares, and of its products with the residual of the next lag. Shape
            (B, D, L, 2).
        samples: How many numbers are in a sum. Shape (B,).
        delay: The delay that is taken to be right, in steps. Shape (B,).
        lag: The same of T. Shape (B,).
        sent: The last command in [rad/s] or [m/s]. Shape (B, n).
        arm_q: Joint coordinates of the arm without delay and lag, in [rad] or [m]. Shape (B, n).
        arm_qdot: Its joint velocities in [rad/s] or [m/s]. Shape (B, n).
        offset: Measured task coordinates minus those that the model has at the same time, filtered. Shape (B, m).
        fastest: The largest velocity of that arm in the last second or so, in [rad/s] or [m/s]. Shape (B, n).
    """

    begun: BoolArray
    measured: FloatArray
    velocity: FloatArray
    path: FloatArray
    residual: FloatArray
    squares: FloatArray
    samples: IntArray
    delay: IntArray
    lag: FloatArray
    sent: FloatArray
    arm_q: FloatArray
    arm_qdot: FloatArray
    offset: FloatArray
    fastest: FloatArray


def start_memory(rows: int, sizes: tuple[int, int], hypotheses: Hypotheses, history: int) -> PredictedMemory:
    """The memory at the start of an episode.

    Args:
        rows: B.
        sizes: n and m, joints of the arm and task coordinates.
        hypotheses: Candidates for delay and bandwidth.
        history: H, steps that the paths of simulated drives reach back.
    """
    (n, m), delays, lags = sizes, len(hypotheses.delays), len(hypotheses.lags)
    return PredictedMemory(
        np.zeros(rows, dtype=np.bool_),
        np.zeros((rows, n)),
        np.zeros((rows, lags, n)),
        np.zeros((rows, lags, history, n)),
        np.zeros((rows, delays, lags, n)),
        np.zeros((rows, delays, lags, 2)),
        np.zeros(rows, dtype=np.int64),
        np.full(rows, hypotheses.delay),
        np.full(rows, hypotheses.lag),
        np.zeros((rows, n)),
        np.zeros((rows, n)),
        np.zeros((rows, n)),
        np.zeros((rows, m)),
        np.zeros((rows, n)),
    )


@kernel
def identify_rows(q, age, hypotheses, memory):
    """Takes in a measurement, and which delay and lag it speaks for.

    The sum of the squared residuals of a mixture of two lags is a parabola in its share, whose coefficients are known:
    the best lag of each delay is worked out, not searched. While little is known the guess counts as one measurement.
    Delays differ by more than their neighbours' lags can make up for, and the one in use changes by one step at a time,
    where the likelihood ratio says so.

    Args:
        q: Measured joint coordinates in [rad] or [m]. Shape (B, n).
        age: How many steps ago that was. Shape (B,).
        hypotheses: A plain :class:`Hypotheses`.
        memory: A plain :class:`PredictedMemory`, changed in place.
    """
    delays, lags, _, _ = hypotheses
    begun, measured, _, path, residual, squares, samples = memory[:7]
    best = np.empty((delays.shape[0], 2))
    for row in range(q.shape[0]):
        if not begun[row]:
            begun[row] = True
            path[row] = q[row]
        elif delays.shape[0] * lags.shape[0] > 1:
            _compare(q[row], measured[row], age[row], delays, path[row], residual[row], squares[row])
            samples[row] += q.shape[1]
            _choose(row, hypotheses, squares[row], samples[row], best, memory)
        measured[row] = q[row]


@inlined
def _compare(q, before, age, delays, path, residual, squares):
    """Brings residuals up to date: shapes (n,), (n,), a number, (D,), (L, H, n), (D, L, n) and (D, L, 2)."""
    for i in range(delays.shape[0]):
        late = min(delays[i] + age, path.shape[1] - 2)
        for f in range(path.shape[0]):
            alone, both = 0.0, 0.0
            for j in range(q.shape[0]):
                moved = (q[j] - before[j]) - (path[f, late, j] - path[f, late + 1, j])
                residual[i, f, j] = HIGH_PASS * residual[i, f, j] + moved
                alone += residual[i, f, j] ** 2
                if f > 0:
                    both += residual[i, f, j] * residual[i, f - 1, j]
            squares[i, f, 0] += alone
            if f > 0:
                squares[i, f - 1, 1] += both


@inlined
def _choose(row, hypotheses, squares, samples, best, memory):
    """Takes another delay where that is significantly better, and the lag that suits it; ``best`` has shape (D, 2)."""
    delays, lags, guess, guessed_lag = hypotheses
    delay, lag = memory[7], memory[8]
    used = delay[row] - delays[0]
    low, high, share = mixture(lag[row], lags)
    alone = squares[used, low, 0], squares[used, low, 1], squares[used, high, 0]
    variance = max(LEAST_VARIANCE, _mixed(alone, share) / samples)
    for i in range(delays.shape[0]):
        best[i, 0], best[i, 1] = _best_lag(squares[i], lags, guessed_lag, variance / LAG_SPREAD**2)
        best[i, 1] += variance * (1.0 + ((delays[i] - guess) / DELAY_SPREAD) ** 2)
    chosen = np.argmin(best[:, 1])
    if 0.5 * samples * math.log(best[used, 1] / best[chosen, 1]) > EVIDENCE:
        used += 1 if chosen > used else -1
        delay[row] = delays[used]
    lag[row] = best[used, 0]


@inlined
def _mixed(sums, share):
    """The sum of squares of a mixture, from those of two lags and that of their products."""
    here, both, there = sums
    return here - 2.0 * share * (here - both) + share * share * (here - 2.0 * both + there)


@inlined
def _best_lag(squares, lags, guess, weight):
    """The lag whose mixture has the least sum of squares, and that sum; with a weight on the distance from a guess."""
    if lags.shape[0] == 1:
        return lags[0], squares[0, 0]
    lag, least = lags[0], np.inf
    for f in range(lags.shape[0] - 1):
        a, b = lags[f] - guess, lags[f + 1] - guess
        here, both = squares[f, 0] + weight * a * a, squares[f, 1] + weight * a * b
        there = squares[f + 1, 0] + weight * b * b
        bend = here - 2.0 * both + there
        share = min(max((here - both) / bend, 0.0), 1.0) if bend > 0.0 else 0.0
        value = _mixed((here, both, there), share)
        if value < least:
            lag, least = lags[f] + share * (lags[f + 1] - lags[f]), value
    return lag, max(least, 0.0)


@kernel
def evidence_rows(lags, memory, out):
    """How much more likely the delays in use are than the next best ones.

    Args:
        lags: Shape (L,).
        memory: A plain :class:`PredictedMemory`.
        out: Receives the logarithm of the likelihood ratio: 0 before the arm has moved, inf where only one delay is
            considered. Shape (B,).
    """
    squares, samples, delay = memory[5], memory[6], memory[7]
    for row in range(out.shape[0]):
        least, other, used = LEAST_VARIANCE * samples[row], np.inf, 0.0
        for i in range(squares.shape[1]):
            value = _best_lag(squares[row, i], lags, 1.0, 0.0)[1]
            # One delay for each row of sums, from 0.
            if i == delay[row]:
                used = value
            else:
                other = min(other, value)
        out[row] = 0.0
        if other == np.inf:
            out[row] = np.inf
        elif samples[row] > 0:
            out[row] = 0.5 * samples[row] * math.log((other + least) / (used + least))


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


@kernel
def past_rows(steps, lags, memory, out):
    """Past joint coordinates of the arms by the current hypothesis.

    Args:
        steps: How many steps before today's command takes effect; at most H - 1. Shape (B,).
        lags: Shape (L,).
        memory: A plain :class:`PredictedMemory`.
        out: Receives joint coordinates in [rad] or [m]. Shape (B, n).
    """
    path, lag = memory[3], memory[8]
    for row in range(out.shape[0]):
        low, high, share = mixture(lag[row], lags)
        k = min(steps[row], path.shape[2] - 1)
        for j in range(out.shape[1]):
            out[row, j] = (1.0 - share) * path[row, low, k, j] + share * path[row, high, k, j]


@kernel
def offset_rows(chain, kind, dt, share, before, batch, lags, memory, off):
    """How far arms are from where the drives should have brought them, and measured poses from those of the model.

    Args:
        chain: The model of the arm.
        kind: The kind of task coordinates.
        dt: Δt in [s].
        share: Share of a new offset of the pose. Shape (B,).
        before: The delays that were assumed in the step before. Shape (B,).
        batch: Measured joint coordinates (B, n) and poses (B, m), and how many steps ago that was. Shapes (B,).
        lags: Shape (L,).
        memory: A plain :class:`PredictedMemory`, changed in place.
        off: Receives the difference of the joint coordinates, in [rad] or [m]. Shape (B, n).
    """
    q, pose, q_age, pose_age = batch
    delay, arm_q, arm_qdot, offset = memory[7], memory[10], memory[11], memory[12]
    seen, modelled = np.empty_like(q), np.empty_like(pose)
    past_rows(delay + q_age, lags, memory, off)
    past_rows(delay + pose_age, lags, memory, seen)
    for row in range(q.shape[0]):
        # With another delay the arm that is driven belongs to another time: by how it moves, not with a jump.
        shift = dt * (delay[row] - before[row])
        for j in range(q.shape[1]):
            arm_q[row, j] += shift * arm_qdot[row, j]
            off[row, j] = q[row, j] - off[row, j]
            seen[row, j] += off[row, j]
    pose_rows(chain, kind, seen, modelled)
    for row in range(q.shape[0]):
        for i in range(pose.shape[1]):
            offset[row, i] += share[row] * (pose[row, i] - modelled[row, i] - offset[row, i])
