"""Baselines of ikgym: solvers of inverse kinematics as policies, their evaluation, and references.

>>> import baselines
>>> policy = baselines.make("qp", "varga7-fast")

`baselines.evaluate.evaluate`, `baselines.track` and `baselines.Controller` are imported when they are first used.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from baselines.policy import SolverPolicy
from baselines.registry import get, make, names, register
from baselines.status import Status

if TYPE_CHECKING:
    from baselines.controller import Controller, Drives, Guards, StopReason
    from baselines.evaluation.tracking import track

__all__ = [
    "Controller",
    "Drives",
    "Guards",
    "SolverPolicy",
    "Status",
    "StopReason",
    "get",
    "make",
    "names",
    "register",
    "track",
]

#: Names that are imported when they are first used, and their modules.
_LATER = {"track": "evaluation.tracking"}
_LATER |= dict.fromkeys(("Controller", "Drives", "Guards", "StopReason"), "controller")


def __getattr__(name: str) -> Any:
    """Modules and names that are imported when they are first used."""
    if name in {"controller", "evaluate"}:
        return importlib.import_module(f"baselines.{name}")
    if name in _LATER:
        return getattr(importlib.import_module(f"baselines.{_LATER[name]}"), name)
    raise AttributeError(f"module 'baselines' has no attribute {name!r}")
