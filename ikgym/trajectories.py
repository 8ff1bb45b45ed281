"""Nominal trajectories: motions in joint space, mapped through the model's kinematics, or paths in Cartesian space.

A trajectory is a function of time without an end. A random one is a distribution over trajectories: `sample` draws
one of them, and gives a fixed trajectory back as it is.
"""

from __future__ import annotations

import abc
import dataclasses
import typing
from collections.abc import Sequence

import numpy as np

from ikgym.arms import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.rotations import rodrigues, rotation_vector
from ikgym.validation import FloatArray, Frozen, frozen_array, number, per_joint, rotation_matrix


class Trajectory(Frozen, abc.ABC):
    """What all trajectories have."""

    #: Whether an episode's trajectory is drawn when it begins.
    random: typing.ClassVar[bool] = False
    #: Whether the trajectory prescribes orientations.
    has_orientation: typing.ClassVar[bool] = True

    def sample(self, rng: np.random.Generator) -> Trajectory:
        """The trajectory of one episode.

        Args:
            rng: The episode's generator; a fixed trajectory does not touch it.
        """
        del rng
        return self

    def joint_path(self, times: FloatArray) -> FloatArray | None:
        """The nominal joint coordinates in [rad] or [m], or None for a path in Cartesian space.

        Args:
            times: Times in [s]. Shape (k,).

        Returns:
            Joint coordinates. Shape (k, n).
        """
        del times
        return None

    @abc.abstractmethod
    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """The nominal poses.

        Args:
            times: Times in [s]. Shape (k,).
            model: The arm through whose kinematics a joint path is mapped.

        Returns:
            Per time the 9 numbers of the rotation, row by row, and the 3 of the position in [m]; the position
            alone where there is no orientation. Shape (k, 12) or (k, 3).
        """

    def joint_bound(self) -> FloatArray | None:
        """Absolute joint coordinates that no nominal motion exceeds, in [rad] or [m]; None in Cartesian space.

        Returns:
            The bounds. Shape (n,).
        """
        return None

    def reach(self, times: FloatArray, model: Arm) -> float:
        """A radius around the base that the nominal positions do not leave, in [m].

        Args:
            times: All times of an episode in [s]. Shape (k,).
            model: The arm through whose kinematics a joint path is mapped.
        """
        bound = self.joint_bound()
        if bound is not None:
            return model.reach(bound)
        return float(np.linalg.norm(self.frames(times, model)[:, -3:], axis=1).max())

    def check(self, model: Arm) -> None:
        """Insists that the trajectory suits an arm.

        Raises:
            InvalidInputError: It has another number of joints.
        """
        bound = self.joint_bound()
        if bound is not None and len(bound) != model.joints:
            raise InvalidInputError(
                f"Trajectory: expected {model.joints} joints, as arm {model.name!r} has, got {len(bound)}."
            )


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
        InvalidInputError: A shape is wrong, or a number not finite.
    """

    amplitude: FloatArray
    frequency: FloatArray | float = 1.0
    phase: FloatArray | float = 0.0
    offset: FloatArray | float = 0.0
    sigmoid: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitude", frozen_array("amplitude", self.amplitude, (None,)))
        for name in ("frequency", "phase", "offset"):
            object.__setattr__(self, name, per_joint(name, getattr(self, name), len(self.amplitude)))
        if self.sigmoid is not None:
            object.__setattr__(self, "sigmoid", number("sigmoid", self.sigmoid, above=0.0))

    def joint_path(self, times: FloatArray) -> FloatArray:
        """See :meth:`Trajectory.joint_path`."""
        return _sinusoid(times[:, None], self.amplitude, self.frequency, self.phase, self.offset, self.sigmoid)

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        return _frames(self.joint_path(times), model)

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
        InvalidInputError: A shape is wrong, a number not finite, or a range the wrong way round.
    """

    amplitude: FloatArray
    scale: tuple[float, float] = (0.2, 1.0)
    frequency: tuple[float, float] = (1.0, 3.0)
    phase: tuple[float, float] = (0.0, 2.0 * np.pi)
    random: typing.ClassVar[bool] = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitude", frozen_array("amplitude", self.amplitude, (None,)))
        for name in ("scale", "frequency", "phase"):
            low, high = frozen_array(name, getattr(self, name), (2,)).tolist()
            if low > high:
                raise InvalidInputError(f"{name}: expected a range (low, high), got ({low:g}, {high:g}).")
            object.__setattr__(self, name, (low, high))

    def sample(self, rng: np.random.Generator) -> Sinusoid:
        """See :meth:`Trajectory.sample`. Draws scales, then frequencies, then phases."""
        n = len(self.amplitude)
        scale, frequency, phase = (rng.uniform(*limits, n) for limits in (self.scale, self.frequency, self.phase))
        return Sinusoid(self.amplitude * scale, frequency, phase)

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """A distribution has no path.

        Raises:
            InvalidInputError: Always; :meth:`sample` first.
        """
        raise InvalidInputError("A random trajectory has no path of its own: sample one first.")

    def joint_bound(self) -> FloatArray:
        """See :meth:`Trajectory.joint_bound`; true for all that may be drawn."""
        return np.abs(self.amplitude) * max(map(abs, self.scale))


@dataclasses.dataclass(frozen=True, eq=False)
class Helix(Trajectory):
    """A helix about the z axis, without orientation (Zhang 2020, example 1).

    ``x = x_0 + r sin(ω τ), y = y_0 + r cos(ω τ), z = z_0 + c τ`` with ``τ = t + start``.

    Args:
        center: (x_0, y_0, z_0) in [m]. Shape (3,).
        radius: r in [m].
        frequency: ω in [rad/s].
        climb: c in [m/s].
        start: Time at which the helix is entered, in [s].

    Raises:
        InvalidInputError: A shape is wrong, or a number not finite.
    """

    center: FloatArray
    radius: float
    frequency: float
    climb: float
    start: float = 0.0
    has_orientation: typing.ClassVar[bool] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", frozen_array("center", self.center, (3,)))
        object.__setattr__(self, "radius", number("radius", self.radius, above=0.0))
        for name in ("frequency", "climb", "start"):
            object.__setattr__(self, name, number(name, getattr(self, name)))

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        del model
        tau = times + self.start
        angle = self.frequency * tau
        path = np.column_stack([self.radius * np.sin(angle), self.radius * np.cos(angle), self.climb * tau])
        path += self.center
        return path


@dataclasses.dataclass(frozen=True, eq=False)
class StraightLine(Trajectory):
    """A straight line between two poses by a linear spline with parabolic blends, then rest (Zhang 2020, ex. 2).

    The orientation turns about one fixed axis, by the same law of time.

    Args:
        start: First frame: the 9 numbers of the rotation, row by row, and the position in [m]. Shape (12,).
        end: Last frame. Shape (12,).
        duration: Time from start to end, in [s].
        blend: Time of each parabolic blend, in [s]; at most half of the duration.

    Raises:
        InvalidInputError: A shape is wrong, a number not finite, a rotation none, or the blends do not fit.
    """

    start: FloatArray
    end: FloatArray
    duration: float
    blend: float

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            frame = frozen_array(name, getattr(self, name), (12,))
            rotation_matrix(f"rotation of {name}", frame[:9].reshape(3, 3))
            object.__setattr__(self, name, frame)
        for name in ("duration", "blend"):
            object.__setattr__(self, name, number(name, getattr(self, name), above=0.0))
        if 2.0 * self.blend > self.duration:
            raise InvalidInputError(
                f"blend: expected at most half of the duration of {self.duration:g} s, got {self.blend:g} s."
            )

    def progress(self, times: FloatArray) -> FloatArray:
        """The share of the way covered, from 0 to 1.

        Args:
            times: Times in [s]. Shape (k,).
        """
        cruise = 1.0 / (self.duration - self.blend)
        t = np.clip(times, 0.0, self.duration)
        left = self.duration - t
        rising = 0.5 * cruise / self.blend * t**2
        falling = 1.0 - 0.5 * cruise / self.blend * left**2
        return np.where(t < self.blend, rising, np.where(left < self.blend, falling, cruise * (t - 0.5 * self.blend)))

    def frames(self, times: FloatArray, model: Arm) -> FloatArray:
        """See :meth:`Trajectory.frames`."""
        del model
        share = self.progress(times)
        first, last = self.start[:9].reshape(3, 3), self.end[:9].reshape(3, 3)
        vector = rotation_vector(last @ first.T)
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else np.array([0.0, 0.0, 1.0])
        rotations = np.array([rodrigues(axis, s * angle) @ first for s in share])
        positions = self.start[9:] + share[:, None] * (self.end[9:] - self.start[9:])
        return np.hstack([rotations.reshape(-1, 9), positions])


def frames_of(trajectories: Sequence[Trajectory], times: FloatArray, model: Arm) -> FloatArray:
    """The nominal poses of several trajectories, each at times of its own.

    Args:
        trajectories: One a row.
        times: Times in [s]. Shape (k, t).
        model: The arm through whose kinematics a joint path is mapped.

    Returns:
        Bit for bit what :meth:`Trajectory.frames` gives row by row. Shape (k, t, 12) or (k, t, 3).
    """
    # What random scenarios draw by the thousands is computed at once.
    if all(type(trajectory) is Sinusoid and trajectory.sigmoid is None for trajectory in trajectories):
        sinusoids = typing.cast(Sequence[Sinusoid], trajectories)
        motions = np.array([(s.amplitude, s.frequency, s.phase, s.offset) for s in sinusoids])
        amplitude, frequency, phase, offset = motions.swapaxes(0, 1)[:, :, None]
        return _frames(_sinusoid(times[..., None], amplitude, frequency, phase, offset, None), model)
    return np.stack([t.frames(row, model) for t, row in zip(trajectories, times, strict=True)])


def _sinusoid(
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


def _frames(path: FloatArray, model: Arm) -> FloatArray:
    """The poses that an arm takes along joint coordinates of shape (..., n)."""
    rotations, positions = model.forward(path)
    return np.concatenate([rotations.reshape(*path.shape[:-1], 9), positions], axis=-1)
