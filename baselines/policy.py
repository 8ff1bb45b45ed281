"""A solver as a policy: the signature of Stable-Baselines3's `predict`, and memory that travels through `state`."""

from __future__ import annotations

import abc
import contextlib
import dataclasses
import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from baselines.status import Status
from ikgym.arms import Arm
from ikgym.compilation import announced
from ikgym.cost import TrackingCost
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.scenarios import Scenario
from ikgym.tasks import Task
from ikgym.validation import FloatArray, Frozen, frozen_array

Observation = Mapping[str, npt.NDArray[np.floating[Any]]]
Memory = tuple[npt.NDArray[Any], ...]


_SATURATED, _DIVERGED = int(Status.SATURATED), int(Status.DIVERGED)

#: Policies that have solved something in this process, and so are compiled.
_compiled: set[type] = set()


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

    #: The name in the registry.
    name: ClassVar[str]
    #: Whether the policy knows more than its observation: a reference, not a contender.
    reference: ClassVar[bool] = False

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
    def preview(self) -> int:
        """How many steps ahead the policy must be shown."""
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
                ``nominal`` must show the steps 1, 2, … ahead: an environment made with a tuple as its preview shows
                others, which no solver can tell from these.
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
        rows = len(batch.q)
        memory = self._recall(state, episode_start, rows)
        with _announced(type(self)):
            solution = self.solve(batch, memory)
        action, status = np.empty(batch.q.shape, dtype=np.float32), solution.status.copy()
        lost = np.empty(rows, dtype=np.bool_)
        _cut_rows(solution.qdot, self.problem.velocity_limit, action, status, lost)
        kept = _replace_rows(solution.memory, self.memory(rows), lost) if lost.any() else solution.memory
        return action[0] if single else action, (status, solution.iterations, *kept)

    @staticmethod
    def report(state: Memory) -> Report:
        """Status and iterations of the call that returned a state."""
        return Report(state[0], state[1])

    def inside(self, state: Memory) -> dict[str, FloatArray]:
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
            arrays = [_as_floats(observation[key]) for key in Batch._fields]
        except (KeyError, IndexError, TypeError, ValueError) as e:
            keys = sorted(observation) if isinstance(observation, Mapping) else type(observation).__name__
            raise InvalidInputError(
                f"observation: expected a dict of number arrays with the keys {list(Batch._fields)}, got {keys} ({e})."
            ) from None
        single = arrays[0].ndim == 1
        if single:
            arrays = [a[None] for a in arrays]
        batch = Batch(*arrays)
        rows, n, m = len(batch.q), self.problem.model.joints, self.problem.task.size
        ahead = batch.nominal.shape[1] if batch.nominal.ndim == 3 else self.preview
        shapes = {"q": (n,), "qdot": (n,), "pose": (m,), "nominal": (ahead, m), "remaining": (1,)}
        for (key, shape), array in zip(shapes.items(), batch, strict=True):
            if array.shape != (rows, *shape):
                lead = () if single else (rows,)
                got = array.shape[1:] if single else array.shape
                raise InvalidInputError(f"observation[{key!r}]: expected shape {(*lead, *shape)}, got {got}.")
        if not all(map(_finite, batch)):
            raise InvalidInputError("observation: expected finite numbers, got NaN or infinity.")
        if batch.nominal.shape[1] < self.preview:
            raise InvalidInputError(
                f"{self.name} needs to be shown {self.preview} steps ahead, the observation has "
                f"{batch.nominal.shape[1]}: make the environment with preview={self.preview}."
            )
        return batch, single

    def _recall(self, state: Memory | None, episode_start: npt.ArrayLike | None, rows: int) -> Memory:
        fresh = self.memory(rows)
        starting = None if episode_start is None else np.asarray(episode_start)
        if starting is not None and (starting.dtype.kind not in "biuf" or starting.shape not in {(), (rows,)}):
            raise InvalidInputError(f"episode_start: expected {rows} truth values, got {episode_start!r}.")
        if state is None:
            return fresh
        kept = state[2:] if isinstance(state, tuple) else None
        if (
            kept is None
            or not all(isinstance(array, np.ndarray) for array in state)
            or [k.shape for k in kept] != [f.shape for f in fresh]
        ):
            raise InvalidInputError(
                f"state: expected what {self.name}.predict returned for a batch of {rows}, got "
                f"{[np.shape(k) for k in state] if isinstance(state, tuple) else state!r}."
            )
        if starting is None or not starting.any():
            return kept
        return _replace_rows(kept, fresh, np.broadcast_to(starting.astype(np.bool_), (rows,)))


def statuses(rows: int, status: Status = Status.CONVERGED) -> npt.NDArray[np.int64]:
    """The same status for all rows. Shape (B,)."""
    return np.full(rows, int(status))


def _replace_rows(memory: Memory, fresh: Memory, rows: npt.NDArray[np.bool_]) -> Memory:
    return tuple(np.where(rows.reshape(-1, *[1] * (k.ndim - 1)), f, k) for k, f in zip(memory, fresh, strict=True))


@kernel
def _cut_rows(qdot, limit, action, status, lost):  # type: ignore[no-untyped-def]
    """Joint velocities as fractions of their limit, within the box, row by row.

    Args:
        qdot: In [rad/s] or [m/s]. Shape (B, n).
        limit: In [rad/s] or [m/s]. Shape (n,).
        action: Receives the actions; zeros where a number is not finite. Shape (B, n).
        status: Raised to what the row deserves. Shape (B,).
        lost: Receives whether a number of the row is not finite. Shape (B,).
    """
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
            status[row] = _DIVERGED
            for j in range(qdot.shape[1]):
                action[row, j] = 0.0
        elif saturated:
            status[row] = max(status[row], _SATURATED)


@kernel
def _all_finite(values):  # type: ignore[no-untyped-def]
    for value in values:  # noqa: SIM110  # compiled, the loop is faster than a generator
        if not np.isfinite(value):
            return False
    return True


def _finite(array: FloatArray) -> bool:
    """Whether all numbers are finite, without the temporary array that NumPy makes."""
    return bool(_all_finite(array.ravel()))


def _as_floats(value: object) -> FloatArray:
    """A C-contiguous float64 array; refuses what is no array of real numbers, such as strings."""
    raw = np.asarray(value)
    if raw.dtype.kind not in "fiub":
        raise TypeError(f"no real numbers: {raw.dtype}")
    return np.ascontiguousarray(raw, dtype=np.float64)


@contextlib.contextmanager
def _compiling(policy: type[SolverPolicy]) -> Iterator[None]:
    with announced(f"the policy {policy.name}"):
        yield
    _compiled.add(policy)


def _announced(policy: type[SolverPolicy]) -> contextlib.AbstractContextManager[None]:
    """Tells the user if the first solve of a policy takes long, since it has to be compiled."""
    return _READY if policy in _compiled else _compiling(policy)


_READY = contextlib.nullcontext()
