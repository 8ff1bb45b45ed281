"""A solver as a policy: the signature of Stable-Baselines3's `predict`, and memory that travels through `state`."""

from __future__ import annotations

import abc
import contextlib
import dataclasses
import functools
import threading
from collections.abc import Callable, Iterator
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from baselines.policy.arguments import (
    REPORTED,
    ObservationReader,
    Parts,
    Report,
    Signature,
    as_batch,
    check_state,
    describe_arrays,
    not_finite,
    pack,
    read_flags,
    read_memory,
    replace_rows,
    take_rows,
)
from baselines.policy.problem import Problem
from baselines.policy_kernels import Batch, Memory, Solution, all_finite, begin_rows, cut_rows, sent_rows
from ikgym.frozen import Frozen
from ikgym.kernels.jit import announce
from ikgym.kernels.outcome import OBSERVED
from ikgym.kernels.threads import in_chunks
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import Observation
from ikgym.validation import FloatArray

#: Policies that have solved something in this process, and calls of kernels that have been made: they are compiled.
compiled_classes: set[Any] = set()

#: Which threads work on a share of a batch. Calls within them are not shared out further: threads of one pool that
#: wait for others of it wait forever.
_sharing = threading.local()


@dataclasses.dataclass(frozen=True, eq=False)
class SolverPolicy(Frozen, abc.ABC):
    """Base of all solvers: turns `solve` on a batch into Stable-Baselines3's `predict`.

    A policy is a frozen dataclass: its fields behind ``problem`` are its parameters, checked by their annotations, see
    :class:`Frozen`, and whatever changes from step to step travels through ``state``. It never touches an environment.

    Args:
        problem: The scenario as the policy knows it.
    """

    problem: Problem

    #: Name of the policy in messages; that of the class by default. Results have the name in the registry.
    name: ClassVar[str]
    #: Whether the policy knows more than its observation: a reference, not a contender.
    reference: ClassVar[bool] = False
    #: Whether it is a solver of another project, whose package is installed with the extra `rivals`.
    rival: ClassVar[bool] = False
    #: Whether it is shown the ages of measurements, past commands and obstacles, where an observation has them.
    sees_extras: ClassVar[bool] = True
    #: Whether it keeps acceleration limits, if there are any, see :attr:`remembers_command`.
    keeps_acceleration: ClassVar[bool] = False
    #: Whether it keeps limits of jerk as well.
    keeps_jerk: ClassVar[bool] = False
    #: Whether `predict` accepts the observations of several arms at once.
    batched: ClassVar[bool] = True
    #: Rows that are worth a thread: the fewer, the longer a row takes.
    grain: ClassVar[int] = 256
    #: The parameter that may be given without its name, as in ``"agent:PATH"``; None where there is none.
    positional: ClassVar[str | None] = None
    #: Parameters that decide whether the policy suits a scenario.
    decisive: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """A policy that gives itself no name, nor has one of its base, is called by its class."""
        super().__init_subclass__(**options)
        if getattr(cls, "name", None) in {None, *(base.__name__ for base in cls.__mro__[1:])}:
            cls.name = cls.__name__

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """The policy for a scenario, of which it receives its :class:`Problem` only.

        Raises:
            InvalidInputError: A parameter is refused.
        """
        return cls(Problem.of(scenario), **parameters)

    @classmethod
    def parameter_names(cls) -> tuple[str, ...]:
        """The names of the policy's parameters."""
        return tuple(f.name for f in dataclasses.fields(cls) if f.name != "problem" and f.init and not f.kw_only)

    @property
    def parameters(self) -> dict[str, Any]:
        """The policy's parameters and their values."""
        return {name: getattr(self, name) for name in self.parameter_names()}

    @property
    def preview(self) -> Preview:
        """Number of steps ahead that the policy must see, or a tuple of steps."""
        return 1

    @property
    def commands(self) -> int:
        """Number of its last commands that the policy must see."""
        return 0

    @property
    def free_timing(self) -> bool:
        """Whether the policy may be later than the reference; its :meth:`diagnostics` have its ``progress`` then."""
        return False

    def memory(self, rows: int) -> Memory:
        """The memory at the start of an episode, preferably a NamedTuple: :meth:`solve` is handed one of its type.

        Args:
            rows: B, the leading axis of each array.
        """
        del rows
        return ()

    @functools.cached_property
    def remembers_command(self) -> bool:
        """Whether :meth:`solve` is shown the last command in place of the observed joint velocity.

        Acceleration limits bind a command to the one before; the observed velocity may be late or measured. The last
        command is what an ideal arm makes of the last action, and NaN where an episode begins: there the observed
        velocity counts.
        """
        limited = bool(np.isfinite(self.problem.model.acceleration_limit).any())
        return self.remembers_change or (self.keeps_acceleration and limited)

    @functools.cached_property
    def remembers_change(self) -> bool:
        """Whether it also remembers by how much the last command differed from the one before, for limits of jerk."""
        return self.keeps_jerk and self.problem.jerk_limited

    def initial_memory(self, rows: int) -> Memory:
        """The memory at the start of an episode as states have it: behind it the last command, if remembered."""
        memory = self.memory(rows)
        width = self.problem.model.joints * (2 if self.remembers_change else 1)
        return (*memory, np.full((rows, width), np.nan)) if self.remembers_command else memory

    def recall(self, memory: Memory, qdot: FloatArray, change: FloatArray | None = None) -> Memory:
        """A memory with another last command: for wrappers and control loops, which know what was sent.

        Args:
            memory: As :meth:`initial_memory` or the last call gave it.
            qdot: In [rad/s] or [m/s]. Shape (B, n).
            change: By how much it differed from the command before; if left out, that follows from the memory.
        """
        if not self.remembers_command:
            return memory
        *most, last = memory
        if self.remembers_change:
            n = qdot.shape[1]
            made = last[:, n:] + (qdot - last[:, :n]) if change is None else change
            qdot = np.concatenate([qdot, made], axis=1)
        return (*most, qdot)

    @abc.abstractmethod
    def solve(self, batch: Batch, memory: Memory) -> Solution:
        """Joint velocities for a batch of observations.

        Args:
            batch: The observations, checked.
            memory: As :meth:`memory` or the last call gave it; must not be changed in place.
        """

    def predict(
        self,
        observation: Observation,
        state: Memory | None = None,
        episode_start: npt.ArrayLike | None = None,
        deterministic: bool = True,
    ) -> tuple[npt.NDArray[np.float32], Memory]:
        """Actions for observations, single or batched.

        Args:
            observation: As the environment gives it; single, or all arrays with a leading batch axis B. Its
                ``nominal`` must show the steps 1, 2, … ahead, or just those of :attr:`preview` where that is a tuple:
                an environment made with another tuple shows others, which no policy can distinguish from these.
            state: State that the last call returned; None at the first.
            episode_start: True where an episode begins, and the memory is to be cleared. Shape (B,).
            deterministic: Changes nothing; solvers do not draw at random.

        Returns:
            Actions within the environment's box, of shape (n,) or (B, n), and the state for the next call: status
            and iterations (see :meth:`report`), then the solver's memory.

        Raises:
            InvalidInputError: The observation lacks something, has a wrong shape or is not finite, the preview is
                too short, or the state belongs to another batch.
        """
        del deterministic
        parts, rows, single = self._read(observation)
        if self.sees_extras:
            parts = *parts, *self._read.extras(observation, rows, single)
        action, after = self._respond(parts, single, self._recall(state, episode_start, rows))
        self._last[0] = after
        return action, after

    def act(self, batch: Batch, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """`predict` without checks, for observations that are known to be valid, as in wrappers.

        Args:
            batch: The observations, with no more steps ahead than the policy asks for; C-contiguous.
            memory: As :meth:`initial_memory` or the last call gave it, without status and iterations.

        Returns:
            Actions, of shape (B, n), and the state for the next call of `predict`.
        """
        problem, last = self.problem, np.empty(0)
        if self.remembers_command:
            *most, last = memory
            last = last.copy()
            begin_rows(last, batch.qdot)
            n, memory = batch.q.shape[1], tuple(most)
            change = last[:, n:].copy() if self.remembers_change else None
            batch = batch._replace(qdot=last[:, :n].copy(), change=change)
        qdot, kept, status, iterations = self._solve(batch, memory)
        action, status = np.empty(qdot.shape, np.float32), status.copy()
        lost = cut_rows(qdot, problem.velocity_limit, action, status)
        if self.remembers_command:
            sent_rows(problem.kernel_model, batch.q, action, last)
            kept = (*kept, last)
        if lost:
            kept = self._without_lost(kept, action)
        return action, pack(status, iterations, kept)

    @staticmethod
    def report(state: Memory) -> Report:
        """Status and iterations of the call that returned a state."""
        return Report(*state[:REPORTED])

    def memory_of(self, state: Memory) -> Memory:
        """The memory in a state that `predict` returned: the named tuple of :meth:`memory`, where it gives one."""
        memory = read_memory(state)
        return self._with_names(memory[:-1] if self.remembers_command else memory)

    def begin_episodes(self, memory: Memory, rows: npt.NDArray[np.bool_]) -> Memory:
        """A memory, cleared in the rows where an episode begins. Shape (B,)."""
        return replace_rows(memory, self.initial_memory(len(rows)), rows) if memory else memory

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """Diagnostics of the last solve by name, each of shape (B, …), from the state that `predict` returned."""
        del state
        return {}

    @functools.cached_property
    def _read(self) -> ObservationReader:
        return ObservationReader(self.name, self.problem, self.preview)

    def _respond(self, parts: Parts, single: bool, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """The result of `predict`, for observations and memory of the right shapes."""
        batch = as_batch(parts, single)
        if not all_finite(*batch[: len(OBSERVED)]):
            raise not_finite()
        action, after = self.act(batch, memory)
        return action[0] if single else action, after

    def _without_lost(self, memory: Memory, action: npt.NDArray[np.float32]) -> Memory:
        """A memory, cleared in rows whose action is NaN, as at the start of an episode; their actions become 0."""
        lost = np.asarray(np.isnan(action).any(axis=1))
        action[lost] = 0.0
        return replace_rows(memory, self.initial_memory(len(lost)), lost) if memory else memory

    def _recall(self, state: Memory | None, episode_start: npt.ArrayLike | None, rows: int) -> Memory:
        starting = None if episode_start is None else read_flags(episode_start, rows)
        if state is None:
            return self.initial_memory(rows)
        if state is self._last[0] and len(state[0]) == rows:
            memory = state[REPORTED:]
        else:
            memory = check_state(self.name, state, self._signature(rows), rows)
        if starting is None or not starting.any():
            return memory
        return self.begin_episodes(memory, np.broadcast_to(starting, (rows,)))

    @functools.cached_property
    def _last(self) -> list[Memory | None]:
        """The last state that was returned, which needs no check when it comes back."""
        return [None]

    @functools.cached_property
    def _signature(self) -> Callable[[int], Signature]:
        """Specification of the memory of B rows; cached, since `predict` often has the same number again."""
        return functools.lru_cache(16)(functools.partial(describe_arrays, self.initial_memory(1)))

    @functools.cached_property
    def _example(self) -> Memory:
        """The memory of one row, for its shapes and its type."""
        return self.memory(1)

    def _fits_one_call(self, rows: int) -> bool:
        return rows < 2 * self.grain or getattr(_sharing, "now", False)

    @classmethod
    @contextlib.contextmanager
    def _first_call(cls) -> Iterator[None]:
        """Announces the compilation that the first call of a class does."""
        compiled_classes.add(cls)
        with announce(f"the policy {cls.name}"):
            yield

    def _with_names(self, memory: Memory) -> Memory:
        """The memory as the named tuple that :meth:`memory` gives, where it gives one."""
        kind: Any = type(self._example)
        return memory if type(memory) is kind or kind is tuple else kind._make(memory)

    def _solve(self, batch: Batch, memory: Memory) -> Solution:
        """The solution of all rows; where they are many, several threads share them out."""
        policy, rows = type(self), len(batch.q)
        memory = self._with_names(memory)
        if policy not in compiled_classes:  # the first solve has to compile
            with self._first_call():
                return self.solve(batch, memory)
        if self._fits_one_call(rows):
            return self.solve(batch, memory)

        def share(part: slice) -> Solution:
            return self.solve(take_rows(batch, part), self._with_names(tuple(array[part] for array in memory)))

        return _divide_rows(share, rows, self.grain)


def _divide_rows(solve: Callable[[slice], Solution], rows: int, grain: int) -> Solution:
    """The solution of all rows, each thread solving a part of at least ``grain`` rows."""
    parts: dict[int, Solution] = {}

    def work(start: int, stop: int) -> None:
        _sharing.now = True
        try:
            parts[start] = solve(slice(start, stop))
        finally:
            _sharing.now = False

    in_chunks(work, rows, grain)
    qdots, memories, status, iterations = zip(*(parts[start] for start in sorted(parts)), strict=True)
    memory = tuple(np.concatenate(arrays) for arrays in zip(*memories, strict=True))
    return Solution(np.concatenate(qdots), memory, np.concatenate(status), np.concatenate(iterations))
