"""Solvers of the horizon problem behind one interface: policies of `baselines`, and those of others."""

from __future__ import annotations

import abc
import importlib
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

import baselines
from baselines.policy import Problem, SolverPolicy
from baselines.solvers.receding_horizon.rhc import RecedingHorizon
from baselines.status import Status
from benchmarks.rivals.numpy_horizon import Horizon, Plan, plan_cost
from ikgym.scenarios import Scenario
from ikgym.validation import FloatArray

Observation = dict[str, FloatArray]


class Answer(NamedTuple):
    """A plan and its cost.

    Attributes:
        q: Joint coordinates at the knots, in [rad] or [m]. Shape (K, n).
        cost: By :func:`benchmarks.rivals.numpy_horizon.plan_cost`, for all solvers alike.
        iterations: Iterations made.
        converged: Whether the solver reports convergence.
    """

    q: FloatArray
    cost: float
    iterations: int
    converged: bool


class HorizonSolver(abc.ABC):
    """A solver of the horizon with HL grid points in one scenario."""

    @abc.abstractmethod
    def warmed(self, observations: Sequence[Observation]) -> tuple[Callable[[], Any], Callable[[Any], Answer]]:
        """Solves all states but the last, each from the answer to the one before.

        Returns:
            The call that solves the last one, to be timed, and what makes an answer of its result.
        """


class PolicySolver(HorizonSolver):
    """A policy, whose `predict` is timed."""

    def __init__(self, policy: SolverPolicy) -> None:
        self.policy = policy

    def warmed(self, observations: Sequence[Observation]) -> tuple[Callable[[], Any], Callable[[Any], Answer]]:
        """See :meth:`HorizonSolver.warmed`."""
        state = None
        for observation in observations[:-1]:
            _, state = self.policy.predict(observation, state)
        last, problem = observations[-1], self.policy.problem

        def answer(result: Any) -> Answer:
            q = plan_of(self.policy, last, result[1])
            cost = plan_cost(problem, Horizon(last["q"], last["nominal"][: len(q)]), q)
            status, iterations = (int(array[0]) for array in self.policy.report(result[1]))
            return Answer(q, cost, iterations, status in (Status.CONVERGED, Status.SATURATED))

        return lambda: self.policy.predict(last, state), answer


class RivalSolver(HorizonSolver):
    """A solver of another library, which starts from its last plan, shifted by a step."""

    def __init__(self, rival: Any) -> None:
        self.rival = rival

    def warmed(self, observations: Sequence[Observation]) -> tuple[Callable[[], Any], Callable[[Any], Answer]]:
        """See :meth:`HorizonSolver.warmed`."""
        start = None
        *before, last = (Horizon(o["q"], o["nominal"][: self.rival.knots]) for o in observations)
        for horizon in before:
            q = self.rival.solve(horizon, start).q
            start = np.vstack([q[1:], q[-1:]])

        def answer(plan: Plan) -> Answer:
            return Answer(plan.q, plan.cost, plan.iterations, plan.converged)

        return lambda: self.rival.solve(last, start), answer


def plan_of(policy: SolverPolicy, observation: Observation, state: Any) -> FloatArray:
    """The joint coordinates at the knots of a policy's plan. Shape (K, n)."""
    if isinstance(policy, RecedingHorizon):
        plan: FloatArray = policy.plan(state)[0]
        return plan
    qdot: FloatArray = state[2][0]  # those of gradient descent are velocities
    out: FloatArray = observation["q"] + policy.problem.dt * np.cumsum(qdot, axis=0)
    return out


def policies(scenario: Scenario, grid: int) -> dict[str, HorizonSolver]:
    """The policies that plan over a horizon, by label."""
    return {
        label: PolicySolver(baselines.make(name, scenario, horizon=grid, **kwargs))
        for label, (name, kwargs, most) in POLICIES.items()
        if grid <= most
    }


def rivals(scenario: Scenario, grid: int) -> tuple[dict[str, HorizonSolver], tuple[str, ...]]:
    """Solvers of other libraries for the same problem, by label, and the missing ones."""
    out: dict[str, HorizonSolver] = {}
    skipped = []
    for label, (module, name, kwargs) in RIVALS.items():
        try:
            rival = getattr(importlib.import_module(f"benchmarks.rivals.{module}"), name)
        except ImportError as e:
            skipped.append(f'{label}: {e}; pip install "ikgym[rivals]"')
        else:
            out[label] = RivalSolver(rival(Problem.of(scenario), grid - 1, **kwargs))
    return out, tuple(skipped)


#: The exact solver, to which all times are compared.
EXACT = "rhc"
#: Label, name, parameters, and the longest horizon at which it does not take seconds.
POLICIES: dict[str, tuple[str, dict[str, Any], int]] = {
    EXACT: ("rhc", {}, 1000),
    "rhc, one Newton step a call": ("rhc", {"iterations": 1}, 1000),
    "rhc_gradient, analytic": ("rhc_gradient", {"gradient": "analytic", "tolerance": 0.0}, 1000),
    "rhc_gradient, differences": ("rhc_gradient", {"tolerance": 0.0}, 30),
}
RIVALS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "CasADi, IPOPT": ("casadi_horizon", "CasadiHorizon", {}),
    "Crocoddyl, FDDP": ("crocoddyl_horizon", "CrocoddylHorizon", {}),
}
