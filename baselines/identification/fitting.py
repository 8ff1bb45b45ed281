"""Fits of drives to a log, joint by joint, by the error of their outputs in free run.

Commands and measured velocities pass the same filter, a leaky integral: its outputs are joint coordinates without
their slow part, in which the noise of encoders is white and drift by gravity and friction counts little. As models are
linear, filtered commands give filtered outputs.
"""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz
from scipy.optimize import least_squares, minimize_scalar
from scipy.signal import lfilter

from baselines.identification.log import Log
from ikgym.plant.checks import COMMANDS, LARGEST_POLE, VELOCITIES
from ikgym.validation import FloatArray

#: Corner of the leaky integral in [Hz].
CORNER = 0.3
#: Longest delay in [s], and the range of time constants in [s].
LONGEST, FASTEST, SLOWEST = 0.1, 2e-4, 0.2
#: Length in [s] of blocks: errors of different ones are independent, and every other one is for fits of half the log.
BLOCK = 2.0
#: A drive of low order replaces the lag where it predicts the other half of the log so much better.
BETTER = 0.8
#: Errors of the lag below this share of the motion need no drive of low order.
SMALL = 3e-4
#: Order of the autoregressive filter that whitens what a lag leaves, so that all frequencies count.
ORDER = 8
#: Iterations of Steiglitz and McBride (1965).
ITERATIONS = 8


@dataclasses.dataclass(frozen=True)
class Lag:
    """A delay, a lag of first order and a gain: b₀ u(k-w) + b₁ u(k-w-1) behind the lag.

    Args:
        delay: In periods.
        time_constant: T in [s], 0 for none: a step closes the share 1 − exp(−Δt/T) of the gap.
        gain: The steady gain.
        deviations: Standard deviations of delay, time constant, gain and latency, the mean of the response in periods.
    """

    delay: float
    time_constant: float
    gain: float
    deviations: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class Joint:
    """What was found of one joint.

    Args:
        name: Its name.
        moved: Whether it moved enough; else the numbers are those of the others.
        lag: The lag.
        whole: Whole periods of delay before the drive of low order.
        row: Its coefficients, see :attr:`ikgym.Plant.drive`.
        errors: Rms errors in free run of lag and drive of low order on the half of the log that they were not fitted
            to, and rms of the motion; all filtered so that what the lag leaves is white.
        halves: Total latency in periods and gain in the gentle and in the excited part; None where there are none.
        friction: Speed that is lost to friction or a dead band, in [rad/s] or [m/s].
    """

    name: str
    moved: bool
    lag: Lag
    whole: int
    row: tuple[float, ...]
    errors: tuple[float, float, float]
    halves: tuple[tuple[float, float], tuple[float, float]] | None
    friction: float

    @property
    def shaped(self) -> bool:
        """Whether a drive of low order predicts much better than the lag."""
        return self.errors[1] < BETTER * self.errors[0] and self.errors[0] > SMALL * self.errors[2]


class Part:
    """Filtered commands and velocities of one joint.

    Args:
        log: The log.
        joint: The number of the joint.
    """

    def __init__(self, log: Log, joint: int) -> None:
        self.period = log.period
        self.command, velocity = log.command[:-1, joint], np.diff(log.q[:, joint]) / log.period
        leak = math.exp(-2.0 * math.pi * CORNER * log.period)
        self.u = lfilter([log.period], [1.0, -leak], self.command)
        self.y = lfilter([log.period], [1.0, -leak], velocity)
        self.block = (np.arange(len(self.u)) * log.period // BLOCK).astype(int)
        self.everything = np.ones(len(self.u), dtype=bool)

    def whiten(self, rest: FloatArray) -> None:
        """Filters commands and motion so that errors that are alike a remainder (k,) become white."""
        lags = np.array([rest[i:] @ rest[: len(rest) - i] for i in range(ORDER + 1)]) / max(rest @ rest, 1e-300)
        lags[0] += 1e-9
        ahead = np.append(1.0, -solve_toeplitz(lags[:-1], lags[1:]))
        self.u, self.y = lfilter(ahead, [1.0], self.u), lfilter(ahead, [1.0], self.y)

    def late(self, steps: int, signal: FloatArray | None = None) -> FloatArray:
        """The commands, or another signal, a number of periods late. Shape (k,)."""
        u = self.u if signal is None else signal
        if steps < 0:
            return np.concatenate([u[-steps:], np.full(-steps, u[-1])])
        return np.concatenate([np.zeros(steps), u[: len(u) - steps]])


def _share(period: float, constant: float) -> float:
    return 1.0 - math.exp(-period / constant) if constant > 0.0 else 1.0


def _latency(lag: Lag, period: float) -> float:
    """The mean of the response of a delay and a lag, in periods."""
    return lag.delay + 1.0 / _share(period, lag.time_constant) - 1.0


def _lag_commands(part: Part, whole: int, constant: float) -> FloatArray:
    """Commands behind a lag, whole periods late and one more. Shape (k, 2)."""
    share = _share(part.period, constant)
    out = lfilter([share], [1.0, share - 1.0], part.u)
    return np.stack([part.late(whole, out), part.late(whole + 1, out)], axis=1)


def _taps(part: Part, whole: int, constant: float, where: FloatArray) -> tuple[FloatArray, float]:
    """The best b₀ and b₁ of at least 0, and the sum of squares that they leave in some rows."""
    columns, y = _lag_commands(part, whole, constant), part.y
    if where is not part.everything:
        columns, y = columns[where], y[where]
    square, mixed = columns.T @ columns, columns.T @ y
    found = np.linalg.lstsq(square, mixed, rcond=None)[0]
    if (found < 0.0).any():
        single = np.maximum(mixed / np.maximum(np.diag(square), 1e-300), 0.0)
        i = int(np.argmax(single * mixed))
        found = np.where(np.arange(2) == i, single, 0.0)
    return found, float(y @ y - 2.0 * found @ mixed + found @ square @ found)


def _coarse(part: Part, constant: float, lowest: int, longest: int, where: FloatArray) -> tuple[float, int, float]:
    """The least sum of squares of a time constant, its whole delay and the time constant."""
    share = _share(part.period, constant)
    out, y = lfilter([share], [1.0, share - 1.0], part.u), np.where(where, part.y, 0.0)
    power = float(out[where] @ out[where])
    size = next_fast_len(len(y) + longest, real=True)
    products = irfft(rfft(out, size).conj() * rfft(y, size), size)[np.arange(lowest, longest)]  # of late outputs with y
    whole = int(np.argmax(products))
    return float(y @ y) - max(products[whole], 0.0) ** 2 / max(power, 1e-300), lowest + whole, constant


def _residuals_around(part: Part, whole: int, guess: float, where: FloatArray) -> tuple[float, int, float]:
    """Residuals of a whole delay and the next one, around a guess of the time constant."""
    none = _taps(part, whole, 0.0, where)[1]
    middle = math.log(max(guess, FASTEST))
    found = minimize_scalar(
        lambda log_t: _taps(part, whole, math.exp(log_t), where)[1],
        bounds=(max(middle - 2.5, math.log(FASTEST)), middle + 2.5),
        method="bounded",
        options={"xatol": 1e-4},
    )
    return (none, whole, 0.0) if none <= found.fun else (float(found.fun), whole, math.exp(found.x))


def fit_lag(part: Part, where: Any = None, lowest: int = 0) -> Lag:
    """The delay, lag and gain of a joint, from some rows of the log; delays from ``lowest`` periods."""
    where = part.everything if where is None else where
    longest = math.ceil(LONGEST / part.period)
    constants = [0.0, *np.geomspace(FASTEST, SLOWEST, 24)]
    _, whole, guess = min(_coarse(part, constant, lowest, longest, where) for constant in constants)
    near: dict[int, tuple[float, int, float]] = {}
    while whole - 1 not in near or whole + 1 not in near:  # down the valley of delays
        for step in range(max(lowest, whole - 1), whole + 2):
            near.setdefault(step, _residuals_around(part, step, guess, where))
        near.setdefault(lowest - 1, (math.inf, lowest - 1, 0.0))
        _, whole, guess = min(near.values())
    constant = near[whole][2]
    taps, _ = _taps(part, whole, constant, where)
    gain = float(taps.sum())
    delay = whole + float(taps[1]) / gain if gain > 0.0 else float(whole)
    return Lag(delay, constant, gain, _deviations(part, delay, constant, gain, where))


def simulate_lag(part: Part, lag: Lag) -> FloatArray:
    """Output of a lag, filtered. Shape (k,)."""
    whole = math.floor(lag.delay)
    rest = lag.delay - whole
    out: FloatArray = lag.gain * _lag_commands(part, whole, lag.time_constant) @ np.array([1.0 - rest, rest])
    return out


def _deviations(part: Part, delay: float, constant: float, gain: float, where: Any) -> tuple[float, ...]:
    """Standard deviations, see :class:`Lag`.

    The larger ones of two: errors depend on each other within blocks, whose spread few blocks underestimate; or they
    are white (the bound of Cramér and Rao).
    """
    base = np.array([delay, max(constant, FASTEST), gain])

    def output(values: FloatArray) -> FloatArray:
        return simulate_lag(part, Lag(values[0], values[1], values[2]))

    steps = np.array([1e-3, 1e-3 * base[1], 1e-3])
    slopes = np.stack([(output(base + step) - output(base)) / step.sum() for step in np.diag(steps)], axis=1)
    if constant <= FASTEST:  # delay and lag are alike then
        slopes[:, 1] = 0.0
    slopes, rest = slopes[where], (part.y - output(base))[where]
    scores = np.zeros((part.block.max() + 1, 3))
    np.add.at(scores, part.block[where], slopes * rest[:, None])
    inverse = np.linalg.pinv(slopes.T @ slopes)
    spreads = inverse @ (scores.T @ scores) @ inverse, np.square(rest).mean() * inverse
    ratio = part.period / base[1]
    latency = np.array([1.0, ratio / base[1] / (4.0 * math.sinh(0.5 * ratio) ** 2), 0.0])
    variances = np.max([[*np.diag(spread), latency @ spread @ latency] for spread in spreads], axis=0)
    return tuple(np.sqrt(np.maximum(variances, 0.0)).tolist())


def simulate_drive(part: Part, whole: int, row: Any) -> FloatArray:
    """Output of a drive of low order, filtered. Shape (k,)."""
    row = np.asarray(row)
    out: FloatArray = lfilter(row[VELOCITIES:], np.append(1.0, -row[:VELOCITIES]), part.late(whole))
    return out


def _stable(a: FloatArray) -> FloatArray:
    """Coefficients whose poles are within the largest one."""
    poles = np.roots(np.append(1.0, -a))
    size = np.maximum(np.abs(poles), 1e-300)
    within: Any = np.poly(poles * np.minimum(1.0, 0.99 * LARGEST_POLE / size))
    return np.asarray(-within.real[1:], dtype=np.float64)


def fit_drive(part: Part, lag: Lag, whole: int, where: Any = None, *, polish: bool = True) -> tuple[FloatArray, float]:
    """Coefficients of a drive of low order after whole periods of delay, and its mean square error in some rows.

    Iterations of Steiglitz and McBride begin from the lag; then Levenberg and Marquardt's method on the output errors.
    """
    where = part.everything if where is None else where
    share = _share(part.period, lag.time_constant)
    later = lag.delay - whole
    row = np.zeros(VELOCITIES + COMMANDS)
    row[0] = 1.0 - share
    at = min(max(int(later), 0), COMMANDS - 2)
    rest = min(max(later - at, 0.0), 1.0)
    row[VELOCITIES + at], row[VELOCITIES + at + 1] = share * lag.gain * (1.0 - rest), share * lag.gain * rest

    def residual(values: FloatArray) -> FloatArray:
        if np.abs(np.roots(np.append(1.0, -values[:VELOCITIES]))).max() > LARGEST_POLE:
            return np.full(int(where.sum()), 1e3)
        return np.asarray((simulate_drive(part, whole, values) - part.y)[where])

    def slopes(values: FloatArray) -> FloatArray:
        bottom = np.append(1.0, -values[:VELOCITIES])
        out, u = simulate_drive(part, whole, values), part.late(whole)
        columns = [part.late(i + 1, out) for i in range(VELOCITIES)] + [part.late(i, u) for i in range(COMMANDS)]
        return np.asarray(np.asarray(lfilter([1.0], bottom, np.stack(columns), axis=1)).T[where])

    starts = [row]
    for _ in range(ITERATIONS):
        bottom = np.append(1.0, -starts[-1][:VELOCITIES])
        y, u = (lfilter([1.0], bottom, signal) for signal in (part.y, part.late(whole)))
        columns = [part.late(i + 1, y) for i in range(VELOCITIES)] + [part.late(i, u) for i in range(COMMANDS)]
        found = np.linalg.lstsq(np.stack(columns, axis=1)[where], y[where], rcond=None)[0]
        starts.append(np.concatenate([_stable(found[:VELOCITIES]), found[VELOCITIES:]]))
    begin = min(starts, key=lambda values: float(np.square(residual(values)).sum()))
    if not polish:
        return begin, float(np.square(residual(begin)).mean())
    scale = 1.0 / max(float(np.sqrt(np.square(part.y[where]).mean())), 1e-300)
    found = least_squares(
        lambda values: scale * residual(values),
        begin,
        jac=lambda values: scale * slopes(values),
        method="lm",
        max_nfev=60,
    ).x
    best = min((begin, found), key=lambda values: float(np.square(residual(values)).sum()))
    return best, float(np.square(residual(best)).mean())


def fit_joint(log: Log, joint: int, name: str, limit: float) -> Joint:
    """All that a log says of one joint, whose velocity limit is given in [rad/s] or [m/s]."""
    part = Part(log, joint)
    lag = fit_lag(part)
    moved = bool(np.abs(part.command).max() > 1e-3 * min(limit, 1.0) and lag.gain > 0.0)
    moved = moved and lag.deviations[3] < 0.5 and lag.deviations[2] < 0.05 * lag.gain
    if not moved:
        return Joint(name, False, lag, 0, (), (0.0, 0.0, 0.0), None, 0.0)
    halves, friction = _halves(part), _friction(part, lag)
    if (rest := part.y - simulate_lag(part, lag)).any():
        part.whiten(rest)
        lag = fit_lag(part)
    half, size = part.block % 2 == 0, float(np.sqrt(np.square(part.y).mean()))
    first = fit_lag(part, half)
    whole = _best_delay(part, lag)
    row, _ = fit_drive(part, lag, whole)
    errors = [
        float(np.sqrt(np.square((out - part.y)[~half]).mean()))
        for out in (simulate_lag(part, first), simulate_drive(part, whole, fit_drive(part, lag, whole, half)[0]))
    ]
    coefficients = tuple(row.tolist())
    return Joint(name, True, lag, whole, coefficients, (*errors, size), halves, friction)  # type: ignore[arg-type]


def _best_delay(part: Part, lag: Lag) -> int:
    """Whole periods of delay before the best drive of low order."""
    last = math.floor(lag.delay)
    return min(range(max(0, last - 4), last + 1), key=lambda whole: fit_drive(part, lag, whole, polish=False)[1])


def _halves(part: Part) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Total latency and gain in the gentle and in the excited part, where the log has both."""
    count = part.block.max() + 1
    power = np.sqrt(np.bincount(part.block, np.square(part.command), count) / np.bincount(part.block, minlength=count))
    middle = math.sqrt(max(float(power[power > 0.0].min(initial=np.inf)), 1e-12) * max(float(power.max()), 1e-12))
    gentle = (power > 0.0) & (power < min(middle, 0.5 * power.max()))
    if gentle.sum() < 2 or (~gentle).sum() < 2:
        return None
    found = [fit_lag(part, chosen[part.block]) for chosen in (gentle, power >= 0.5 * power.max())]
    first, second = ((_latency(one, part.period), one.gain) for one in found)
    return first, second


def _friction(part: Part, lag: Lag) -> float:
    """Speed that is lost whatever the command is, in [rad/s] or [m/s]: friction, or a dead band; 0 where none shows."""
    leak = math.exp(-2.0 * math.pi * CORNER * part.period)
    sign = lfilter([part.period], [1.0, -leak], np.sign(part.command))
    share, whole = _share(part.period, lag.time_constant), math.floor(lag.delay)
    lost = lfilter([share], [1.0, share - 1.0], part.late(whole, np.asarray(sign)))
    columns = np.stack([simulate_lag(part, lag), lost], axis=1)
    found = np.linalg.lstsq(columns, part.y, rcond=None)[0]
    before = float(np.square(part.y - columns[:, 0]).sum())
    after = float(np.square(part.y - columns @ found).sum())
    return -float(found[1]) if after < 0.7 * before and found[1] < 0.0 else 0.0
