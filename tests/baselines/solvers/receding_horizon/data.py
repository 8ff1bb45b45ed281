"""What the kernels are told of a scenario."""

from __future__ import annotations

from baselines.solvers.receding_horizon.problem_data import ProblemData


def data_of(problem) -> ProblemData:
    """Of a scenario or a problem."""
    model, cost = problem.model, problem.cost.parameters
    return ProblemData(
        model.chain, problem.task.kind, cost, problem.dt, model.lower, model.upper, problem.velocity_limit
    )
