"""Baselines of ikgym: solvers of inverse kinematics as policies, their evaluation, and references.

>>> import baselines
>>> policy = baselines.make("qp", "varga7-fast")

`baselines.evaluate.evaluate` and `baselines.track` are imported when they are first used.
"""

from __future__ import annotations

import importlib
from types import ModuleType
from typing import TYPE_CHECKING, Any

from baselines.policy import SolverPolicy
from baselines.registry import get, make, names, register
from baselines.status import Status

if TYPE_CHECKING:
    from baselines.evaluation.foreign import Wrap
    from baselines.evaluation.tracking import Tracking
    from ikgym.scenarios import Preview, Scenario

__all__ = ["SolverPolicy", "Status", "get", "make", "names", "register", "track"]


def track(
    scenario: str | Scenario,
    policy: Any,
    *,
    seed: int = 0,
    preview: Preview | None = None,
    steps: int | None = None,
    wrap: Wrap | None = None,
) -> Tracking:
    """Plays one episode, see :func:`baselines.evaluation.tracking.track`."""
    from baselines.evaluation import tracking

    return tracking.track(scenario, policy, seed=seed, preview=preview, steps=steps, wrap=wrap)


def __getattr__(name: str) -> ModuleType:
    """Modules of the package that are imported when they are first used."""
    if name in {"controller", "evaluate"}:
        return importlib.import_module(f"baselines.{name}")
    raise AttributeError(f"module 'baselines' has no attribute {name!r}")
