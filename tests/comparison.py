"""Exact comparison of whatever environments return."""

import dataclasses
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode


def identical(a: Any, b: Any) -> bool:
    """Whether two nested structures of dicts, arrays and scalars are the same bit for bit, types of arrays included.

    NaN equals NaN; 0.0 and -0.0 differ.
    """
    if isinstance(a, dict) or isinstance(b, dict):
        return (
            isinstance(a, dict)
            and isinstance(b, dict)
            and a.keys() == b.keys()
            and all(identical(a[key], b[key]) for key in a)
        )
    if isinstance(a, (tuple, list)):
        return len(a) == len(b) and all(identical(x, y) for x, y in zip(a, b, strict=True))
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype != b.dtype or a.shape != b.shape:
        return False
    if a.dtype == object and a.ndim == 0:  # such as None, where a row has no last observation
        return bool(a == b)
    if a.dtype == object:
        return all(identical(x, y) for x, y in zip(a.ravel(), b.ravel(), strict=True))
    return a.tobytes() == b.tobytes()


def random_actions(envs: Any, steps: int, largest: float = 1.2) -> Any:
    """Actions of a vector environment, uniform up to a largest one. Shape (steps, N, n)."""
    return np.random.default_rng(1).uniform(-largest, largest, (steps, *envs.action_space.shape)).astype(np.float32)


def played_alike(native: Any, sync: Any, actions: Any) -> list[Any]:
    """Plays actions in two vector environments, all of whose returned values have to be the same bit for bit.

    Args:
        native: The native one.
        sync: Gymnasium's, of single ones, in the same autoreset mode. Ended rows are reset where the mode does not.
        actions: Of each step. Shape (steps, N, n).

    Returns:
        The values that each step has returned.
    """
    assert native.metadata["autoreset_mode"] is native.autoreset_mode is sync.autoreset_mode  # TorchRL asks for either
    for name in ("observation_space", "action_space", "single_observation_space", "single_action_space"):
        assert getattr(native, name) == getattr(sync, name)
    assert identical(native.reset(seed=11), sync.reset(seed=11))
    returned = []
    for action in actions:
        returned.append(native.step(action))
        assert identical(returned[-1], sync.step(action))
        seen, _, terminated, truncated, _ = returned[-1]
        assert native.observation_space.contains(seen)
        ended = terminated | truncated
        if native.autoreset_mode is AutoresetMode.DISABLED and ended.any():
            assert identical(*(envs.reset(options={"reset_mask": ended.copy()}) for envs in (native, sync)))
    return returned


def fields(part: Any) -> Any:
    """All that a part is made of, in plain values."""
    if dataclasses.is_dataclass(part):
        return [
            type(part).__name__,
            {f.name: fields(getattr(part, f.name)) for f in dataclasses.fields(part) if f.init},
        ]
    if isinstance(part, tuple) and part and dataclasses.is_dataclass(part[0]):
        return [fields(one) for one in part]
    return "None" if part is None else part
