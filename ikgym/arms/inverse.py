"""Inverse kinematics of poses: checks of the input, and the call of the compiled search.

Arms are typed `Any` here, since :mod:`ikgym.arms.arm` imports this module.
"""

from __future__ import annotations

import functools
import math
from contextlib import nullcontext
from typing import Any

import numpy as np
import numpy.typing as npt

from ikgym.exceptions import InvalidInputError
from ikgym.kernels.inverse_kinematics import Ranges, Settings, inverse_rows
from ikgym.kernels.jit import announce
from ikgym.kernels.kinematics import Chain, add_arm_axis, forward_rows
from ikgym.kernels.threads import in_chunks
from ikgym.validation import BoolArray, FloatArray, ending, number, rotation_matrices, whole_number

# 1 rad weighs as much as this share of the arm's length; shares from 0.1 to 0.8 differ by less than a fifth.
LENGTH_OF_RADIAN = 0.25
# Poses that are worth a thread.
GRAIN = 64
# Settings for a posture of a similar arm next to a known one, and the decimals that are kept.
NEARBY, DECIMALS = Settings(1e-12, 1.0, 0, np.uint64(0)), 10


def inverse(
    arm: Any,
    rotation: npt.ArrayLike | None,
    position: npt.ArrayLike,
    start: npt.ArrayLike | None,
    *,
    tolerance: float,
    restarts: int,
    seed: int,
) -> tuple[FloatArray, BoolArray]:
    """See :meth:`ikgym.arms.Arm.inverse`."""
    ranges, length, starts = _search(arm)
    settings = Settings(
        number("tolerance", tolerance, above=0.0),
        length,
        whole_number("restarts", restarts, at_least=0),
        np.uint64(whole_number("seed", seed, at_least=0) % 2**64),
    )
    positions = ending("position", position, 3)
    rotations = np.empty((0, 0)) if rotation is None else rotation_matrices("rotation", rotation)
    if start is not None:
        starts = ending("start", start, arm.joints)
        arm.check_posture("start", starts)
    lead = _lead(rotations.shape, positions.shape, starts.shape)
    targets = _rows(rotations, lead, 2), _rows(positions, lead, 1), _rows(starts, lead, 1)
    constants = *add_arm_axis(arm.chain), *ranges, *settings
    q, converged = np.empty((len(targets[1]), arm.joints)), np.empty(len(targets[1]), dtype=np.bool_)

    def work(first: int, last: int) -> None:
        inverse_rows(*constants, *(array[first:last] for array in (*targets, q, converged)))

    # A look takes less time than a timer that is never needed.
    with nullcontext() if getattr(inverse_rows, "overloads", True) else announce("the inverse kinematics"):
        in_chunks(work, len(q), GRAIN)
    return q.reshape(*lead, arm.joints), converged.reshape(lead)[()]


def alike(arm: Any, chains: Chain, q: FloatArray, *, oriented: bool) -> FloatArray:
    """Joint coordinates that give other arms the poses of an arm, the nearest within its limits.

    The other arms are nearly the same: k of them, or one for all, by the leading axis of the chains. Results, of shape
    (k, n) as the postures within the limits, are without the last bits in which processors differ.
    """
    ranges, length, _ = _search(arm)
    q, rotations, positions = np.array(q), np.empty((len(q), 3, 3)), np.empty((len(q), 3))
    forward_rows(arm.chain, q, rotations, positions)
    if not oriented:
        rotations = np.empty((len(q), 0, 0))
    out, converged = np.empty(q.shape), np.empty(len(q), dtype=np.bool_)
    settings = NEARBY._replace(length=length)
    inverse_rows(*map(_lock, chains), *ranges, *settings, rotations, positions, q, out, converged)
    return out.round(DECIMALS).clip(arm.lower, arm.upper)


def _lock(array: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A view that is read-only, as arrays of arms are: kernels would compile anew for another one."""
    view = array.view()
    view.flags.writeable = False
    return view


@functools.lru_cache(maxsize=64)
def _search(arm: Any) -> tuple[Ranges, float, FloatArray]:
    """Ranges of the restarts, a full turn without limits; the length that weighs as 1 rad does, in [m]; the start."""
    size = arm.reach(np.zeros(arm.joints)) or 1.0  # an arm of slides alone may have no length at q = 0
    span = np.where(arm.prismatic, 2.0 * size, 2.0 * np.pi)
    finite_lower, finite_upper = np.isfinite(arm.lower), np.isfinite(arm.upper)
    first = np.where(finite_lower, arm.lower, np.where(finite_upper, arm.upper - span, -0.5 * span))
    last = np.where(finite_upper, arm.upper, first + span)
    start = 0.5 * (first + last) if arm.home is None else arm.home
    return Ranges(arm.lower, arm.upper, first, last), LENGTH_OF_RADIAN * size, start


def _lead(rotation: tuple[int, ...], position: tuple[int, ...], start: tuple[int, ...]) -> tuple[int, ...]:
    """The shape of a batch of poses, from the shapes of its parts."""
    try:
        return np.broadcast_shapes(rotation[:-2], position[:-1], start[:-1])
    except ValueError:
        raise InvalidInputError(
            f"rotation, position and start: expected shapes (..., 3, 3), (..., 3) and (..., {start[-1]}) whose leading "
            f"parts fit together, got {rotation if any(rotation) else None}, {position} and {start}."
        ) from None


def _rows(array: FloatArray, lead: tuple[int, ...], axes: int) -> FloatArray:
    """The array repeated for all poses, one row a pose; never read-only, since kernels would compile anew for that."""
    shape = (*lead, *array.shape[array.ndim - axes :])
    if array.shape != shape or not array.flags.writeable:
        array = np.array(np.broadcast_to(array, shape), order="C")
    return array.reshape(math.prod(lead), *shape[len(lead) :])
