"""A solver as a policy: the signature of Stable-Baselines3's `predict`, and memory that travels through `state`."""

from __future__ import annotations

import abc
import dataclasses
import functools
import math
import threading
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from baselines.status import Status
from ikgym.arms import Arm
from ikgym.compilation import announced
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.parallel import in_chunks
from ikgym.scenarios import Preview, Scenario
from ikgym.scenarios.scenario import furthest
from ikgym.tasks import Task
from ikgym.validation import FloatArray, Frozen, frozen_array

Observation = Mapping[str, npt.NDArray[np.floating[Any]]]
Memory = tuple[npt.NDArray[Any], ...]


_SATURATED, _DIVERGED = int(Status.SATURATED), int(Status.DIVERGED)
_FLOAT = np.dtype(np.float64)

#: Policies that have solved something in this process, and so are compiled.
_compiled: set[type] = set()

#: Which threads work on a share of a batch. What they call in turn shares out no further: threads of one pool that
#: wait for others of it wait forever.
_sharing = threading.local()


@dataclasses.dataclass(frozen=True, eq=False)
class Problem(Frozen):
    """What a policy is told of a scenario: its model of the arm, which may differ from the arm that moves.

    Args:
        model: The arm as the solver knows it.
        task: The task coordinates.
        cost: The stage cost.
        dt: Δt in [s].
        velocity_limit: What an action of 1 means, in [rad/s] or [m/s]. Shape (n,).
    """

    model: Arm
    task: Task
    cost: TrackingCost
    dt: float
    velocity_limit: FloatArray

    def __post_init__(self) -> None:
        limit = frozen_array("velocity_limit", self.velocity_limit, (self.model.joints,))
        object.__setattr__(self, "velocity_limit", limit)

    @classmethod
    def of(cls, scenario: Scenario) -> Self:
        """What a scenario tells."""
        return cls(scenario.model, scenario.task, scenario.cost, scenario.dt, scenario.velocity_limit)


class Batch(NamedTuple):
    """Observations of B arms, as float64.

    Attributes:
        q: Joint coordinates in [rad] or [m]. Shape (B, n).
        qdot: Joint velocities last applied, in [rad/s] or [m/s]. Shape (B, n).
        pose: Measured task coordinates. Shape (B, m).
        nominal: Nominal task coordinates ahead, X^N(k+1) first. Shape (B, p, m).
        remaining: Steps left. Shape (B, 1).
    """

    q: FloatArray
    qdot: FloatArray
    pose: FloatArray
    nominal: FloatArray
    remaining: FloatArray


class Solution(NamedTuple):
    """What a solver answers.

    Attributes:
        qdot: Joint velocities in [rad/s] or [m/s]. Shape (B, n).
        memory: What the solver wants back at the next step, each array with a leading axis of B.
        status: Values of :class:`Status`. Shape (B,).
        iterations: Iterations made. Shape (B,).
    """

    qdot: FloatArray
    memory: Memory
    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]


class Operations(NamedTuple):
    """What one step has cost, counted in what is dear on a real arm.

    Attributes:
        forward_kinematics: Evaluations of the model's forward kinematics alone. Shape (B,).
        jacobians: Evaluations of the model's Jacobian, with the forward kinematics that come with it. Shape (B,).
        factorisations: Matrices factorised, decomposed or inverted. Shape (B,).
        measurements: Poses measured. Shape (B,).
    """

    forward_kinematics: npt.NDArray[np.int64]
    jacobians: npt.NDArray[np.int64]
    factorisations: npt.NDArray[np.int64]
    measurements: npt.NDArray[np.int64]


class Report(NamedTuple):
    """What a solver says of its last step; read from the state by :meth:`SolverPolicy.report`."""

    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]


@dataclasses.dataclass(frozen=True, eq=False)
class SolverPolicy(Frozen, abc.ABC):
    """Base of all solvers: turns `solve` on a batch into Stable-Baselines3's `predict`.

    A policy is a frozen dataclass: its fields behind ``problem`` are its parameters, and whatever changes from
    step to step travels through ``state``. It never touches an environment.

    Args:
        problem: What the policy is told of the scenario.
    """

    problem: Problem

    #: What messages call the policy; that of the class if left out. Results have the name in the registry.
    name: ClassVar[str]
    #: Whether the policy knows more than its observation: a reference, not a contender.
    reference: ClassVar[bool] = False
    #: Rows that are worth a thread of their own: the fewer, the longer a row takes.
    grain: ClassVar[int] = 256
    #: Whether the policy is made from others.
    composed: ClassVar[bool] = False
    #: The parameter that stands alone behind the name, as in ``"agent:PATH"``; None where all of them have to be named.
    nameless: ClassVar[str | None] = None
    #: Parameters without which nobody can tell whether the policy suits a scenario.
    decisive: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls, **options: Any) -> None:
        """A policy that gives itself no name, nor has one of its base, is called by its class."""
        super().__init_subclass__(**options)
        if getattr(cls, "name", None) in {None, *(base.__name__ for base in cls.__mro__[1:])}:
            cls.name = cls.__name__

    @classmethod
    def for_scenario(cls, scenario: Scenario, **parameters: Any) -> Self:
        """The policy for a scenario.

        Args:
            scenario: What is to be tracked; only what :class:`Problem` holds is passed on.
            **parameters: The policy's own.

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
        """How many steps ahead the policy must be shown, or a tuple of which ones."""
        return 1

    def memory(self, rows: int) -> Memory:
        """The memory at the start of an episode.

        Args:
            rows: B, the leading axis of each array.
        """
        del rows
        return ()

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
                an environment made with another tuple shows others, which no policy can tell from these.
            state: What the last call returned; None at the first.
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
        batch, single = self._batch(observation)
        action, after = self.act(batch, self._recall(state, episode_start, len(batch.q)))
        return action[0] if single else action, after

    def act(self, batch: Batch, memory: Memory) -> tuple[npt.NDArray[np.float32], Memory]:
        """What `predict` does with observations that are known to be good, as policies over other ones may know.

        Args:
            batch: The observations, with no more steps ahead than the policy asks for; C-contiguous.
            memory: As :meth:`memory` or the last call gave it, without status and iterations.

        Returns:
            Actions, of shape (B, n), and the state for the next call of `predict`.
        """
        solution, rows = self._solve(batch, memory), len(batch.q)
        action, status = np.empty(batch.q.shape, dtype=np.float32), solution.status.copy()
        lost, kept = np.empty(rows, dtype=np.bool_), solution.memory
        if _cut_rows(solution.qdot, self.problem.velocity_limit, action, status, lost):
            kept = _replace_rows(kept, self.memory(rows), lost)
        return action, (status, solution.iterations, *kept)

    @staticmethod
    def report(state: Memory) -> Report:
        """Status and iterations of the call that returned a state."""
        return Report(state[0], state[1])

    def diagnostics(self, state: Memory) -> dict[str, FloatArray]:
        """What a solver can show of how it came to its answer, by name; read from the state that `predict` returned.

        Returns:
            Arrays with a leading axis of B; nothing for most solvers.
        """
        del state
        return {}

    def operations(self, state: Memory) -> Operations:
        """What the call that returned a state has cost; worked out when asked for, at no cost otherwise."""
        counts = self.count(self.report(state).iterations)
        return Operations(*(np.broadcast_to(np.asarray(c, dtype=np.int64), state[1].shape).copy() for c in counts))

    @abc.abstractmethod
    def count(self, iterations: npt.NDArray[np.int64]) -> tuple[npt.ArrayLike, ...]:
        """What a solve of so many iterations costs.

        Args:
            iterations: Iterations made. Shape (B,).

        Returns:
            The numbers of :class:`Operations`, in its order; each one number, or of shape (B,).
        """

    def _batch(self, observation: Observation) -> tuple[Batch, bool]:
        try:
            batch = Batch(*[_as_floats(observation[key]) for key in Batch._fields])
        except (KeyError, IndexError, TypeError, ValueError) as e:
            keys = sorted(observation) if isinstance(observation, Mapping) else type(observation).__name__
            raise InvalidInputError(
                f"observation: expected a dict of number arrays with the keys {list(Batch._fields)}, got {keys} ({e})."
            ) from None
        single = batch.q.ndim == 1
        if single:
            batch = Batch(*[a[None] for a in batch])
        rows, n, m = len(batch.q), self.problem.model.joints, self.problem.task.size
        ahead = batch.nominal.shape[1] if batch.nominal.ndim == 3 else furthest(self.preview)
        shapes = (rows, n), (rows, n), (rows, m), (rows, ahead, m), (rows, 1)
        for key, shape, array in zip(Batch._fields, shapes, batch, strict=True):
            if array.shape != shape:
                begin = 1 if single else 0
                raise InvalidInputError(
                    f"observation[{key!r}]: expected shape {shape[begin:]}, got {array.shape[begin:]}."
                )
        if not _all_finite(*batch):
            raise InvalidInputError("observation: expected finite numbers, got NaN or infinity.")
        needed = self._needed(batch.nominal)
        return batch if needed is batch.nominal else batch._replace(nominal=needed), single

    def _needed(self, nominal: FloatArray) -> FloatArray:
        """The nominal coordinates that the policy asks for, of those that are shown. Shapes (B, any, m)."""
        preview, ahead = self.preview, nominal.shape[1]
        if isinstance(preview, int):
            if ahead >= preview:
                return nominal
            wanted = f"{preview} steps"
        else:
            if ahead == len(preview):
                return nominal
            if ahead >= preview[-1]:
                return nominal.take(np.array(preview) - 1, axis=1)
            wanted = f"the steps {preview}"
        raise InvalidInputError(
            f"{self.name} needs to be shown {wanted} ahead, the observation has {ahead}: make the environment with "
            f"preview={preview}."
        )

    def _recall(self, state: Memory | None, episode_start: npt.ArrayLike | None, rows: int) -> Memory:
        starting = None if episode_start is None else np.asarray(episode_start)
        if starting is not None and (starting.dtype.kind not in "biuf" or starting.shape not in {(), (rows,)}):
            raise InvalidInputError(f"episode_start: expected {rows} truth values, got {episode_start!r}.")
        if state is None:
            return self.memory(rows)
        if (
            not isinstance(state, tuple)
            or not all(isinstance(array, np.ndarray) for array in state)
            or [k.shape for k in state[2:]] != [(rows, *shape) for shape in self._remembered]
        ):
            raise InvalidInputError(
                f"state: expected what {self.name}.predict returned for a batch of {rows}, got "
                f"{[np.shape(k) for k in state] if isinstance(state, tuple) else state!r}."
            )
        if starting is None or not starting.any():
            return state[2:]
        return _replace_rows(state[2:], self.memory(rows), np.broadcast_to(starting.astype(np.bool_), (rows,)))

    @functools.cached_property
    def _remembered(self) -> list[tuple[int, ...]]:
        """The shapes of one row's memory."""
        return [array.shape[1:] for array in self.memory(1)]

    def _solve(self, batch: Batch, memory: Memory) -> Solution:
        """The solution of all rows; where they are many, several threads share them out."""
        policy, rows = type(self), len(batch.q)
        if policy not in _compiled:  # the first solve has to compile
            with announced(f"the policy {policy.name}"):
                solution = self.solve(batch, memory)
            _compiled.add(policy)
            return solution
        if rows < 2 * self.grain or getattr(_sharing, "now", False):
            return self.solve(batch, memory)
        parts: dict[int, Solution] = {}

        def work(start: int, stop: int) -> None:
            share = Batch(*[array[start:stop] for array in batch])
            _sharing.now = True
            try:
                parts[start] = self.solve(share, tuple(array[start:stop] for array in memory))
            finally:
                _sharing.now = False

        in_chunks(work, rows, self.grain)
        return _joined([parts[start] for start in sorted(parts)])


def statuses(rows: int, status: Status = Status.CONVERGED) -> npt.NDArray[np.int64]:
    """The same status for all rows. Shape (B,)."""
    return np.full(rows, int(status))


def _joined(parts: Sequence[Solution]) -> Solution:
    """The solutions of one batch's parts as one."""
    if len(parts) == 1:
        return parts[0]
    qdots, memories, status, iterations = zip(*parts, strict=True)
    memory = tuple(np.concatenate(arrays) for arrays in zip(*memories, strict=True))
    return Solution(np.concatenate(qdots), memory, np.concatenate(status), np.concatenate(iterations))


def _replace_rows(memory: Memory, fresh: Memory, rows: npt.NDArray[np.bool_]) -> Memory:
    return tuple(np.where(rows.reshape(-1, *[1] * (k.ndim - 1)), f, k) for k, f in zip(memory, fresh, strict=True))


@kernel
def _cut_rows(qdot, limit, action, status, lost):
    """Joint velocities as fractions of their limit, within the box, row by row.

    Args:
        qdot: In [rad/s] or [m/s]. Shape (B, n).
        limit: In [rad/s] or [m/s]. Shape (n,).
        action: Receives the actions; zeros where a number is not finite. Shape (B, n).
        status: Raised to what the row deserves. Shape (B,).
        lost: Receives whether a number of the row is not finite. Shape (B,).

    Returns:
        Whether any row is lost.
    """
    any_lost = False
    for row in range(qdot.shape[0]):
        lost[row], saturated = False, False
        for j in range(qdot.shape[1]):
            fraction = qdot[row, j] / limit[j]
            if not np.isfinite(fraction):
                lost[row] = True
            elif abs(fraction) > 1.0:
                saturated = True
                fraction = math.copysign(1.0, fraction)
            action[row, j] = fraction
        if lost[row]:
            any_lost = True
            status[row] = _DIVERGED
            for j in range(qdot.shape[1]):
                action[row, j] = 0.0
        elif saturated:
            status[row] = max(status[row], _SATURATED)
    return any_lost


@kernel
def _all_finite(q, qdot, pose, nominal, remaining):
    """Whether all numbers of a batch are finite, without the temporary arrays that NumPy makes."""
    for array in (q.ravel(), qdot.ravel(), pose.ravel(), nominal.ravel(), remaining.ravel()):
        for value in array:
            if not np.isfinite(value):
                return False
    return True


def _as_floats(value: object) -> FloatArray:
    """A C-contiguous float64 array; refuses what is no array of real numbers, such as strings."""
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.flags.c_contiguous:
        return value
    raw = np.asarray(value)
    if raw.dtype.kind not in "fiub":
        raise TypeError(f"no real numbers: {raw.dtype}")
    return np.ascontiguousarray(raw, dtype=np.float64)
