"""Parameters and results as JSON, and equal texts for equal values."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

import numpy as np


def canonical(value: object) -> str:
    """Equal JSON texts for equal values."""
    return json.dumps(value, sort_keys=True, ensure_ascii=False)


def jsonable(value: Any) -> Any:
    """A parameter's value as JSON has it; what JSON does not know becomes text."""
    if isinstance(value, (np.ndarray, np.generic)):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [jsonable(item) for item in value]
    if isinstance(value, Mapping):
        return {str(name): jsonable(item) for name, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else repr(value)
