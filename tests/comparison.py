"""Exact comparison of whatever environments return."""

import dataclasses
from typing import Any

import numpy as np


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
