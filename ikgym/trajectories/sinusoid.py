"""Sinusoidal motions of the joints, fixed or drawn anew for each episode."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Sequence
from typing import Any

import numpy as np

from ikgym.trajectories.batch import JointMotions, paths_of
from ikgym.trajectories.trajectory import Trajectory
from ikgym.validation import LARGEST, FloatArray, Interval, Numbers, Positive, float_array, per_joint


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

    amplitude: Numbers
    frequency: FloatArray | float = 1.0
    phase: FloatArray | float = 0.0
    offset: FloatArray | float = 0.0
    sigmoid: Positive | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in ("frequency", "phase", "offset"):
            self._settle(**{name: per_joint(name, getattr(self, name), len(self.amplitude), at_most=LARGEST)})

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        offset = self.offset if self.sigmoid is None else np.zeros(len(self.amplitude))
        parameters = np.array([[self.amplitude, self.frequency, self.phase, offset]])
        wave: FloatArray = paths_of(parameters, times[None], 0.0)[0]
        return wave if self.sigmoid is None else self.sigmoid * wave / (1.0 + np.abs(wave)) + self.offset

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`."""
        wave = np.abs(self.amplitude) if self.sigmoid is None else self.sigmoid
        return np.abs(self.offset) + wave


@dataclasses.dataclass(frozen=True, eq=False)
class RandomSinusoid(Trajectory):
    """A distribution over :class:`Sinusoid`: every joint with a different amplitude, frequency and phase.

    Args:
        amplitude: Largest amplitudes in [rad] or [m]. Shape (n,).
        scale: The amplitudes drawn are these times U(scale).
        frequency: Frequencies are drawn from U(frequency), in [rad/s].
        phase: Phases are drawn from U(phase), in [rad].

    Raises:
        InvalidInputError: A shape is wrong, a number not finite or beyond 1e12, or a range the wrong way round.
    """

    amplitude: Numbers
    scale: Interval = (0.2, 1.0)
    frequency: Interval = (1.0, 3.0)
    phase: Interval = (0.0, 2.0 * np.pi)
    random: typing.ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        float_array("amplitude times scale", self.joint_bound(), at_most=LARGEST)

    def sample(self, rng: np.random.Generator) -> Sinusoid:
        """See :meth:`Trajectory.sample`. Draws scales, then frequencies, then phases."""
        motion: Sinusoid = self._draw([rng])[0]
        return motion

    def samples(self, generators: Sequence[np.random.Generator]) -> Sequence[Trajectory]:
        """See :meth:`Trajectory.samples`; all at once, except in a subclass, which may draw others."""
        return self._draw(generators) if type(self) is RandomSinusoid else super().samples(generators)

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`; true for all that may be drawn."""
        return np.abs(self.amplitude) * max(map(abs, self.scale))

    def _draw(self, generators: Sequence[np.random.Generator]) -> Sinusoids:
        drawn, limits = np.empty((len(generators), 3, len(self.amplitude))), (self.scale, self.frequency, self.phase)
        for numbers, rng in zip(drawn, generators, strict=True):
            rng.random(out=numbers)
        scale, frequency, phase = (low + (high - low) * drawn[:, i] for i, (low, high) in enumerate(limits))
        amplitude = self.amplitude * scale
        return Sinusoids(np.stack([amplitude, frequency, phase, np.zeros(amplitude.shape)], axis=1))


class Sinusoids(JointMotions):
    """Several sinusoids; the parameters are their amplitudes, frequencies, phases and offsets."""

    def __getitem__(self, row: Any) -> Any:
        return Sinusoid(*self.parameters[row])
