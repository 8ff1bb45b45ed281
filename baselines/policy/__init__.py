"""Building blocks of policies: base class, problem, observations, memory and solution."""

from __future__ import annotations

from baselines.policy.arguments import Report
from baselines.policy.problem import Problem
from baselines.policy.solver import SolverPolicy
from baselines.policy_kernels import Batch, Memory, Solution
from baselines.status import Status, statuses
from ikgym.simulator import Observation

__all__ = (
    "Batch",
    "Memory",
    "Observation",
    "Problem",
    "Report",
    "Solution",
    "SolverPolicy",
    "Status",
    "statuses",
)
