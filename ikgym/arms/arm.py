"""The arm: a validated, frozen serial chain of revolute and prismatic joints."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ikgym import kinematics
from ikgym.arms.posture import within_limits
from ikgym.exceptions import InvalidInputError
from ikgym.kinematics import Chain
from ikgym.validation import (
    LARGEST,
    UNIT_TOLERANCE,
    FloatArray,
    Frozen,
    float_array,
    frozen_array,
    read_only,
    rotation_matrix,
)

# What is this close to unit length is a unit vector that was rounded: three parts cannot come closer in general.
ROUNDING = 4e-16


class UrdfReference(NamedTuple):
    """Where an arm from a URDF file came from; see :func:`ikgym.arms.from_urdf`.

    Attributes:
        file: The file, as an absolute path.
        base: The link that the arm begins at, None for the root.
        tip: The link that it ends at, None for the only leaf.
        tool: Tool point in the frame of the tip in [m], None for its origin. Shape (3,).
        tool_rotation: Orientation of the tool in the frame of the tip, None for that frame's. Shape (3, 3).
    """

    file: Path
    base: str | None
    tip: str | None
    tool: FloatArray | None
    tool_rotation: FloatArray | None


@dataclasses.dataclass(frozen=True, eq=False)
class Arm(Frozen):
    """A serial arm, ``H = H_1 … H_n · H_tool`` (Varga 2021, eq. 6; Khan 2020, eq. 3.12).

    Each joint is ``H_i = Trans(offset_i) · Rot(axis_i, q_i)``, or ``Trans(offset_i + q_i · axis_i)`` where it is
    prismatic. All link frames are parallel to the base at q = 0; fixed rotations between links are absorbed into
    the axes, the offsets and the tool's home orientation, which loses no generality. For arms in another form see
    :func:`ikgym.arms.from_dh` and :func:`ikgym.arms.from_urdf`.

    Args:
        name: What the arm is called.
        offsets: From the frame of the joint before to the joint, in [m]. Shape (n, 3).
        axes: The joints' axes. Shape (n, 3). Unit vectors: an axis whose length differs from 1 by more than
            1e-6 is an error, within that it is scaled to unit length.
        prismatic: True where a joint is prismatic, one entry a joint. All are revolute if it is left out.
        tool: Tool point in the last frame, in [m]. Shape (3,).
        tool_rotation: Orientation of the tool in the last frame, a rotation matrix to within 1e-6, which is made
            exactly orthogonal. Shape (3, 3).
        lower: Lower limits of the joints in [rad] or [m], -inf where there is none. Shape (n,). Kinematics take
            no notice of any limit.
        upper: Upper limits of the joints in [rad] or [m], inf where there is none. Shape (n,).
        velocity_limit: Largest speeds of the joints in [rad/s] or [m/s], inf where there is none. Shape (n,).
        acceleration_limit: Largest accelerations of the joints in [rad/s²] or [m/s²], inf where there is none.
            Shape (n,).
        home: A posture away from limits and singularities in [rad] or [m], None where none is stated. Shape (n,).
        joint_names: What the joints are called where their coordinates are handed on, n different texts; ``joint_1``,
            ``joint_2``, … if they are left out.

    Raises:
        InvalidInputError: A shape, an axis, an orientation, a limit or a joint's name is wrong, home is outside the
            limits, or a length beyond 1e12.
    """

    name: str
    offsets: FloatArray
    axes: FloatArray
    prismatic: Sequence[bool] = ()
    tool: FloatArray = dataclasses.field(default_factory=lambda: np.zeros(3))
    tool_rotation: FloatArray = dataclasses.field(default_factory=lambda: np.eye(3))
    lower: FloatArray = None  # type: ignore[assignment]  # none
    upper: FloatArray = None  # type: ignore[assignment]  # none
    velocity_limit: FloatArray = None  # type: ignore[assignment]  # none
    acceleration_limit: FloatArray = None  # type: ignore[assignment]  # none
    home: FloatArray | None = None
    joint_names: Sequence[str] = ()
    chain: Chain = dataclasses.field(init=False, repr=False)
    #: The URDF file that the arm was read from, None for all other arms and for changed copies.
    urdf: UrdfReference | None = dataclasses.field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        offsets = frozen_array(f"offsets of arm {self.name!r}", self.offsets, (None, 3), at_most=LARGEST)
        n = len(offsets)
        if n == 0:
            raise InvalidInputError(f"Arm {self.name!r}: expected at least one joint, got none.")
        axes = read_only(_unit_axes(self.name, float_array(f"axes of arm {self.name!r}", self.axes, (n, 3))))
        prismatic = (tuple(self.prismatic) or (False,) * n) if isinstance(self.prismatic, Iterable) else ()
        if len(prismatic) != n or not all(isinstance(p, (bool, np.bool_)) for p in prismatic):
            raise InvalidInputError(
                f"prismatic of arm {self.name!r}: expected {n} truth values, one a joint, got {self.prismatic!r}."
            )
        tool = frozen_array(f"tool of arm {self.name!r}", self.tool, (3,), at_most=LARGEST)
        tool_rotation = rotation_matrix(f"tool_rotation of arm {self.name!r}", self.tool_rotation)
        lower = _limits(self.name, "lower", self.lower, n, -np.inf)
        upper = _limits(self.name, "upper", self.upper, n, np.inf)
        velocity_limit = _limits(self.name, "velocity_limit", self.velocity_limit, n, np.inf, positive=True)
        acceleration_limit = _limits(self.name, "acceleration_limit", self.acceleration_limit, n, np.inf, positive=True)
        if (lower >= upper).any():
            i = int(np.argmax(lower >= upper))
            raise InvalidInputError(
                f"Limits of arm {self.name!r}: expected lower < upper, got {lower[i]:g} and {upper[i]:g} at joint {i}."
            )
        chain = Chain(offsets, axes, np.array(prismatic, dtype=np.bool_), tool, tool_rotation)
        chain.prismatic.flags.writeable = False
        for field, value in {
            "offsets": offsets,
            "axes": axes,
            "prismatic": tuple(bool(p) for p in prismatic),
            "tool": tool,
            "tool_rotation": tool_rotation,
            "lower": lower,
            "upper": upper,
            "velocity_limit": velocity_limit,
            "acceleration_limit": acceleration_limit,
            "joint_names": _joint_names(self.name, self.joint_names, n),
            "chain": chain,
        }.items():
            object.__setattr__(self, field, value)
        if self.home is not None:
            home = frozen_array(f"home of arm {self.name!r}", self.home, (n,))
            within_limits("home", home, self)
            object.__setattr__(self, "home", home)

    @property
    def joints(self) -> int:
        """The number of joints, n."""
        return len(self.offsets)

    @functools.cached_property
    def limited(self) -> bool:
        """Whether any joint has a limit of any kind."""
        limits = (self.lower, self.upper, self.velocity_limit, self.acceleration_limit)
        return bool(np.isfinite(limits).any())

    def forward(self, q: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Orientation and position of the tool.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (..., n).

        Returns:
            Rotation matrices of shape (..., 3, 3) and tool points in the base frame in [m], of shape (..., 3).

        Raises:
            InvalidInputError: q has the wrong length or is not finite.
        """
        rows, lead = self._rows(q)
        rotation, position = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
        kinematics.forward_rows(self.chain, rows, rotation, position)
        return rotation.reshape(*lead, 3, 3), position.reshape(*lead, 3)

    def jacobian(self, q: npt.ArrayLike) -> FloatArray:
        """The geometric Jacobian at the tool point, in the base frame.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (..., n).

        Returns:
            Linear rows first: [m/s] and [rad/s] per unit of joint velocity. Shape (..., 6, n).

        Raises:
            InvalidInputError: q has the wrong length or is not finite.
        """
        return self.forward_and_jacobian(q)[2]

    def forward_and_jacobian(self, q: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
        """:meth:`forward` and :meth:`jacobian` in one pass.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (..., n).

        Returns:
            Rotations (..., 3, 3), positions (..., 3) in [m], Jacobians (..., 6, n).

        Raises:
            InvalidInputError: q has the wrong length or is not finite.
        """
        rows, lead = self._rows(q)
        rotation, position = np.empty((len(rows), 3, 3)), np.empty((len(rows), 3))
        jacobian = np.empty((len(rows), 6, self.joints))
        kinematics.forward_and_jacobian_rows(self.chain, rows, rotation, position, jacobian)
        return rotation.reshape(*lead, 3, 3), position.reshape(*lead, 3), jacobian.reshape(*lead, 6, self.joints)

    def inverse(
        self,
        rotation: npt.ArrayLike | None,
        position: npt.ArrayLike,
        start: npt.ArrayLike | None = None,
        *,
        tolerance: float = 1e-9,
        restarts: int = 100,
        seed: int = 0,
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Joint coordinates within the limits at which the tool has a pose, by Levenberg–Marquardt steps.

        The first attempt begins at the start, all others at random postures that the seed alone determines: a row of a
        batch equals the single call.

        Args:
            rotation: Orientations of the tool; None where they do not matter, as with three joints. (..., 3, 3).
            position: Tool points in the base frame in [m]. Shape (..., 3).
            start: Joint coordinates within the limits in [rad] or [m]; the home posture if it is left out, or the
                middle of the limits where none is stated. Shape (..., n).
            tolerance: Largest distance in [m] and largest angle in [rad] at which a pose is met.
            restarts: Random starts after the first one.
            seed: Of the random starts.

        Returns:
            Joint coordinates (..., n), by full turns as near to the start as the limits allow, and whether they meet
            the pose, (...). Where they do not, they are the nearest to it that were found.

        Raises:
            InvalidInputError: A shape, a number or a rotation is wrong, or a start is outside the limits.
        """
        from ikgym.arms import inverse  # its kernels take longer to load than all arms

        return inverse.inverse(self, rotation, position, start, tolerance=tolerance, restarts=restarts, seed=seed)

    def joint_points(self, q: npt.ArrayLike) -> FloatArray:
        """Where each joint begins and ends, in the base frame; the two differ where a joint is prismatic.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (n,).

        Returns:
            Points in [m]. Shape (n, 2, 3).

        Raises:
            InvalidInputError: q has the wrong length or is not finite.
        """
        out = np.empty((self.joints, 2, 3))
        kinematics.joint_points(self.chain, float_array("q", q, (self.joints,)), out)
        return out

    def reach(self, travel: npt.ArrayLike) -> float:
        """A radius around the base that the tool point never leaves, in [m].

        Args:
            travel: Largest absolute joint coordinates; only those of prismatic joints count. Shape (n,).

        Raises:
            InvalidInputError: travel has the wrong length or is not finite.
        """
        prismatic = float_array("travel", travel, (self.joints,))[self.chain.prismatic]
        links = np.linalg.norm(self.offsets, axis=1).sum() + np.linalg.norm(self.tool)
        return float(links + np.abs(prismatic).sum())

    def _rows(self, q: npt.ArrayLike) -> tuple[FloatArray, tuple[int, ...]]:
        array = float_array("q", q)
        if array.ndim == 0 or array.shape[-1] != self.joints:
            raise InvalidInputError(f"q: expected shape (..., {self.joints}) for arm {self.name!r}, got {array.shape}.")
        return array.reshape(-1, self.joints), array.shape[:-1]


def _unit_axes(name: str, axes: FloatArray) -> FloatArray:
    lengths: FloatArray = np.linalg.norm(axes, axis=1)
    for i, length in enumerate(lengths):
        if abs(length - 1.0) > UNIT_TOLERANCE:
            what = "the zero vector" if length == 0.0 else f"{axes[i].tolist()} of length {length:.6g}"
            raise InvalidInputError(
                f"Axis of joint {i} of arm {name!r}: expected a unit vector, got {what}. Nothing is normalised for "
                "you, since a wrong length most often is a mistake; divide the axis by its length if it is meant."
            )
    # A unit vector divided by its rounded length again may change in the last bit: a copy of an arm is that arm.
    exact = np.abs(lengths - 1.0) <= ROUNDING
    return np.where(exact[:, None], axes, axes / lengths[:, None])


def numbered_joints(n: int) -> tuple[str, ...]:
    """What joints without names of their own are called."""
    return tuple(f"joint_{i + 1}" for i in range(n))


def _joint_names(name: str, given: Sequence[str], n: int) -> tuple[str, ...]:
    names = (tuple(given) or numbered_joints(n)) if isinstance(given, (tuple, list)) else ()
    texts = [one for one in names if isinstance(one, str) and one]
    if not len(texts) == len(set(texts)) == len(names) == n:
        raise InvalidInputError(f"joint_names of arm {name!r}: expected {n} different texts, got {given!r}.")
    return names


def _limits(
    name: str, what: str, value: npt.ArrayLike | None, n: int, default: float, *, positive: bool = False
) -> FloatArray:
    """Limits may be infinite, unlike everything else."""
    if value is None:
        return read_only(np.full(n, default))
    try:
        raw = np.asarray(value)
        # NumPy would read strings as numbers.
        if raw.dtype.kind not in "fiu" or raw.shape != (n,) or np.isnan(raw).any():
            raise ValueError
    except (TypeError, ValueError):
        raise InvalidInputError(f"{what} of arm {name!r}: expected {n} numbers, got {value!r}.") from None
    if positive and (raw <= 0.0).any():
        raise InvalidInputError(f"{what} of arm {name!r}: expected numbers above 0, got {raw.tolist()}.")
    return read_only(raw.astype(np.float64))
