"""Input and output of the kernels of all solvers, and what they share, from the checks to the velocity limit."""

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
from ikgym.kernels.limits import CHANGE, ideal_velocity

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

_SATURATED, _DIVERGED = int(Status.SATURATED), int(Status.DIVERGED)

#: Result of a call for observations that are not finite; otherwise that of :func:`cut_rows`.
REFUSED = 2

# The rows of :attr:`Model.limits` behind those of an arm.
BRAKING, JERK = CHANGE + 1, CHANGE + 2
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


#: Arrays with a leading axis of B: the memory of a policy, or a whole state, see :mod:`baselines.policy.arguments`.
Memory = tuple[npt.NDArray[Any], ...]


class Model(NamedTuple):
    """The model of the arm, the task, the cost and the limits, as the kernels of all solvers see them.

    Attributes:
        chain: The model of the arm.
        kind: The kind of task coordinates, one of those of :mod:`ikgym.kernels.tasks`.
        cost: The parameters of the stage cost.
        dt: Δt in [s].
        velocity_limit: Joint velocity of an action of 1, in [rad/s] or [m/s]. Shape (n,).
        limits: Least and largest joint coordinates in [rad] or [m], then in [rad/s] or [m/s] the largest velocities,
            their largest changes in one step, those that braking may use, and by how much these may differ from step
            to step; infinite where there is no limit. The rows are LOWER, UPPER, FASTEST and CHANGE of
            :mod:`ikgym.kernels.limits`, BRAKING and JERK. Shape (6, n).
    """

    chain: Chain
    kind: int
    cost: CostParameters
    dt: float
    velocity_limit: Floats
    limits: Floats


class Batch(NamedTuple):
    """Observations of B arms, as float64.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]; where a policy remembers it, its last command, see
            :attr:`SolverPolicy.remembers_command`. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Nominal task coordinates ahead, X^N(k+1) first. Shape (B, p, m).
        remaining: Steps left. Shape (B, 1).
        q_age: How many steps ago q was measured; None where the observation does not say. Shape (B, 1).
        pose_age: How many steps ago the pose was measured; likewise. Shape (B, 1).
        commands: The last commands as joint velocities, newest first, in [rad/s] or [m/s]; None where they are not
            observed. Shape (B, h, n).
        obstacles: Obstacles as they will be after the coming step, see :class:`ikgym.kernels.bodies.Surroundings`;
            None where they are always the same. Shape (B, o, 16).
        change: By how much ``qdot`` differs from the velocities before, where a policy remembers it for limits of jerk.
            Shape (B, n).
    """

    q: Floats
    qdot: Floats
    pose: Floats
    nominal: Floats
    remaining: Floats
    q_age: Floats | None = None
    pose_age: Floats | None = None
    commands: Floats | None = None
    obstacles: Floats | None = None
    change: Floats | None = None


class Solution(NamedTuple):
    """The result of a solver, which a kernel writes in place.

    Attributes:
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        memory: Memory for the next step, each array with a leading axis of B.
        status: Values of :class:`Status`. Shape (B,).
        iterations: Iterations made. Shape (B,).
    """

    qdot: Floats
    memory: Memory
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
    limits, offsets = 8 + n, 8 + 7 * n
    axes, prismatic, tool, rotation = offsets + 3 * n, offsets + 6 * n, offsets + 7 * n, offsets + 7 * n + 3
    chain = Chain(
        block[offsets:axes].reshape(n, 3),
        block[axes:prismatic].reshape(n, 3),
        block[prismatic:tool] != 0.0,
        block[tool:rotation],
        block[rotation:].reshape(3, 3),
    )
    cost = CostParameters(block[3], block[4], block[5], block[6], block[7])
    return Model(chain, int(block[1]), cost, block[2], block[8:limits], block[limits:offsets].reshape(6, n))


def compile_step(step: Any, numbers: type, memory: type, remembers: bool, cuts: bool) -> Any:
    """The compiled call behind `predict` of a solver, around the kernel of its step.

    It puts the named tuples of the kernel together from plain tuples, which numba reads three times as fast, checks the
    observations, and cuts the joint velocities to the velocity limit.

    Args:
        step: The kernel, ``step(model, numbers, batch, solution)``, see :class:`CompiledPolicy`.
        numbers: The named tuple of its parameters.
        memory: The named tuple of its memory.
        remembers: Whether the memory ends with the last commands, and they are the ``qdot`` that the kernel sees.
        cuts: Whether joint velocities are turned into actions.

    Returns:
        ``call(block, numbers, checking, observation, memory, out, counts)`` with plain tuples and flat arrays for any
        number of rows; the reference coordinates have the shape (B p, m), and ``counts``, which receives status and
        iterations, the shape (2, B). The memory becomes the next one in place, and ``out`` receives actions, or joint
        velocities. The call returns REFUSED for observations that are not finite, else the result of :func:`cut_rows`.
    """
    python = getattr(step, "py_func", step)
    scope = {**globals(), "step": step, "NumbersTuple": numbers, "MemoryTuple": memory}
    scope |= {"remembers": remembers, "cuts": cuts}
    call = types.FunctionType(_call.__code__, scope, f"{python.__name__}_call")
    name = f"{python.__name__}_{zlib.crc32(numbers.__name__.encode()):08x}_{memory.__name__}"
    call.__module__, call.__qualname__ = python.__module__, name + "_remembers" * remembers + "_cuts" * cuts
    return kernel(call)


def _call(block: Any, numbers: Any, checking: Any, observation: Any, memory: Any, out: Any, counts: Any) -> Any:
    """See :func:`compile_step`: each solver has a copy with its ``step``, ``NumbersTuple`` and ``MemoryTuple``."""
    q, qdot, pose, nominal, remaining = observation
    if checking and not all_finite(q, qdot, pose, nominal, remaining):
        return REFUSED
    model, n, m = model_of(block), int(block[0]), nominal.shape[1]
    rows = q.shape[0] // n
    applied = qdot.reshape(rows, n)
    change = applied
    if remembers:  # type: ignore[name-defined]  # noqa: F821
        last, memory = memory[-1], memory[:-1]
        begin_rows(last, applied)
        applied = change = last
        if last.shape[1] > n:
            applied, change = last[:, :n].copy(), last[:, n:].copy()
    qdot = np.empty(rows * n) if cuts else out  # type: ignore[name-defined]  # noqa: F821
    ahead = nominal.reshape(rows, nominal.shape[0] // max(rows, 1), m)
    seen = q.reshape(rows, n), applied, pose.reshape(rows, m), ahead, remaining.reshape(rows, 1)
    batch = Batch(*seen, None, None, None, None, change)
    solution = Solution(qdot.reshape(rows, n), MemoryTuple(*memory), counts[0], counts[1])  # type: ignore[name-defined]  # noqa: F821
    step(model, NumbersTuple(*numbers), batch, solution)  # type: ignore[name-defined]  # noqa: F821
    if not cuts:  # type: ignore[name-defined]  # noqa: F821
        return False
    action = out.reshape(rows, n)
    result = cut_rows(solution.qdot, model.velocity_limit, action, solution.status)
    if remembers:  # type: ignore[name-defined]  # noqa: F821
        sent_rows(model, batch.q, action, last)
    return result


@kernel
def begin_rows(last, qdot):
    """Fills in remembered commands where an episode begins, and they are NaN: the observed velocity, and no change.

    Args:
        last: The commands in [rad/s] or [m/s], and then by how much they changed, where that is remembered. Shape
            (B, n) or (B, 2 n).
        qdot: Observed joint velocities in [rad/s] or [m/s]. Shape (B, n).
    """
    n = qdot.shape[1]
    for row in range(last.shape[0]):
        for j in range(last.shape[1]):
            if math.isnan(last[row, j]):
                last[row, j] = qdot[row, j] if j < n else 0.0


@kernel
def sent_rows(model, q, action, last):
    """Calculates the joint velocities of an ideal arm within its limits from actions, row by row.

    Args:
        model: The :class:`Model`.
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        action: Shape (B, n).
        last: Velocities of the step before in [rad/s] or [m/s], and their changes where these are remembered; becomes
            those of this one. Shape (B, n) or (B, 2 n).
    """
    limits, limit, dt, n = model.limits, model.velocity_limit, model.dt, q.shape[1]
    for row in range(q.shape[0]):
        for j in range(n):
            before = last[row, j]
            last[row, j] = ideal_velocity(limits, j, q[row, j], action[row, j] * limit[j], before, dt)
            if last.shape[1] > n:
                last[row, n + j] = last[row, j] - before


@kernel
def cut_rows(qdot, limit, action, status):
    """Turns joint velocities into fractions of their limit, within the box, row by row.

    Args:
        qdot: In [rad/s] or [m/s]. Shape (B, n).
        limit: In [rad/s] or [m/s]. Shape (n,).
        action: Receives the actions; NaN in rows with a number that is not finite. Shape (B, n).
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
                action[row, j] = math.nan
        elif saturated:
            status[row] = max(status[row], _SATURATED)
    return any_lost
