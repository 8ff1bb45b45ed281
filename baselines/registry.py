"""All policies by name."""

from __future__ import annotations

from typing import Any

from baselines.abstract_rotation import AbstractRotation
from baselines.agent.policy import Agent
from baselines.agent.shipped import SHIPPED
from baselines.broyden import Broyden
from baselines.dls import DampedLeastSquares
from baselines.fixed_point import FixedPoint
from baselines.fixed_point_extended import FixedPointExtended
from baselines.follow_nominal import FollowNominal
from baselines.gram_schmidt import GramSchmidt
from baselines.jacobian_transpose import JacobianTranspose
from baselines.mfac import ModelFreeAdaptiveControl
from baselines.mfapc import ModelFreeAdaptivePredictiveControl
from baselines.moore_penrose import MoorePenrose
from baselines.null_space import NullSpace
from baselines.oracle.policy import Oracle
from baselines.policy import SolverPolicy
from baselines.rhc import RecedingHorizon
from baselines.rhc_foresight import RecedingHorizonForesight
from baselines.rhc_gradient import RecedingHorizonGradient
from baselines.rhc_lagrange import RecedingHorizonLagrange
from baselines.smoothing import Smoothed
from baselines.truncated_svd import TruncatedSVD
from baselines.unfolded import Unfolded
from baselines.weighted_pseudoinverse import WeightedPseudoinverse
from ikgym import scenarios
from ikgym.exceptions import UnknownNameError
from ikgym.scenarios import Scenario
from ikgym.validation import known_names

_LISTED: tuple[type[SolverPolicy], ...] = (
    MoorePenrose,
    DampedLeastSquares,
    JacobianTranspose,
    WeightedPseudoinverse,
    NullSpace,
    TruncatedSVD,
    GramSchmidt,
    Broyden,
    RecedingHorizonGradient,
    RecedingHorizonLagrange,
    RecedingHorizon,
    RecedingHorizonForesight,
    Smoothed,
    Unfolded,
    ModelFreeAdaptiveControl,
    ModelFreeAdaptivePredictiveControl,
    FixedPoint,
    AbstractRotation,
    *SHIPPED.values(),
    FixedPointExtended,
    FollowNominal,
    Oracle,
)

POLICIES: dict[str, type[SolverPolicy]] = {policy.name: policy for policy in _LISTED}

#: Those that are nothing by their name alone, and so are no part of "all policies".
OTHERS: dict[str, type[SolverPolicy]] = {Agent.name: Agent}


def names() -> tuple[str, ...]:
    """The names of all policies that need no more than a scenario, agents that come with the package among them."""
    return tuple(POLICIES)


def get(name: str) -> type[SolverPolicy]:
    """The class of a policy.

    Raises:
        UnknownNameError: There is no such policy; the message has the nearest name.
    """
    known = {**POLICIES, **OTHERS}
    if not isinstance(name, str) or name not in known:
        raise UnknownNameError("policy", name, known)
    return known[name]


def make(name: str, scenario: str | Scenario, **parameters: Any) -> SolverPolicy:
    """A policy for a scenario.

    Args:
        name: One of :func:`names`, or ``"agent"`` with the `path` of its file.
        scenario: What is to be tracked, or its name. The policy is handed the scenario's model of the arm, not the
            arm itself.
        **parameters: The policy's own, see its class.

    Returns:
        The policy, with the `predict` of Stable-Baselines3.

    Raises:
        UnknownNameError: There is no such policy, scenario or parameter.
        InvalidInputError: A parameter is refused, or the policy does not suit the scenario.
    """
    policy = get(name)
    known_names(f"parameter of {name}", parameters, policy.parameter_names())
    resolved = scenario if isinstance(scenario, Scenario) else scenarios.get(scenario)
    return policy.for_scenario(resolved, **parameters)
