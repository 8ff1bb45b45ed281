"""Solvers whose whole step is one compiled call: check, solution, cut to the velocity limit, and the next memory.

Of the 23 µs that `predict` of `dls` took in an episode the solution took 2; the rest were checks, small arrays, and
calls between the parts.
"""

from __future__ import annotations

import abc
import functools
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy.observations import Parts, not_finite
from baselines.policy.problem import Batch, Memory, Solution
from baselines.policy.solver import SolverPolicy
from baselines.policy_kernels import REFUSED, parts_of
from ikgym.outcome import OBSERVED


class CompiledPolicy(SolverPolicy, abc.ABC):
    """Base of solvers that are one kernel, called with flat arguments, which numba takes apart the fastest.

        kernel(*constants, checking, q, qdot, pose, nominal, remaining, *memory, action, answer)

    The observations and the actions are flat, whatever the number of rows, but for the nominal coordinates of shape
    (B p, m): :func:`as_rows` gives them their shapes. ``answer`` is one block, for :func:`answer_parts`. The kernel
    begins with ``if checking and not all_finite(…): return REFUSED``, turns the memory into the next one in place, and
    ends with ``return cut_rows(…)``. It does not change the observations.
    """

    sees_extras: ClassVar[bool] = False

    @abc.abstractmethod
    def kernel(self) -> Any:
        """The kernel, see the class."""

    @abc.abstractmethod
    def constants(self) -> tuple[Any, ...]:
        """The arguments of the kernel that never change: numbers and arrays."""

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        rows, n = batch.q.shape
        kernel, constants = self._call
        action, answer, kept = _blank(rows, n, memory)
        kernel(*constants, False, *_flat(batch), *kept, action, answer)
        qdot, status, iterations = parts_of(answer, rows, n)
        return Solution(qdot, self._named(tuple(kept)), status, iterations)

    def act(self, batch: Batch, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """See :meth:`SolverPolicy.act`; in one call of the kernel, unless threads share out the rows."""
        rows = len(batch.q)
        if not self._undivided(rows):
            return super().act(batch, memory)
        action, after = self._ask(_flat(batch), rows, memory, False)
        return action.reshape(batch.q.shape), after

    def _answer(self, parts: Parts, single: bool, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """See :meth:`SolverPolicy._answer`; in one call of the kernel, unless threads share out the rows."""
        rows = 1 if single else len(parts[0])
        if not self._undivided(rows):
            return super()._answer(parts, single, memory)
        if single:
            return self._ask(parts, 1, memory, True)
        action, after = self._ask(_flat(parts), rows, memory, True)
        return action.reshape(parts[0].shape), after

    def _ask(self, parts: Parts, rows: int, memory: Memory, checking: bool) -> tuple[Any, Memory]:
        """Calls the kernel: actions, flat, and the state for the next call."""
        kernel, constants = self._call
        n = self.problem.model.joints
        action, answer, kept = _blank(rows, n, memory)
        code = kernel(*constants, checking, *parts, *kept, action, answer)
        if code:
            if code == REFUSED:
                raise not_finite()
            kept = self._without_lost(kept, parts_of(answer, rows, n)[0])
        return action, (answer[:rows], answer[rows : 2 * rows], *kept)

    @functools.cached_property
    def _call(self) -> tuple[Any, tuple[Any, ...]]:
        """The kernel, and what it is called with at each step."""
        return self.kernel(), self.constants()


def _blank(rows: int, n: int, memory: Memory) -> tuple[Any, Any, Any]:
    """Flat actions and the answer, to be written, and a memory to be changed."""
    return np.empty(rows * n, np.float32), np.empty(rows * (n + 2), np.int64), [array.copy() for array in memory]


def _flat(parts: Parts) -> Parts:
    """The arrays of a batch as kernels take them."""
    q, qdot, pose, nominal, remaining = parts[: len(OBSERVED)]
    return (
        q.reshape(-1),
        qdot.reshape(-1),
        pose.reshape(-1),
        nominal.reshape(-1, nominal.shape[2]),
        remaining.reshape(-1),
    )
