"""The shortest time for a joint path within limits of velocity and acceleration, by TOPP-RA (Pham and Pham 2018)."""

from __future__ import annotations

import dataclasses
import logging

import numpy as np
import numpy.typing as npt

from ikgym.trajectories import RetimedTrajectory, Trajectory
from ikgym.trajectories.splines import CubicSpline
from ikgym.validation import FloatArray

#: Grid points of a path.
POINTS = 300
#: No limit, in terms of the velocity limit: reached within this time in [s].
AT_ONCE = 1e-5
#: A rest at both ends lets the rate grow without bounds there; its largest multiple of the average one.
FASTEST = 6.0
#: In which time in [s] a motion that leaves a reserve gets up to speed, which takes half of it, and points in it. The
#: control loop begins late by the delay and lag of the drives, which it does not know yet.
EASE, EASED = 0.2, 21


@dataclasses.dataclass(frozen=True, eq=False)
class Timing:
    """A trajectory's time over a new one; see :class:`ikgym.trajectories.RetimedTrajectory`. Shapes (k,)."""

    times: FloatArray
    progress: FloatArray
    rates: FloatArray

    @classmethod
    def uniform(cls, duration: float, factor: float) -> Timing:
        """This timing's duration in [s] times a factor, everywhere alike."""
        ends = np.array([0.0, duration])
        return cls(factor * ends, ends, np.full(2, 1.0 / factor))

    @property
    def duration(self) -> float:
        """In [s]."""
        return float(self.times[-1])

    def slower(self, factor: float) -> Timing:
        """This timing, slowed by a factor."""
        return Timing(self.times * factor, self.progress, self.rates / factor)

    def eased_in(self) -> Timing:
        """The same from rest: within the first :data:`EASE` seconds the rate rises to that of before, smoothly."""
        x, ease = np.linspace(0.0, 1.0, EASED), min(EASE, self.duration)
        old, share = ease * x**3 * (1.0 - 0.5 * x), x * x * (3.0 - 2.0 * x)
        curve = CubicSpline(self.times, self.progress[:, None], self.rates[:, None])
        later = self.times > 0.5 * ease
        return Timing(
            np.append(ease * x, self.times[later] + 0.5 * ease),
            np.append(curve(old)[:, 0], self.progress[later]),
            np.append(share * np.maximum(curve(old, 1)[:, 0], 0.0), self.rates[later]),
        )

    def of(self, trajectory: Trajectory) -> RetimedTrajectory:
        """A trajectory in this time."""
        return RetimedTrajectory(trajectory, self.times, self.progress, self.rates)


def grid(progress: FloatArray, q: FloatArray, velocity: FloatArray) -> npt.NDArray[np.int64]:
    """Rows of a joint path, more of them where joints move and where time goes by; arguments as of :func:`shortest`."""
    moved = np.append(0.0, np.cumsum(np.max(np.abs(np.diff(q, axis=0)) / velocity, axis=1)))
    along = moved / max(moved[-1], 1e-12) + progress / progress[-1]
    chosen = np.unique(np.searchsorted(along, np.linspace(0.0, along[-1], POINTS)).clip(0, len(q) - 1))
    rows: npt.NDArray[np.int64] = chosen[np.append(True, np.diff(progress[chosen]) > 1e-9 * progress[-1])]
    return rows


def shortest(
    progress: FloatArray,
    q: FloatArray,
    *,
    velocity: FloatArray,
    acceleration: FloatArray,
    dt: float,
    rate: float = np.inf,
) -> Timing | None:
    """The shortest timing of a joint path; None where there is none, as where a joint moves in no time.

    Args:
        progress: Times of a trajectory in [s], rising from 0. Shape (k,).
        q: Joint coordinates at these times, in [rad] or [m]. Shape (k, n).
        velocity: Velocity limits in [rad/s] or [m/s]. Shape (n,).
        acceleration: Acceleration limits in [rad/s²] or [m/s²], inf where there is none. Shape (n,).
        dt: The control period in [s].
        rate: The largest rate of the old time in the new one; inf for none.
    """
    import toppra

    logging.getLogger("toppra").setLevel(logging.ERROR)
    moved = np.abs(np.diff(q, axis=0)) / velocity
    # In terms of the time that the velocity limits alone would take, so that rates are about 1.
    unit = progress[-1] / max(float(moved.max(axis=1).sum()), 1e-9)
    along, fastest = progress / unit, min(rate / unit, FASTEST)
    # The rate is the velocity of one more coordinate: the progress itself.
    curve = toppra.SplineInterpolator(along, np.column_stack([q, along]))
    bounds = np.append(velocity, fastest)
    hardest = np.append(np.minimum(acceleration, velocity / AT_ONCE), fastest / AT_ONCE)
    constraints = [toppra.constraint.JointVelocityConstraint(bounds)]
    constraints += [toppra.constraint.JointAccelerationConstraint(hardest)]
    search = _search()(constraints, curve, gridpoints=along, solver_wrapper="seidel")
    # The largest rates at the ends: from rest and to rest within a control period.
    change = np.minimum(acceleration * dt, velocity)
    slopes = [np.abs(curve(along[i], 1)[:-1]) for i in (0, -1)]
    ends = [float(np.min(change / np.maximum(slope, change / fastest))) for slope in slopes]
    first = search.compute_controllable_sets(0.0, ends[1])[0]
    if np.isnan(first).any():
        return None
    rates = search.compute_parameterization(min(ends[0], 0.999 * float(np.sqrt(first[1]))), ends[1])[1]
    return None if rates is None or np.isnan(rates).any() else _timing(progress, rates * unit)


def _timing(progress: FloatArray, rates: FloatArray) -> Timing | None:
    mean = 0.5 * (rates[1:] + rates[:-1])
    if (mean <= 0.0).any():
        return None
    return Timing(np.append(0.0, np.cumsum(np.diff(progress) / mean)), progress, rates)


def _search() -> type:
    from toppra.algorithm import TOPPRA

    class FreeEnd(TOPPRA):  # type: ignore[misc]  # toppra has no types
        """A search in which the path may end slower than said."""

        def compute_controllable_sets(self, sdmin: float, sdmax: float) -> npt.NDArray[np.float64]:
            sets: npt.NDArray[np.float64] = super().compute_controllable_sets(0.0, sdmax)
            return sets

    return FreeEnd
