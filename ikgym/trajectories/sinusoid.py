"""Sinusoidal motions of the joints, fixed or drawn anew for each episode."""

from __future__ import annotations

import dataclasses
import typing

import numpy as np

from ikgym.exceptions import InvalidInputError
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, frozen_array, number, per_joint


@dataclasses.dataclass(frozen=True, eq=False)
class Sinusoid(Trajectory):
    """Joint motion ``q_i = offset_i + A_i sin(ω_i t + φ_i)``, or ``offset_i + S f(A_i sin(ω_i t + φ_i))``.

    Here ``f(x) = x / (1 + |x|)``, the sigmoid of Varga 2021, eq. 12; the plain form is eq. 11.

    Args:
        amplitude: A in [rad] or [m]. Shape (n,).
        frequency: ω in [rad/s]. A number, or shape (n,).
        phase: φ in [rad]. A number, or shape (n,).
        offset: In [rad] or [m]. A number, or shape (n,).
        sigmoid: S in [rad] or [m]; None for the plain form.

    Raises:
        InvalidInputError: A shape is wrong, or a number not finite or beyond 1e12.
    """

    amplitude: FloatArray
    frequency: FloatArray | float = 1.0
    phase: FloatArray | float = 0.0
    offset: FloatArray | float = 0.0
    sigmoid: float | None = None

    def __post_init__(self) -> None:
        self._settle(amplitude=frozen_array("amplitude", self.amplitude, (None,), at_most=LARGEST))
        for name in ("frequency", "phase", "offset"):
            self._settle(**{name: per_joint(name, getattr(self, name), len(self.amplitude), at_most=LARGEST)})
        if self.sigmoid is not None:
            self._settle(sigmoid=number("sigmoid", self.sigmoid, above=0.0, at_most=LARGEST))

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        return waves(times[:, None], self.amplitude, self.frequency, self.phase, self.offset, self.sigmoid)

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`."""
        wave = np.abs(self.amplitude) if self.sigmoid is None else self.sigmoid
        return np.abs(self.offset) + wave


@dataclasses.dataclass(frozen=True, eq=False)
class RandomSinusoid(Trajectory):
    """A distribution over :class:`Sinusoid`: every joint with its own amplitude, frequency and phase.

    Args:
        amplitude: Largest amplitudes in [rad] or [m]. Shape (n,).
        scale: The amplitudes drawn are these times U(scale).
        frequency: Frequencies are drawn from U(frequency), in [rad/s].
        phase: Phases are drawn from U(phase), in [rad].

    Raises:
        InvalidInputError: A shape is wrong, a number not finite or beyond 1e12, or a range the wrong way round.
    """

    amplitude: FloatArray
    scale: tuple[float, float] = (0.2, 1.0)
    frequency: tuple[float, float] = (1.0, 3.0)
    phase: tuple[float, float] = (0.0, 2.0 * np.pi)
    random: typing.ClassVar[bool] = True

    def __post_init__(self) -> None:
        self._settle(amplitude=frozen_array("amplitude", self.amplitude, (None,), at_most=LARGEST))
        for name in ("scale", "frequency", "phase"):
            low, high = frozen_array(name, getattr(self, name), (2,), at_most=LARGEST).tolist()
            if low > high:
                raise InvalidInputError(f"{name}: expected a range (low, high), got ({low:g}, {high:g}).")
            self._settle(**{name: (low, high)})
        frozen_array("amplitude times scale", self.joint_bound(), at_most=LARGEST)

    def sample(self, rng: np.random.Generator) -> Sinusoid:
        """See :meth:`Trajectory.sample`. Draws scales, then frequencies, then phases."""
        n = len(self.amplitude)
        scale, frequency, phase = (rng.uniform(*limits, n) for limits in (self.scale, self.frequency, self.phase))
        return Sinusoid(self.amplitude * scale, frequency, phase)

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`; true for all that may be drawn."""
        return np.abs(self.amplitude) * max(map(abs, self.scale))


def waves(
    times: FloatArray,
    amplitude: FloatArray,
    frequency: FloatArray | float,
    phase: FloatArray | float,
    offset: FloatArray | float,
    sigmoid: float | None,
) -> FloatArray:
    """Joint coordinates of one sinusoid or of many: all that is given broadcasts."""
    wave: FloatArray = amplitude * np.sin(times * frequency + phase)
    if sigmoid is not None:
        wave = sigmoid * wave / (1.0 + np.abs(wave))
    return wave + offset
