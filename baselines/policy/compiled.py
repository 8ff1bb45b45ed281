"""Solvers whose step is one compiled kernel."""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy.arguments import Parts, not_finite
from baselines.policy.problem import Batch, Memory, Problem, Solution
from baselines.policy.solver import SolverPolicy, compiled_classes
from baselines.policy_kernels import REFUSED, NoMemory, entry, model_block, parts_of
from ikgym.kernels.outcome import OBSERVED
from ikgym.validation import FloatArray


class CompiledPolicy(SolverPolicy, abc.ABC):
    """Base of solvers that are one kernel, ``step(model, numbers, seen, memory, answer)``.

    The kernel is given the :class:`Model`, the named tuple of :meth:`numbers`, the observations as :class:`Seen`, and
    the memory as the named tuple of :meth:`memory`; it turns the memory into the next one in place and fills in the
    :class:`Answer`. Checks, batches, threads and the cut to the velocity limit are dealt with here.
    """

    sees_extras: ClassVar[bool] = False
    #: The kernel.
    step: ClassVar[Callable[..., None]]

    @abc.abstractmethod
    def numbers(self) -> NamedTuple:
        """The parameters as the kernel takes them: a named tuple of numbers and arrays."""

    def memory(self, rows: int) -> Memory:
        """See :meth:`SolverPolicy.memory`; nothing."""
        del rows
        return NoMemory()

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        rows, n = batch.q.shape
        call, block, numbers, _ = self._kernel
        answer, kept = np.empty(rows * (n + 2), np.int64), tuple([array.copy() for array in memory])
        call(block, numbers, False, _flat(batch), kept, np.empty(0, np.float32), answer)  # nothing is cut here
        qdot, status, iterations = parts_of(answer, rows, n)
        return Solution(qdot, self._named(kept), status, iterations)

    def act(self, batch: Batch, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """See :meth:`SolverPolicy.act`; in one call of the kernel, unless threads share out the rows."""
        if not self._undivided(len(batch.q)):
            return super().act(batch, memory)
        action, after = self._step(_flat(batch), len(batch.q), memory, False)
        return action.reshape(batch.q.shape), after

    def _answer(self, parts: Parts, single: bool, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """See :meth:`SolverPolicy._answer`; in one call of the kernel, unless threads share out the rows."""
        if single:
            return self._step(parts, 1, memory, True)
        rows = len(parts[0])
        if not self._undivided(rows):
            return super()._answer(parts, single, memory)
        action, after = self._step(_flat(parts), rows, memory, True)
        return action.reshape(parts[0].shape), after

    def _step(self, parts: Parts, rows: int, memory: Memory, checking: bool) -> tuple[Any, Memory]:
        """Actions, flat, and the state for the next call."""
        action, answer, kept, code = self._call(parts, rows, memory, checking)
        if code:
            if code == REFUSED:
                raise not_finite()
            kept = self._without_lost(kept, parts_of(answer, rows, self.problem.model.joints)[0])
        return action, (answer[:rows], answer[rows : 2 * rows], *kept)

    def _call(self, parts: Parts, rows: int, memory: Memory, checking: bool) -> tuple[Any, Any, Memory, int]:
        """Calls the kernel: actions, flat, the block of the answer, the next memory, and what the call returns."""
        call, block, numbers, n = self._kernel
        action, answer = np.empty(rows * n, np.float32), np.empty(rows * (n + 2), np.int64)
        kept = tuple([array.copy() for array in memory])
        return action, answer, kept, call(block, numbers, checking, parts, kept, action, answer)

    @functools.cached_property
    def _kernel(self) -> tuple[Any, FloatArray, tuple[Any, ...], int]:
        """The compiled call, its arguments that never change, and the number of joints."""
        numbers, n, m = self.numbers(), self.problem.model.joints, self.problem.task.size
        call = _entry(type(self).step, type(numbers), type(self._example))
        if type(self) not in compiled_classes:
            with self._first_call():
                self.__dict__["_kernel"] = call, _block(self.problem), tuple(numbers), n
                self._call((*np.empty((3, 0)), np.empty((0, m)), np.empty(0)), 0, tuple(self.memory(0)), False)
        return call, _block(self.problem), tuple(numbers), n


#: One compiled call for each kernel and the types of its arguments.
_entry = functools.cache(entry)


@functools.lru_cache(64)  # problems are frozen, and shared by many policies
def _block(problem: Problem) -> FloatArray:
    model = problem.model
    limits = problem.velocity_limit, model.lower, model.upper, problem.largest_qdot
    return model_block(model.chain, problem.task.kind, problem.dt, *limits)


def _flat(parts: Parts) -> Parts:
    """The arrays of a batch as :func:`entry` takes them."""
    q, qdot, pose, nominal, remaining = parts[: len(OBSERVED)]
    return (
        q.reshape(-1),
        qdot.reshape(-1),
        pose.reshape(-1),
        nominal.reshape(-1, nominal.shape[2]),
        remaining.reshape(-1),
    )
