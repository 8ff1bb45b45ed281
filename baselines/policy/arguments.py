"""Input and output of `predict`: observations, checked and batched, and the state.

The state is a flat tuple of arrays, (status, iterations, *memory), each with a leading axis of B; at the end of the
memory is the last command, where the policy remembers it. :func:`pack` makes a state, `SolverPolicy.report` and
`SolverPolicy.memory_of` read it.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from baselines.policy.problem import Problem
from baselines.policy_kernels import Batch, Memory
from ikgym.exceptions import InvalidInputError
from ikgym.kernels.outcome import OBSERVED, OBSTACLE, SOMETIMES
from ikgym.scenarios import Preview
from ikgym.scenarios.preview import furthest
from ikgym.simulator import Observation
from ikgym.validation import FloatArray


class Report(NamedTuple):
    """Status and iterations of the last step; read from the state by `SolverPolicy.report`."""

    status: npt.NDArray[np.int64]
    iterations: npt.NDArray[np.int64]


#: Shapes and types of the arrays of a memory, and that they are contiguous and can be written to.
Signature = list[tuple[tuple[int, ...], np.dtype[Any], bool]]

#: Arrays of a state in front of the memory.
REPORTED = len(Report._fields)


def pack(status: npt.NDArray[np.int64], iterations: npt.NDArray[np.int64], memory: Memory) -> Memory:
    """A state from status (B,), iterations (B,) and the memory."""
    return status, iterations, *memory


def read_memory(state: Memory) -> Memory:
    """The memory in a state, without its names; `SolverPolicy.memory_of` gives it with them."""
    return state[REPORTED:]


def describe_arrays(example: Memory, rows: int) -> Signature:
    """Shapes and types of a memory of B rows, from the memory of one row."""
    return [((rows, *array.shape[1:]), array.dtype, True) for array in example]


def check_state(name: str, state: object, expected: Signature, rows: int) -> Memory:
    """The memory in a state that a user hands in, for the policy of a name and B rows.

    Arrays that kernels would have to be compiled anew for, such as read-only ones, are copied.

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
    raise _state_error(name, state, expected, rows)


def _state_error(name: str, state: object, expected: Signature, rows: int) -> InvalidInputError:
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
        f"state: expected the one that {name}.predict returned for a batch of {rows}, got {str(given)[:200]}."
    )


def read_flags(episode_start: npt.ArrayLike, rows: int) -> npt.NDArray[np.bool_]:
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
    """The memory, with some rows those of a fresh one. Shape of ``rows`` (B,)."""
    return tuple(np.where(rows.reshape(-1, *[1] * (k.ndim - 1)), f, k) for k, f in zip(memory, fresh, strict=True))


_FLOAT = np.dtype(np.float64)
#: The arrays of an observation, in the order of :class:`Batch`: the first five, or all, None for those absent.
Parts = Sequence[Any]

_parts = operator.itemgetter(*OBSERVED)


class ObservationReader:
    """Turns observations into batches for one policy, and refuses those that are not good.

    A policy is shown observations of the same shapes again and again: the steps to convert them are worked out once.

    Args:
        name: The policy's, for messages.
        problem: The scenario as the policy knows it.
        preview: The preview that the policy needs.
    """

    def __init__(self, name: str, problem: Problem, preview: Preview) -> None:
        self._name, self._problem, self._preview = name, problem, preview
        #: The last shapes that were good, with the steps to convert them; replaced as a whole, for threads.
        self._last: tuple[Any, int, bool, npt.NDArray[np.int64] | None] = (None, 0, False, None)

    def __call__(self, observation: Observation) -> tuple[Parts, int, bool]:
        """The arrays of an observation as they are, how many rows they have, and whether it was a single observation.

        Whether the numbers are finite is left to :func:`all_finite`, which a compiled solver can do on its way.

        Raises:
            InvalidInputError: The observation lacks something, has a wrong shape, or shows too little.
        """
        parts = _floats(observation)
        q, qdot, pose, nominal, remaining = parts
        shapes = q.shape, qdot.shape, pose.shape, nominal.shape, remaining.shape
        known, rows, single, steps = self._last
        if shapes != known:
            rows, single, steps = self._layout(*shapes)
            self._last = shapes, rows, single, steps
        if steps is not None:
            parts = q, qdot, pose, nominal.take(steps, axis=-2), remaining
        return parts, rows, single

    def _layout(self, *shapes: tuple[int, ...]) -> tuple[int, bool, npt.NDArray[np.int64] | None]:
        """Rows of arrays of such shapes, whether they are a single observation, and which steps ahead are taken."""
        q, *_, nominal, _ = shapes
        single = len(q) == 1
        rows: tuple[int, ...] = () if single else (*q[:1],)
        n, m = self._problem.model.joints, self._problem.task.size
        ahead = nominal[-2] if len(nominal) == len(rows) + 2 else furthest(self._preview)
        expected = (n,), (n,), (m,), (ahead, m), (1,)
        for key, parts, shape in zip(OBSERVED, expected, shapes, strict=True):
            if shape != (*rows, *parts):
                raise InvalidInputError(f"observation[{key!r}]: expected shape {(*rows, *parts)}, got {shape}.")
        return 1 if single else q[0], single, self._steps(ahead)

    def _steps(self, ahead: int) -> npt.NDArray[np.int64] | None:
        """Which of the steps that are shown the policy asks for, counted from 0; None for all of them."""
        preview = self._preview
        if isinstance(preview, int):
            if ahead >= preview:
                return None
            wanted = f"{preview} steps"
        else:
            if ahead == len(preview):
                return None
            if ahead >= preview[-1]:
                return np.array(preview) - 1
            wanted = f"the steps {preview}"
        raise InvalidInputError(
            f"{self._name} needs to be shown {wanted} ahead, the observation has {ahead}: make the environment with "
            f"preview={preview}."
        )

    def extras(self, observation: Observation, rows: int, single: bool) -> Parts:
        """Ages of measurements, past commands and obstacles, None where the observation has none.

        Raises:
            InvalidInputError: One of them has a wrong shape, is not finite, or an age is below 0.
        """
        n, lead = self._problem.model.joints, () if single else (rows,)
        tails: tuple[tuple[int | None, ...], ...] = (1,), (1,), (None, n), (None, OBSTACLE)
        return [_extra(observation, key, lead, tail) for key, tail in zip(SOMETIMES, tails, strict=True)]


def _extra(observation: Observation, key: str, lead: tuple[int, ...], tail: tuple[int | None, ...]) -> Any:
    """One array that an observation may have, checked; None where it has not."""
    if key not in observation:
        return None
    try:
        array = as_floats(observation[key])
    except (TypeError, ValueError) as e:
        raise InvalidInputError(f"observation[{key!r}]: expected an array of numbers ({e}).") from None
    expected = (*lead, *tail)
    if array.ndim != len(expected) or any(e not in {None, s} for e, s in zip(expected, array.shape, strict=True)):
        shape = str(expected).replace("None", "h")
        raise InvalidInputError(f"observation[{key!r}]: expected shape {shape}, got {array.shape}.")
    if not np.isfinite(array).all():
        raise not_finite()
    if key.endswith("age") and array.min(initial=0.0) < 0.0:
        raise InvalidInputError(f"observation[{key!r}]: expected ages of at least 0 steps, got {array.min():g}.")
    return array


def as_batch(parts: Parts, single: bool) -> Batch:
    """A batch from the arrays of an observation."""
    return take_rows(parts, None) if single else Batch(*parts)


def take_rows(parts: Parts, rows: slice | None) -> Batch:
    """Some rows of all arrays; None adds an axis of rows."""
    some: list[Any] = [None if part is None else part[rows] for part in parts]
    return Batch(*some)


def _floats(observation: Observation) -> Parts:
    """The arrays of an observation as kernels take them."""
    try:
        arrays: Parts = _parts(observation)
        for array in arrays:
            if not (type(array) is np.ndarray and array.dtype is _FLOAT and array.flags.carray):
                return tuple([as_floats(part) for part in arrays])
        return arrays
    except (KeyError, IndexError, TypeError, ValueError) as e:
        keys = sorted(observation) if isinstance(observation, Mapping) else type(observation).__name__
        raise InvalidInputError(
            f"observation: expected a dict of number arrays with the keys {list(OBSERVED)}, got {keys} ({e})."
        ) from None


def not_finite() -> InvalidInputError:
    """The error for a batch that is not :func:`all_finite`."""
    return InvalidInputError("observation: expected finite numbers, got NaN or infinity.")


def as_floats(value: object) -> FloatArray:
    """A C-contiguous float64 array; refuses anything but real numbers, such as strings.

    Read-only arrays are copied: the kernels would be compiled anew for them.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.flags.carray:
        return value
    raw = np.asarray(value)
    if raw.dtype.kind not in "fiub":
        raise TypeError(f"no real numbers: {raw.dtype}")
    return np.array(raw, dtype=np.float64, order="C")
