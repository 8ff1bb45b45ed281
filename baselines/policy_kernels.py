"""Kernels shared by all policies, from the observation to the cut at the velocity limit."""

from __future__ import annotations

import math
import types
import zlib
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.status import Status
from ikgym.kernels.cost import CostParameters
from ikgym.kernels.jit import kernel
from ikgym.kernels.kinematics import Chain
from ikgym.kernels.limits import CHANGE, ideal

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_SATURATED, _DIVERGED = int(Status.SATURATED), int(Status.DIVERGED)

#: Result of a step's kernel for observations that are not finite; otherwise that of :func:`cut_rows`.
REFUSED = 2

# The row of :attr:`Model.limits` behind those of an arm.
BRAKING = CHANGE + 1
# The bits of the exponent: all of them are set in infinities and in NaN, and nowhere else.
_EXPONENT = 0x7FF0000000000000


@kernel
def all_finite(q, qdot, pose, nominal, remaining):
    """Whether all numbers of a batch are finite, without the temporary arrays that NumPy makes.

    A long horizon is compared as integers, several at a time: 1,500 steps take 1.6 µs, as floats one by one 6.
    """
    for array in (q.ravel(), qdot.ravel(), pose.ravel(), remaining.ravel()):
        for value in array:
            if not np.isfinite(value):
                return False
    bits, largest = nominal.ravel().view(np.int64), 0
    for i in range(bits.shape[0]):
        largest = max(largest, bits[i] & _EXPONENT)
    return largest != _EXPONENT


class Model(NamedTuple):
    """The model of the arm, the task, the cost and the limits, as the kernels of all solvers see them.

    Attributes:
        chain: The model of the arm.
        kind: The kind of task coordinates, one of those of :mod:`ikgym.kernels.tasks`.
        cost: The parameters of the stage cost.
        dt: Δt in [s].
        velocity_limit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        limits: Least and largest joint coordinates in [rad] or [m], then in [rad/s] or [m/s] the largest velocities,
            their largest changes in one step, and those that braking may use; infinite where there is no limit. The
            rows are LOWER, UPPER, FASTEST and CHANGE of :mod:`ikgym.kernels.limits`, and BRAKING. Shape (5, n).
    """

    chain: Chain
    kind: int
    cost: CostParameters
    dt: float
    velocity_limit: Floats
    limits: Floats


class Seen(NamedTuple):
    """Observations of B arms as the kernels of solvers see them.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Reference task coordinates ahead. Shape (B, p, m).
        remaining: Steps left. Shape (B,).
    """

    q: Floats
    qdot: Floats
    pose: Floats
    nominal: Floats
    remaining: Floats


class Answer(NamedTuple):
    """Receives the result of a step.

    Attributes:
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        status: Values of :class:`Status`. Shape (B,).
        iterations: Iterations made. Shape (B,).
    """

    qdot: Floats
    status: Ints
    iterations: Ints


class NoMemory(NamedTuple):
    """The memory of a solver without one."""


def model_block(model: Model) -> Floats:
    """A :class:`Model` as one read-only block of numbers, since each array costs a call from Python 0.15 µs."""
    head = [len(model.velocity_limit), model.kind, model.dt, *model.cost]
    block = np.concatenate([head, model.velocity_limit, model.limits.ravel(), *map(np.ravel, model.chain)])
    block.flags.writeable = False
    return block


@kernel
def model_of(block):
    """The :class:`Model` in a block from :func:`model_block`."""
    n = int(block[0])
    limits, offsets = 8 + n, 8 + 6 * n
    axes, prismatic, tool, rotation = offsets + 3 * n, offsets + 6 * n, offsets + 7 * n, offsets + 7 * n + 3
    chain = Chain(
        block[offsets:axes].reshape(n, 3),
        block[axes:prismatic].reshape(n, 3),
        block[prismatic:tool] != 0.0,
        block[tool:rotation],
        block[rotation:].reshape(3, 3),
    )
    cost = CostParameters(block[3], block[4], block[5], block[6], block[7])
    return Model(chain, int(block[1]), cost, block[2], block[8:limits], block[limits:offsets].reshape(5, n))


def parts_of(answer: Any, rows: int, n: int) -> tuple[Any, Any, Any]:
    """Views of the block of an answer: joint velocities (B, n), status and iterations (B,)."""
    return answer[2 * rows :].view(np.float64).reshape(rows, n), answer[:rows], answer[rows : 2 * rows]


_parts_of = kernel(parts_of)


def entry(step: Any, numbers: type, memory: type, remembers: bool) -> Any:
    """The compiled call behind `predict` of a solver, around the kernel of its step.

    It takes the named tuples of the kernel apart, which numba reads three times as fast as plain tuples, checks the
    observations, and cuts the joint velocities to the velocity limit.

    Args:
        step: The kernel, ``step(model, numbers, seen, memory, answer)``, see :class:`CompiledPolicy`.
        numbers: The named tuple of its parameters.
        memory: The named tuple of its memory.
        remembers: Whether the last commands stand behind the memory, and are the ``qdot`` that the kernel sees.

    Returns:
        ``call(block, numbers, checking, seen, memory, action, answer)`` with plain tuples and flat arrays, whatever the
        number of rows, but for the reference coordinates of shape (B p, m). The memory becomes the next one in place.
        It returns REFUSED for observations that are not finite, else the status of :func:`cut_rows`; with an ``action``
        of no elements nothing is cut.
    """
    python = getattr(step, "py_func", step)
    scope = {**globals(), "step": step, "Numbers": numbers, "Memory": memory, "remembers": remembers}
    call = types.FunctionType(_call.__code__, scope, f"{python.__name__}_call")
    name = f"{python.__name__}_{zlib.crc32(numbers.__name__.encode()):08x}_{memory.__name__}"
    call.__module__, call.__qualname__ = python.__module__, f"{name}_remembering" if remembers else name
    return kernel(call)


def _call(block: Any, numbers: Any, checking: Any, seen: Any, memory: Any, action: Any, answer: Any) -> Any:
    """See :func:`entry`, which gives each solver a copy with its own ``step``, ``Numbers`` and ``Memory``."""
    q, qdot, pose, nominal, remaining = seen
    if checking and not all_finite(q, qdot, pose, nominal, remaining):
        return REFUSED
    model, n, m = model_of(block), int(block[0]), nominal.shape[1]
    rows = q.shape[0] // n
    if remembers:  # type: ignore[name-defined]  # noqa: F821
        last = memory[-1].reshape(-1)
        for i in range(last.shape[0]):
            if math.isnan(last[i]):
                last[i] = qdot[i]
        qdot, memory = last, memory[:-1]
    ahead = nominal.reshape(rows, nominal.shape[0] // max(rows, 1), m)
    shown = Seen(q.reshape(rows, n), qdot.reshape(rows, n), pose.reshape(rows, m), ahead, remaining)
    out = Answer(*_parts_of(answer, rows, n))
    step(model, Numbers(*numbers), shown, Memory(*memory), out)  # type: ignore[name-defined]  # noqa: F821
    if action.shape[0] == 0:
        return False
    result = cut_rows(out.qdot, model.velocity_limit, action.reshape(rows, n), out.status)
    if remembers:  # type: ignore[name-defined]  # noqa: F821
        sent_rows(model, shown.q, action.reshape(rows, n), shown.qdot)
    return result


@kernel
def sent_rows(model, q, action, last):
    """The joint velocities that an ideal arm within the limits makes of actions, row by row.

    Args:
        model: The :class:`Model`.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        action: Shape (B, n).
        last: Velocities of the step before in [rad/s] or [m/s]; becomes those of this one. Shape (B, n).
    """
    limits, limit, dt = model.limits, model.velocity_limit, model.dt
    for row in range(q.shape[0]):
        for j in range(q.shape[1]):
            last[row, j] = ideal(limits, j, q[row, j], action[row, j] * limit[j], last[row, j], dt)


@kernel
def cut_rows(qdot, limit, action, status):
    """Joint velocities as fractions of their limit, within the box, row by row.

    Args:
        qdot: In [rad/s] or [m/s]. Shape (B, n).
        limit: In [rad/s] or [m/s]. Shape (n,).
        action: Receives the actions; zeros where a number is not finite. Shape (B, n).
        status: Raised to the status of the row. Shape (B,).

    Returns:
        Whether a number of any row is not finite.
    """
    any_lost = False
    for row in range(qdot.shape[0]):
        lost, saturated = False, False
        for j in range(qdot.shape[1]):
            fraction = qdot[row, j] / limit[j]
            if not np.isfinite(fraction):
                lost = True
            elif abs(fraction) > 1.0:
                saturated = True
                fraction = math.copysign(1.0, fraction)
            action[row, j] = fraction
        if lost:
            any_lost = True
            status[row] = _DIVERGED
            for j in range(qdot.shape[1]):
                action[row, j] = 0.0
        elif saturated:
            status[row] = max(status[row], _SATURATED)
    return any_lost
