"""Parameters and results as JSON: equal texts for equal values, numbers of few digits."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np

#: Significant digits of costs that are kept.
DIGITS = 7


def canonical(value: object) -> str:
    """Equal JSON texts for equal values."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False)


def jsonable(value: Any) -> Any:
    """A value as JSON; types that JSON does not have become text."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): jsonable(item) for name, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else repr(value)


def round_digits(value: float, digits: int) -> float:
    """A number with some significant digits."""
    return float(f"{value:.{digits}g}")
