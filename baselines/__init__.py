"""Baselines of ikgym: solvers of inverse kinematics as policies, their evaluation, and references.

>>> import baselines
>>> policy = baselines.make("dls", "varga7-fast")
"""

from __future__ import annotations

from baselines.policy import SolverPolicy
from baselines.registry import get, make, names, register
from baselines.status import Status

__all__ = ["SolverPolicy", "Status", "get", "make", "names", "register"]
