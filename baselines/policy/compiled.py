"""Solvers whose step is one compiled kernel."""

from __future__ import annotations

import abc
import collections
import dataclasses
import functools
from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines.policy.arguments import Parts, not_finite
from baselines.policy.problem import surroundings_of
from baselines.policy.solver import SolverPolicy, compiled_classes
from baselines.policy_kernels import REFUSED, Batch, Memory, NoMemory, Solution, compile_step
from ikgym.exceptions import InvalidInputError
from ikgym.frozen import hints_of
from ikgym.kernels.outcome import OBSERVED
from ikgym.validation import FloatArray

#: The place of the obstacles in a :class:`Batch`.
OBSTACLES = Batch._fields.index("obstacles")

_DERIVED = "derived"
_PREFIX = "Fields__"


def derived() -> Any:
    """A field that ``__post_init__`` calculates from the parameters for the kernel: a number, an array or a tuple."""
    return dataclasses.field(init=False, repr=False, metadata={_DERIVED: True})


class CompiledPolicy(SolverPolicy, abc.ABC):
    """Base of solvers that are one kernel, ``step(model, numbers, batch, solution)``.

    The kernel is given the :class:`Model`, the policy's fields as a named tuple, see :meth:`numbers`, the observations
    as a :class:`Batch` without extras, and the :class:`Solution`, whose memory is the named tuple of :meth:`memory`. It
    fills in joint velocities, status and iterations, and turns the memory into the next one in place. Checks, batches,
    threads and the cut to the velocity limit are dealt with here.
    """

    sees_extras: ClassVar[bool] = False
    #: The kernel.
    step: ClassVar[Callable[..., None]]
    #: The kernel among bodies; None for a policy that is blind to them. Its numbers end with ``bodies`` and ``boxes``:
    #: see :func:`surroundings_of`; the latter has the shape (1, o, 16) or (B, o, 16).
    step_among: ClassVar[Callable[..., None] | None] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        self._settle(sees_extras=self.among_bodies and self.problem.obstacles_shown)

    @classmethod
    def kernel_fields(cls) -> tuple[str, ...]:
        """Fields that the kernel takes: those of the class that has it, so that subclasses share what is compiled."""
        return kernel_fields(next(kind for kind in cls.__mro__ if "step" in vars(kind)))

    def numbers(self) -> Any:
        """The policy's fields as the kernel takes them, a named tuple: those with a number, and derived ones.

        See :func:`derived`. Tuples among them are plain.
        """
        names, among = self.kernel_fields(), self.among_bodies
        values = [getattr(self, name) for name in names] + [*(surroundings_of(self.problem) if among else ())]
        plain = [tuple(value) if isinstance(value, tuple) else value for value in values]
        return named_tuple((*names, *(("bodies", "boxes") if among else ())))(*plain)

    @property
    def among_bodies(self) -> bool:
        """Whether there are bodies that the policy keeps clear of."""
        return type(self).step_among is not None and self.problem.surroundings is not None

    def memory(self, rows: int) -> Memory:
        """See :meth:`SolverPolicy.memory`; nothing."""
        del rows
        return NoMemory()

    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """See :meth:`SolverPolicy.solve`."""
        rows, n = batch.q.shape
        _, call, block, numbers, _ = self._kernel
        qdot, counts = np.empty(rows * n), np.empty((2, rows), np.int64)
        kept, parts = tuple([array.copy() for array in memory]), self._flat(batch)
        # :meth:`SolverPolicy.act` has put the last command there.
        command = batch.qdot if batch.change is None else np.concatenate([batch.qdot, batch.change], axis=1)
        last = (command,) if self.remembers_command else ()
        if self.sees_extras:
            parts, numbers = self._with_obstacles(parts, numbers)
        call(block, numbers, False, parts, (*kept, *last), qdot, counts)
        return Solution(qdot.reshape(rows, n), self._with_names(kept), *counts)

    def act(self, batch: Batch, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """See :meth:`SolverPolicy.act`; in one call of the kernel, unless threads share out the rows."""
        if not self._fits_one_call(len(batch.q)):
            return super().act(batch, memory)
        action, after = self._step(self._flat(batch), len(batch.q), memory, False)
        return action.reshape(batch.q.shape), after

    def _respond(self, parts: Parts, single: bool, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """See :meth:`SolverPolicy._respond`; in one call of the kernel, unless threads share out the rows."""
        if single:
            return self._step(parts, 1, memory, True)
        rows = len(parts[0])
        if not self._fits_one_call(rows):
            return super()._respond(parts, single, memory)
        action, after = self._step(self._flat(parts), rows, memory, True)
        return action.reshape(parts[0].shape), after

    def _step(self, parts: Parts, rows: int, memory: Memory, checking: bool) -> tuple[Any, Memory]:
        """Actions, flat, and the state for the next call."""
        call, _, block, numbers, n = self._kernel
        action, counts = np.empty(rows * n, np.float32), np.empty((2, rows), np.int64)
        kept: Memory = tuple([array.copy() for array in memory])
        if self.sees_extras:
            parts, numbers = self._with_obstacles(parts, numbers)
        code = call(block, numbers, checking, parts, kept, action, counts)
        if code:
            if code == REFUSED:
                raise not_finite()
            kept = self._without_lost(kept, action.reshape(rows, n))
        return action, (counts[0], counts[1], *kept)

    def _flat(self, parts: Parts) -> Parts:
        """The arrays of a batch as :func:`compile_step` takes them, and the obstacles where they are shown."""
        q, qdot, pose, nominal, remaining = parts[: len(OBSERVED)]
        ahead = nominal.reshape(-1, nominal.shape[2])
        flat = q.reshape(-1), qdot.reshape(-1), pose.reshape(-1), ahead, remaining.reshape(-1)
        return (*flat, parts[OBSTACLES]) if self.sees_extras else flat

    def _with_obstacles(self, parts: Parts, numbers: tuple[Any, ...]) -> tuple[Parts, tuple[Any, ...]]:
        """The five arrays of an observation, and the numbers with the obstacles that it shows."""
        shown, expected = parts[-1], numbers[-1].shape[1:]
        if shown is None or shown.shape[-2:] != expected:
            got = "none" if shown is None else shown.shape
            raise InvalidInputError(f"observation['obstacles']: {self.name} expects shape {expected}, got {got}.")
        return parts[: len(OBSERVED)], (*numbers[:-1], shown.reshape(-1, *expected))

    @functools.cached_property
    def _kernel(self) -> tuple[Any, Any, FloatArray, tuple[Any, ...], int]:
        """The compiled calls for actions and for joint velocities, their constant arguments, and how many joints."""
        n, m, numbers = self.problem.model.joints, self.problem.task.size, self.numbers()
        step = type(self).step_among if self.among_bodies else type(self).step
        tuples: Any = type(numbers), type(self._example)
        call, other = (_compile(step, *tuples, self.remembers_command, cuts) for cuts in (True, False))
        block, numbers = self.problem.kernel_block, tuple(numbers)
        if call not in compiled_classes:
            with self._first_call():
                compiled_classes.add(call)
                nothing = (*np.empty((3, 0)), np.empty((0, m)), np.empty(0))
                out = np.empty(0, np.float32), np.empty((2, 0), np.int64)
                call(block, numbers, False, nothing, tuple(self.initial_memory(0)), *out)
        return call, other, block, numbers, n


#: One compiled call for each kernel and the types of its arguments.
_compile = functools.cache(compile_step)


@functools.cache
def kernel_fields(policy: Any) -> tuple[str, ...]:
    """Names of the fields that a kernel takes: parameters of the type float, int or bool, and derived fields."""
    hints = hints_of(policy)
    numbers = {name for name, hint in hints.items() if getattr(hint, "__origin__", hint) in {float, int, bool}}
    fields = dataclasses.fields(policy)
    return tuple(f.name for f in fields if _DERIVED in f.metadata or (f.init and not f.kw_only and f.name in numbers))


@functools.cache
def named_tuple(names: tuple[str, ...]) -> type[Any]:
    """The named tuple with fields of these names.

    Its name consists of them, so that machine code on disk, which refers to it by name, belongs to these fields in this
    order, and every process finds it without the policies that use it.
    """
    name = _PREFIX + "__".join(names)
    kind: type[Any] = globals().setdefault(name, collections.namedtuple(name, names, module=__name__))
    return kind


def __getattr__(name: str) -> Any:
    if not name.startswith(_PREFIX):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return named_tuple(tuple(filter(None, name.removeprefix(_PREFIX).split("__"))))
