"""The state of `predict`: a flat tuple of arrays, (status, iterations, *memory), each with a leading axis of B.

Only this module needs to know the layout: :func:`pack` makes a state, `SolverPolicy.report` and
`SolverPolicy.memory_of` read it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy.problem import Memory, Solution


class Report(NamedTuple):
    """What a solver says of its last step; read from the state by `SolverPolicy.report`."""

    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]


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
