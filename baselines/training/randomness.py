"""The randomness of a run: it follows from the seed and the number of the segment alone."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterator

import numpy as np
import torch


def sequence(seed: int, segment: int | None) -> np.random.SeedSequence:
    """The seed sequence of a segment, counted from 0; None stands for the time before the first one."""
    return np.random.SeedSequence(seed, spawn_key=(0 if segment is None else segment + 1,))


def reseed(seed: int, segment: int | None) -> None:
    """Seeds the global generators of Python, NumPy and PyTorch, which Stable-Baselines3 draws from."""
    for_python, for_numpy, for_torch = sequence(seed, segment).generate_state(3).tolist()
    random.seed(for_python)
    np.random.seed(for_numpy)  # noqa: NPY002  # Stable-Baselines3 draws from it
    torch.manual_seed(for_torch)


@contextlib.contextmanager
def deterministic_torch() -> Iterator[None]:
    """Restricts PyTorch to one thread and deterministic algorithms within the context.

    Networks this small are faster in one thread, and each of several seeds has its own core.
    """
    threads, strict = torch.get_num_threads(), torch.are_deterministic_algorithms_enabled()
    warns = torch.is_deterministic_algorithms_warn_only_enabled()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
        torch.use_deterministic_algorithms(strict, warn_only=warns)
