"""What a result was measured on."""

from __future__ import annotations

import functools
import pathlib
import platform
from typing import Any

import numba
import numpy as np

import ikgym
from ikgym.parallel import cores


@functools.cache
def _cpu() -> str:
    try:
        for line in pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.partition(":")[2].strip()
    except OSError:
        pass  # no Linux
    return platform.processor() or platform.machine() or "unknown"


def describe() -> dict[str, Any]:
    """CPU, the cores that this process may use, and the versions that matter to a number."""
    return {
        "cpu": _cpu(),
        "cores": cores(),
        "system": platform.system(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "numba": numba.__version__,
        "ikgym": ikgym.__version__,
    }
