"""Observations as policies need them: checked, batched, and with the steps ahead that are asked for."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from baselines.policy.problem import Batch, Problem
from ikgym.exceptions import InvalidInputError
from ikgym.jit import kernel
from ikgym.preview import furthest
from ikgym.scenarios import Preview
from ikgym.simulator import Observation
from ikgym.validation import FloatArray

_FLOAT = np.dtype(np.float64)


def as_batch(name: str, observation: Observation, problem: Problem, preview: Preview) -> tuple[Batch, bool]:
    """A batch of observations for a policy, and whether it was a single observation.

    Args:
        name: The policy's, for messages.
        observation: As the environment gives it; single, or all arrays with a leading batch axis.
        problem: What the policy is told of the scenario.
        preview: What the policy has to be shown.

    Raises:
        InvalidInputError: The observation lacks something, has a wrong shape or is not finite, or shows too little.
    """
    batch = _floats(observation)
    single = batch.q.ndim == 1
    if single:
        batch = Batch(*[a[None] for a in batch])
    _check_shapes(batch, problem, preview, single)
    if not _all_finite(*batch):
        raise InvalidInputError("observation: expected finite numbers, got NaN or infinity.")
    needed = _needed(name, batch.nominal, preview)
    return batch if needed is batch.nominal else batch._replace(nominal=needed), single


def _floats(observation: Observation) -> Batch:
    try:
        return Batch(*[_as_floats(observation[key]) for key in Batch._fields])
    except (KeyError, IndexError, TypeError, ValueError) as e:
        keys = sorted(observation) if isinstance(observation, Mapping) else type(observation).__name__
        raise InvalidInputError(
            f"observation: expected a dict of number arrays with the keys {list(Batch._fields)}, got {keys} ({e})."
        ) from None


def _check_shapes(batch: Batch, problem: Problem, preview: Preview, single: bool) -> None:
    rows, n, m = len(batch.q), problem.model.joints, problem.task.size
    ahead = batch.nominal.shape[1] if batch.nominal.ndim == 3 else furthest(preview)
    shapes = (rows, n), (rows, n), (rows, m), (rows, ahead, m), (rows, 1)
    for key, shape, array in zip(Batch._fields, shapes, batch, strict=True):
        if array.shape != shape:
            begin = 1 if single else 0
            raise InvalidInputError(f"observation[{key!r}]: expected shape {shape[begin:]}, got {array.shape[begin:]}.")


def _needed(name: str, nominal: FloatArray, preview: Preview) -> FloatArray:
    """The nominal coordinates that a policy asks for, of those that are shown. Shapes (B, any, m)."""
    ahead = nominal.shape[1]
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
        f"{name} needs to be shown {wanted} ahead, the observation has {ahead}: make the environment with "
        f"preview={preview}."
    )


@kernel
def _all_finite(q, qdot, pose, nominal, remaining):
    """Whether all numbers of a batch are finite, without the temporary arrays that NumPy makes."""
    for array in (q.ravel(), qdot.ravel(), pose.ravel(), nominal.ravel(), remaining.ravel()):
        for value in array:
            if not np.isfinite(value):
                return False
    return True


def _as_floats(value: object) -> FloatArray:
    """A C-contiguous float64 array; refuses what is no array of real numbers, such as strings.

    Read-only arrays are copied: the kernels would be compiled anew for them.
    """
    if type(value) is np.ndarray and value.dtype is _FLOAT and value.flags.carray:
        return value
    raw = np.asarray(value)
    if raw.dtype.kind not in "fiub":
        raise TypeError(f"no real numbers: {raw.dtype}")
    return np.array(raw, dtype=np.float64, order="C")
