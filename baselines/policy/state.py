"""The state of `predict`: a flat tuple of arrays, (status, iterations, *memory), each with a leading axis of B.

Only this module needs to know the layout: :func:`pack` makes a state, `SolverPolicy.report` and
`SolverPolicy.memory_of` read it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy.problem import Memory, Solution
from ikgym.exceptions import InvalidInputError


class Report(NamedTuple):
    """What a solver says of its last step; read from the state by `SolverPolicy.report`."""

    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]


#: Shapes and types of the arrays of a memory, and that they are contiguous and can be written to.
Signature = list[tuple[tuple[int, ...], np.dtype[Any], bool]]

#: Arrays of a state in front of the memory.
REPORTED = len(Report._fields)


def pack(status: npt.NDArray[np.int64], iterations: npt.NDArray[np.int64], memory: Memory) -> Memory:
    """A state from its parts.

    Args:
        status: Values of :class:`baselines.status.Status`. Shape (B,).
        iterations: Iterations made. Shape (B,).
        memory: What the solver remembers, each array with a leading axis of B.
    """
    return status, iterations, *memory


def remembered(state: Memory) -> Memory:
    """The memory in a state, without its names; `SolverPolicy.memory_of` gives it with them."""
    return state[REPORTED:]


def signature(example: Memory, rows: int) -> Signature:
    """What the arrays of a memory of so many rows are to be.

    Args:
        example: The memory of one row.
        rows: B.
    """
    return [((rows, *array.shape[1:]), array.dtype, True) for array in example]


def checked_memory(name: str, state: object, expected: Signature, rows: int) -> Memory:
    """The memory in a state that a user hands in.

    Args:
        name: The policy's, for messages.
        state: What is to be a state.
        expected: See :func:`signature`.
        rows: B, of the observations that come with it.

    Returns:
        The memory; copies of arrays that kernels would have to be compiled anew for, such as read-only ones.

    Raises:
        InvalidInputError: It is no state of the policy, or belongs to another batch.
    """
    if isinstance(state, tuple) and len(state) >= REPORTED:
        memory = state[REPORTED:]
        try:
            if [(array.shape, array.dtype, array.flags.carray) for array in memory] == expected:
                return memory
            if [(array.shape, array.dtype, True) for array in memory] == expected:
                return tuple(array.copy() for array in memory)
        except AttributeError:  # no arrays
            pass
    raise _refused(name, state, expected, rows)


def _refused(name: str, state: object, expected: Signature, rows: int) -> InvalidInputError:
    """An error that says why a state is none."""
    given: object = type(state).__name__
    if isinstance(state, tuple):
        given = [getattr(part, "shape", type(part).__name__) for part in state]
        if len(given) >= REPORTED and given[REPORTED:] == [shape for shape, _, _ in expected]:
            # Right for Python, but the kernels would be compiled anew for it, for many seconds.
            dtypes = [str(getattr(part, "dtype", type(part).__name__)) for part in state[REPORTED:]]
            return InvalidInputError(
                f"state: expected arrays of {[str(dtype) for _, dtype, _ in expected]} behind status and iterations, "
                f"as {name}.predict returned, got {dtypes}."
            )
    return InvalidInputError(
        f"state: expected what {name}.predict returned for a batch of {rows}, got {str(given)[:200]}."
    )


def truth_values(episode_start: npt.ArrayLike, rows: int) -> npt.NDArray[np.bool_]:
    """Where an episode begins. Shape (B,) or ().

    Raises:
        InvalidInputError: There are not B truth values, nor one.
    """
    try:
        starting = np.asarray(episode_start)
    except ValueError:  # lists of different lengths
        starting = np.asarray(None)
    if starting.dtype.kind not in "biuf" or starting.shape not in {(), (rows,)}:
        got = " ".join(repr(episode_start).split())
        raise InvalidInputError(f"episode_start: expected {rows} truth values, got {got[:120]}.")
    return starting.astype(np.bool_)


def replace_rows(memory: Memory, fresh: Memory, rows: npt.NDArray[np.bool_]) -> Memory:
    """The memory, with some rows of another one.

    Args:
        memory: Each array with a leading axis of B.
        fresh: Arrays of the same shapes.
        rows: Which rows are those of `fresh`. Shape (B,).
    """
    return tuple(np.where(rows.reshape(-1, *[1] * (k.ndim - 1)), f, k) for k, f in zip(memory, fresh, strict=True))


def joined(parts: Sequence[Solution]) -> Solution:
    """The solutions of one batch's parts as one."""
    if len(parts) == 1:
        return parts[0]
    qdots, memories, status, iterations = zip(*parts, strict=True)
    memory = tuple(np.concatenate(arrays) for arrays in zip(*memories, strict=True))
    return Solution(np.concatenate(qdots), memory, np.concatenate(status), np.concatenate(iterations))
