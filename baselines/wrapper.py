"""Policies around another policy: its memory, its counts and its diagnostics are handled here, once."""

from __future__ import annotations

import abc
import dataclasses
import functools
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from baselines import registry
from baselines.policy import Batch, Memory, Problem, Solution, SolverPolicy
from baselines.policy.arguments import pack, read_memory, replace_rows
from baselines.registry import PolicySpec, parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview
from ikgym.validation import FloatArray, known_names


@dataclasses.dataclass(frozen=True, eq=False)
class Wrapper(SolverPolicy, abc.ABC):
    """Base of all policies around another one.

    `solve` of a wrapper splits its memory, asks the inner policy, and returns the changed action:

        outer, inside = self.split(memory)
        step = self.ask(batch, inside)
        return self.solution(step.qdot, outer, step)

    The inner policy acts as if it were alone: values not finite or beyond the velocity limit are dealt with as in
    its `predict`. Its memory follows that of the wrapper.

    Args:
        problem: The scenario as the policy knows it.
    """

    #: The inner policy; None for an agent without a base policy.
    inner: SolverPolicy | None = dataclasses.field(init=False, repr=False)

    def own_memory(self, rows: int) -> Memory:
        """The wrapper's memory at the start of B episodes, preferably a NamedTuple; arrays of shape (B, …)."""
        del rows
        return ()

    def memory(self, rows: int) -> Memory:
        """The wrapper's memory, then that of the inner policy."""
        return *self.own_memory(rows), *(() if self.inner is None else self.inner.initial_memory(rows))

    def begin_episodes(self, memory: Memory, rows: npt.NDArray[np.bool_]) -> Memory:
        """See :meth:`SolverPolicy.begin_episodes`; the inner policy keeps its memory."""
        outer, inside = self.split(memory)
        fresh = () if self.inner is None else self.inner.begin_episodes(inside, rows)
        return *self.begin_own_episodes(outer, rows), *fresh

    def recall(self, memory: Memory, qdot: FloatArray, change: FloatArray | None = None) -> Memory:
        """See :meth:`SolverPolicy.recall`; the inner policy's command."""
        outer, inside = self.split(memory)
        return *outer, *(() if self.inner is None else self.inner.recall(inside, qdot, change))

    def begin_own_episodes(self, outer: Any, rows: npt.NDArray[np.bool_]) -> Memory:
        """The wrapper's memory, cleared where an episode begins."""
        return replace_rows(outer, self.own_memory(len(rows)), rows)

    def split(self, memory: Memory) -> tuple[Any, Memory]:
        """The wrapper's part of the memory, of the type of :meth:`own_memory`, and that of the inner policy."""
        size, kind = self._own
        outer = memory[:size]
        return outer if kind is tuple else kind._make(outer), memory[size:]

    @functools.cached_property
    def _own(self) -> tuple[int, Any]:
        """Number of arrays in the wrapper's memory, and its type."""
        outer = self.own_memory(1)
        return len(outer), type(outer)

    def ask(self, batch: Batch, memory: Memory) -> Solution:
        """The inner policy's step, see :meth:`SolverPolicy.act`, for its observations and its part of the memory."""
        assert self.inner is not None
        action, state = self.inner.act(batch, memory)
        return Solution(action * self.inner.problem.velocity_limit, read_memory(state), *self.inner.report(state))

    def solution(self, qdot: FloatArray, outer: Memory, step: Solution) -> Solution:
        """The result of `solve`: status and iterations are those of the inner policy.

        Args:
            qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
            outer: The wrapper's memory after the step.
            step: The inner policy's.
        """
        return Solution(qdot, (*outer, *step.memory), step.status, step.iterations)

    def inner_state(self, state: Memory) -> Memory:
        """The state of the inner policy, as its `predict` would have returned it, in that of the wrapper."""
        size, _ = self._own
        return pack(*self.report(state), read_memory(state)[size:])

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """Diagnostics of the inner policy."""
        return {} if self.inner is None else self.inner.diagnostics(self.inner_state(state))


@dataclasses.dataclass(frozen=True, eq=False)
class NamedWrapper(Wrapper, abc.ABC):
    """A wrapper of the policy that a parameter names.

    Args:
        problem: The scenario as the policy knows it.
        policy: The name of the inner policy.
        options: Its parameters; those left out have its defaults.

    Raises:
        UnknownNameError: There is no such policy, or parameter of it.
        InvalidInputError: The inner policy is a reference, or a wrapper where none is taken, or it refuses its
            parameters.
    """

    policy: str = "dls"
    options: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    inner: SolverPolicy = dataclasses.field(init=False, repr=False)

    #: Whether the inner policy may be a wrapper itself.
    nests: ClassVar[bool] = True

    def __post_init__(self) -> None:
        super().__post_init__()
        kind = registry.get(self.policy)
        wrapped = issubclass(kind, Wrapper) and not self.nests
        if kind.reference or wrapped:
            what = "reference" if kind.reference else "policy that is made from others"
            raise InvalidInputError(f"policy: expected one that acts on what it sees, got the {what} {kind.name!r}.")
        if not isinstance(self.options, Mapping):
            raise InvalidInputError(f"options: expected the parameters of {kind.name} by name, got {self.options!r}.")
        known_names(f"parameter of {kind.name}", self.options, kind.parameter_names())
        inner = kind(self.inner_problem(), **self.options)
        self._settle(inner=inner, options=inner.parameters)

    def inner_problem(self) -> Problem:
        """The scenario as the inner policy knows it."""
        return self.problem

    @property
    def preview(self) -> Preview:
        """That of the inner policy."""
        return self.inner.preview

    @property
    def commands(self) -> int:
        """See :attr:`SolverPolicy.commands`."""
        return self.inner.commands

    @property
    def free_timing(self) -> bool:
        """See :attr:`SolverPolicy.free_timing`."""
        return self.inner.free_timing


def policies_in(spec: PolicySpec) -> Iterator[type[SolverPolicy]]:
    """The classes of all policies that a spec names: the outermost, and those of inner policies.

    Args:
        spec: Such as ``"smoothed:policy=dls"``.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The text has another form.
    """
    name, parameters = parse_policy(spec)
    kind = registry.get(name)
    yield kind
    if issubclass(kind, NamedWrapper):
        options = parameters.get("options", {})
        yield from policies_in((parameters.get("policy", kind.policy), options if isinstance(options, Mapping) else {}))
