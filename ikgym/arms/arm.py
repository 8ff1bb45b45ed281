"""The arm: a validated, frozen serial chain of revolute and prismatic joints."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Iterable, Sequence
from typing import Annotated, Any, Self

import numpy as np
import numpy.typing as npt

from ikgym.arms.bodies import Bodies, Neighbour
from ikgym.arms.source import UrdfReference
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import Frozen
from ikgym.kernels import kinematics
from ikgym.kernels.bodies import clearance_rows
from ikgym.kernels.kinematics import Chain
from ikgym.validation import (
    LARGEST,
    UNIT_TOLERANCE,
    FloatArray,
    Rotation,
    Vector,
    about,
    different_texts,
    ending,
    float_array,
    frozen_array,
    read_only,
    shorten,
)

#: Fields that say nothing of the geometry.
FACTS = frozenset(("name", "lower", "upper", "velocity_limit", "acceleration_limit", "jerk_limit", "home"))
# Within this of length 1, a vector is a rounded unit vector: three floats cannot come closer in general.
ROUNDING = 4e-16


@dataclasses.dataclass(frozen=True, eq=False)
class Arm(Frozen):
    """A serial arm, ``H = H_1 … H_n · H_tool`` (Varga 2021, eq. 6; Khan 2020, eq. 3.12).

    Each joint is ``H_i = Trans(offset_i) · Rot(axis_i, q_i)``, or ``Trans(offset_i + q_i · axis_i)`` where it is
    prismatic. All link frames are parallel to the base at q = 0; fixed rotations between links are absorbed into
    the axes, the offsets and the tool's home orientation, which loses no generality. For arms in another form see
    :func:`ikgym.arms.from_dh` and :func:`ikgym.arms.from_urdf`.

    Args:
        name: Name of the arm.
        offsets: From the frame of the joint before to the joint, in [m]. Shape (n, 3).
        axes: The joints' axes. Shape (n, 3). Unit vectors: an axis whose length differs from 1 by more than
            1e-6 is an error, within that it is scaled to unit length.
        prismatic: True where a joint is prismatic, one entry a joint. All are revolute if it is left out.
        tool: Tool point in the last frame, in [m]. Shape (3,).
        tool_rotation: Orientation of the tool in the last frame, a rotation matrix to within 1e-6, which is made
            exactly orthogonal. Shape (3, 3).
        lower: Lower limits of the joints in [rad] or [m], -inf where there is none. Shape (n,). Kinematics
            ignore all limits.
        upper: Upper limits of the joints in [rad] or [m], inf where there is none. Shape (n,).
        velocity_limit: Largest speeds of the joints in [rad/s] or [m/s], inf where there is none. Shape (n,).
        acceleration_limit: Largest accelerations of the joints in [rad/s²] or [m/s²], inf where there is none.
            Shape (n,).
        home: A posture away from limits and singularities in [rad] or [m], or None. Shape (n,).
        joint_names: Names of the joints in exported data, n different texts; ``joint_1``, ``joint_2``, … by default.
        bodies: Spheres and capsules on its links, for :meth:`clearance` and for scenarios with collisions.
        jerk_limit: Largest changes of an acceleration in [rad/s³] or [m/s³], inf where there is none. Kept by
            policies and by the control loop, see :attr:`ikgym.Scenario.jerk_limit`, and not by the plant. Shape (n,).

    Raises:
        InvalidInputError: A shape, an axis, an orientation, a limit or a joint's name is wrong, home is outside the
            limits, a body on a link that there is not, or a length beyond 1e12.
    """

    name: str
    offsets: Annotated[FloatArray, functools.partial(frozen_array, shape=(None, 3), at_most=LARGEST)]
    axes: Annotated[FloatArray, _unit_axes]
    prismatic: Sequence[bool] = ()
    tool: Vector = dataclasses.field(default_factory=lambda: np.zeros(3))
    tool_rotation: Rotation = dataclasses.field(default_factory=lambda: np.eye(3))
    lower: FloatArray = None  # type: ignore[assignment]  # none
    upper: FloatArray = None  # type: ignore[assignment]  # none
    velocity_limit: FloatArray = None  # type: ignore[assignment]  # none
    acceleration_limit: FloatArray = None  # type: ignore[assignment]  # none
    home: FloatArray | None = None
    joint_names: Sequence[str] = ()
    bodies: Bodies = Bodies()  # noqa: RUF009  # frozen
    jerk_limit: FloatArray = None  # type: ignore[assignment]  # none
    chain: Chain = dataclasses.field(init=False, repr=False)
    #: The URDF file that the arm was read from, None for all other arms and for copies that differ by more than
    #: :data:`FACTS`.
    urdf: UrdfReference | None = dataclasses.field(init=False, repr=False, default=None)

    def __post_init__(self) -> None:
        with about(f"Arm {shorten(self.name)}"):
            super().__post_init__()
            self._check()

    def _check(self) -> None:
        """Checks fields that belong together, and fills in those left out."""
        n = len(self.offsets)
        if n == 0:
            raise InvalidInputError("expected at least one joint, got none.")
        float_array("axes", self.axes, (n, 3))
        ends = {"lower": -np.inf, "upper": np.inf}
        fastest = {"velocity_limit": np.inf, "acceleration_limit": np.inf, "jerk_limit": np.inf}
        self._settle(
            prismatic=_truth_values("prismatic", self.prismatic, n),
            joint_names=_joint_names("joint_names", self.joint_names, n),
            **{name: joint_limits(name, getattr(self, name), n, free) for name, free in ends.items()},
            **{name: joint_limits(name, getattr(self, name), n, free, positive=True) for name, free in fastest.items()},
        )
        self.bodies.check(n)
        if (crossed := self.lower >= self.upper).any():
            i = int(np.argmax(crossed))
            raise InvalidInputError(
                f"limits: expected lower < upper, got {self.lower[i]:g} and {self.upper[i]:g} at joint "
                f"{self.joint_names[i]!r}."
            )
        prismatic = np.array(self.prismatic, dtype=np.bool_)
        prismatic.flags.writeable = False
        self._settle(chain=Chain(self.offsets, self.axes, prismatic, self.tool, self.tool_rotation))
        if self.home is not None:
            self._settle(home=frozen_array("home", self.home, (n,)))
            self.check_posture("home", self.home)

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, see :meth:`Frozen.replace`; limits, home and name keep :attr:`urdf`."""
        copy = super().replace(**changes)
        if FACTS.issuperset(changes):
            object.__setattr__(copy, "urdf", self.urdf)
        return copy

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

        The first attempt begins at the start, all others at random postures that depend on the seed alone: a row of a
        batch equals the single call.

        Args:
            rotation: Orientations of the tool; None where they do not matter, as with three joints. (..., 3, 3).
            position: Tool points in the base frame in [m]. Shape (..., 3).
            start: Joint coordinates within the limits in [rad] or [m]; by default the home posture, or the middle of
                the limits where there is none. Shape (..., n).
            tolerance: Largest distance in [m] and largest angle in [rad] that count as converged.
            restarts: Random starts after the first one.
            seed: Of the random starts.

        Returns:
            Joint coordinates (..., n), by full turns as near to the start as the limits allow, and whether they
            converged, (...). Where they did not, they are the nearest to the pose that were found.

        Raises:
            InvalidInputError: A shape, a number or a rotation is wrong, or a start is outside the limits.
        """
        from ikgym.arms import inverse  # its kernels take longer to load than all arms

        return inverse.inverse(self, rotation, position, start, tolerance=tolerance, restarts=restarts, seed=seed)

    def clearance(
        self, q: npt.ArrayLike, obstacles: Sequence[Neighbour] = ()
    ) -> tuple[FloatArray, npt.NDArray[np.int64]]:
        """The smallest signed distance of the arm's bodies from each other and from obstacles.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (..., n).
            obstacles: Obstacles around the arm, at rest.

        Returns:
            Distances in [m], below 0 where two bodies overlap and infinite where nothing can meet, of shape (...); and
            the nearest pairs: the number of a body, and that of another body, or the number of bodies plus that of an
            obstacle; -1 where nothing can meet. Shape (..., 2).

        Raises:
            InvalidInputError: q has the wrong length or is not finite, an obstacle is none, or a link was not looked
                at, see :attr:`Bodies.unseen`.
            UnknownNameError: An obstacle ignores a body that there is not.
        """
        self.bodies.check_seen(self.name)
        rows, lead = self._rows(q)
        distances, pairs = np.empty(len(rows)), np.empty((len(rows), 2), dtype=np.int64)
        around = self.bodies.surroundings(obstacles)
        clearance_rows(self.chain, self.bodies.shapes, *around, rows, distances, pairs)
        return distances.reshape(lead), pairs.reshape(*lead, 2)

    def joint_points(self, q: npt.ArrayLike) -> FloatArray:
        """The two ends of each joint in the base frame; they differ where a joint is prismatic.

        Args:
            q: Joint coordinates in [rad] or [m]. Shape (..., n).

        Returns:
            Points in [m]. Shape (..., n, 2, 3).

        Raises:
            InvalidInputError: q has the wrong shape or is not finite.
        """
        rows, lead = self._rows(q)
        points, here, rotation = np.empty((len(rows), self.joints, 2, 3)), np.zeros((len(rows), 3)), np.eye(3)
        for i, (offset, axis, prismatic) in enumerate(zip(self.offsets, self.axes, self.prismatic, strict=True)):
            points[:, i, 0] = here = here + rotation @ offset
            if prismatic:
                here = here + rows[:, i, None] * (rotation @ axis)
            else:
                cross, angle = np.cross(axis, np.eye(3)).T, rows[:, i, None, None]
                rotation = rotation @ (np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)
            points[:, i, 1] = here
        return points.reshape(*lead, self.joints, 2, 3)

    def check_posture(self, name: str, q: FloatArray) -> None:
        """Refuses joint coordinates outside the limits.

        Args:
            name: Name of the coordinates in messages.
            q: Joint coordinates in [rad] or [m]. Shape (..., n).

        Raises:
            InvalidInputError: A joint is outside its limits; the message names it.
        """
        rows = q.reshape(-1, self.joints)
        outside = (rows < self.lower) | (rows > self.upper)
        if outside.any():
            row, joint = np.argwhere(outside)[0].tolist()
            raise InvalidInputError(
                f"{name}: expected joint {self.joint_names[joint]!r} of arm {self.name!r} within its limits, from "
                f"{float(self.lower[joint])!r} to {float(self.upper[joint])!r} "
                f"[{'m' if self.prismatic[joint] else 'rad'}], got {float(rows[row, joint])!r}."
            )

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
        array = ending("q", q, self.joints)
        return array.reshape(-1, self.joints), array.shape[:-1]


def _unit_axes(name: str, value: npt.ArrayLike) -> FloatArray:
    """Axes of exactly unit length, read-only. Shape (n, 3)."""
    axes = float_array(name, value, (None, 3), at_most=LARGEST)
    lengths: FloatArray = np.linalg.norm(axes, axis=1)
    for i, length in enumerate(lengths):
        if abs(length - 1.0) > UNIT_TOLERANCE:
            got = "the zero vector" if length == 0.0 else f"{axes[i].tolist()} of length {length:.6g}"
            raise InvalidInputError(
                f"{name}: expected a unit vector for joint {i}, got {got}. Axes are not normalised silently, because a "
                "wrong length is usually a mistake; divide by the length if it is meant."
            )
    # A rounded unit vector divided by its length again may change in the last bit, and a copy must equal the arm.
    exact = np.abs(lengths - 1.0) <= ROUNDING
    return read_only(np.where(exact[:, None], axes, axes / lengths[:, None]))


def _truth_values(name: str, prismatic: Any, n: int) -> tuple[bool, ...]:
    """Which joints are prismatic, one entry a joint."""
    values = (tuple(prismatic) or (False,) * n) if isinstance(prismatic, Iterable) else ()
    if len(values) != n or not all(isinstance(value, (bool, np.bool_)) for value in values):
        raise InvalidInputError(f"{name}: expected {n} truth values, one a joint, got {shorten(prismatic)}.")
    return tuple(bool(value) for value in values)


def numbered_joints(n: int) -> tuple[str, ...]:
    """The default names of joints."""
    return tuple(f"joint_{i + 1}" for i in range(n))


def _joint_names(name: str, given: Any, n: int) -> tuple[str, ...]:
    """Names of the joints; none are given by an empty list."""
    return numbered_joints(n) if isinstance(given, (tuple, list)) and not given else different_texts(name, given, n)


def joint_limits(
    name: str, value: npt.ArrayLike | None, n: int, default: float = np.inf, *, positive: bool = False
) -> FloatArray:
    """Limits of the joints, which may be infinite, read-only. Shape (n,)."""
    if value is None:
        return read_only(np.full(n, default))
    try:
        raw = np.asarray(value)
        # NumPy would read strings as numbers.
        if raw.dtype.kind not in "fiu" or raw.shape != (n,) or np.isnan(raw).any():
            raise ValueError
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected {n} numbers, got {shorten(value)}.") from None
    if positive and (raw <= 0.0).any():
        raise InvalidInputError(f"{name}: expected numbers above 0, got {raw.tolist()}.")
    return read_only(raw.astype(np.float64))
