"""Arms from Denavit–Hartenberg tables, standard and modified."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.arms.arm import Arm
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray, about, float_array, known_name

CONVENTIONS = ("standard", "modified")


def from_dh(
    name: str,
    a: npt.ArrayLike,
    d: npt.ArrayLike,
    alpha: npt.ArrayLike,
    theta: npt.ArrayLike | None = None,
    *,
    prismatic: Sequence[bool] = (),
    convention: str = "standard",
    **fields: Any,
) -> Arm:
    """An arm from its Denavit–Hartenberg table.

    A joint coordinate is added to ``theta`` of a revolute and to ``d`` of a prismatic joint.

    Args:
        name: Name of the arm.
        a: Link lengths in [m]. Shape (n,).
        d: Link offsets in [m]. Shape (n,).
        alpha: Link twists in [rad]. Shape (n,).
        theta: Joint angles at q = 0 in [rad], zeros if left out. Shape (n,).
        prismatic: True where a joint is prismatic, one entry a joint. All are revolute if it is left out.
        convention: ``"standard"``: H_i = Rot_z(θ_i) Trans_z(d_i) Trans_x(a_i) Rot_x(α_i). ``"modified"``
            (Craig): H_i = Rot_x(α_i) Trans_x(a_i) Rot_z(θ_i) Trans_z(d_i), where row i holds what Craig writes
            as a_{i-1} and α_{i-1}.
        fields: Other fields of :class:`ikgym.Arm`, such as ``lower``, ``upper``, ``velocity_limit`` and ``home``.

    Returns:
        The arm, in the one form that all arms have.

    Raises:
        InvalidInputError: The columns differ in length, a number is not finite, or another field is refused.
        UnknownNameError: There is no such convention.
    """
    known_name("Denavit–Hartenberg convention", convention, CONVENTIONS)
    with about(f"Denavit–Hartenberg table of arm {name!r}"):
        a = float_array("a", a, (None,))
        n = len(a)
        d, alpha = float_array("d", d, (n,)), float_array("alpha", alpha, (n,))
        theta = np.zeros(n) if theta is None else float_array("theta", theta, (n,))
        if n == 0:
            raise InvalidInputError("expected at least one row, got none.")

    frame = np.eye(4)
    axes, points = np.empty((n, 3)), np.empty((n, 3))
    for i in range(n):
        turn = _screw_z(theta[i], d[i])
        link = _screw_x(alpha[i], a[i])
        if convention == "modified":
            frame = frame @ link
        # The joint turns about, or moves along, the z axis of the frame in front of its screw.
        axes[i], points[i] = frame[:3, 2], frame[:3, 3]
        frame = frame @ turn
        if convention == "standard":
            frame = frame @ link
    return Arm(
        name,
        np.diff(points, axis=0, prepend=np.zeros((1, 3))),  # all link frames are parallel to the base at q = 0
        axes,
        prismatic,
        tool=frame[:3, 3] - points[-1],
        tool_rotation=frame[:3, :3],
        **fields,
    )


def _screw_z(angle: float, shift: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, shift], [0, 0, 0, 1]])


def _screw_x(angle: float, shift: float) -> FloatArray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1, 0, 0, shift], [0, c, -s, 0], [0, s, c, 0], [0, 0, 0, 1]])
