"""All policies by name: where the class of each is found, which is imported when it is first asked for.

Packages of others name theirs in the entry-point group :data:`GROUP`.
"""

from __future__ import annotations

import functools
import importlib
import importlib.metadata
import re
from typing import Any

from baselines.policy import SolverPolicy
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.scenarios import Scenario
from ikgym.validation import known_names

#: The entry points that other packages register policies by: ``name = "module:Class"``.
GROUP = "ikgym.policies"

_SOLVERS = "baselines.solvers"

#: Names, in the order of tables, and where their classes are.
_places: dict[str, str] = {
    "moore_penrose": f"{_SOLVERS}.resolved_rate.moore_penrose:MoorePenrose",
    "dls": f"{_SOLVERS}.resolved_rate.dls:DampedLeastSquares",
    "jacobian_transpose": f"{_SOLVERS}.resolved_rate.jacobian_transpose:JacobianTranspose",
    "weighted_pseudoinverse": f"{_SOLVERS}.resolved_rate.weighted_pseudoinverse:WeightedPseudoinverse",
    "null_space": f"{_SOLVERS}.resolved_rate.null_space:NullSpace",
    "truncated_svd": f"{_SOLVERS}.resolved_rate.truncated_svd:TruncatedSVD",
    "gram_schmidt": f"{_SOLVERS}.resolved_rate.gram_schmidt:GramSchmidt",
    "broyden": f"{_SOLVERS}.adaptive.broyden:Broyden",
    "rhc_gradient": f"{_SOLVERS}.receding_horizon.gradient:RecedingHorizonGradient",
    "rhc_lagrange": f"{_SOLVERS}.receding_horizon.lagrange:RecedingHorizonLagrange",
    "rhc": f"{_SOLVERS}.receding_horizon.rhc:RecedingHorizon",
    "rhc_foresight": f"{_SOLVERS}.receding_horizon.foresight:RecedingHorizonForesight",
    "smoothed": f"{_SOLVERS}.wrappers.smoothed:Smoothed",
    "full_orientation": f"{_SOLVERS}.wrappers.full_orientation:FullOrientation",
    "mfac": f"{_SOLVERS}.levenberg_marquardt.mfac:ModelFreeAdaptiveControl",
    "mfapc": f"{_SOLVERS}.levenberg_marquardt.mfapc:ModelFreeAdaptivePredictiveControl",
    "fixed_point": f"{_SOLVERS}.fixed_point.fixed_point:FixedPoint",
    "abstract_rotation": f"{_SOLVERS}.fixed_point.abstract_rotation:AbstractRotation",
    "agent_alone": "baselines.agents.shipped:AgentAlone",
    "agent_residual": "baselines.agents.shipped:AgentResidual",
    "fixed_point_extended": f"{_SOLVERS}.fixed_point.extended:FixedPointExtended",
    "follow_nominal": f"{_SOLVERS}.references.follow_nominal:FollowNominal",
    "oracle": "baselines.oracle.policy:Oracle",
}

#: Those that are nothing by their name alone, and so are no part of "all policies".
_incomplete: dict[str, str] = {"agent": "baselines.agents.policy:Agent"}


def names() -> tuple[str, ...]:
    """The names of all policies that need no more than a scenario; nothing is imported for them."""
    return *_places, *(name for name in _entry_points() if name not in _places)


def register(name: str, place: str | type[SolverPolicy]) -> None:
    """Adds a policy of your own.

    Args:
        name: Its new name.
        place: Where its class is, ``"package.module:Class"``, imported when it is first asked for; or the class.

    Raises:
        InvalidInputError: The name is taken or no name, or the place has another form.
    """
    if not isinstance(name, str) or not re.fullmatch(r"\w[\w.-]*", name):
        raise InvalidInputError(f"policy: expected a name of letters, digits, '_', '-' and '.', got {name!r}.")
    if name in names() or name in _incomplete:
        raise InvalidInputError(f"The policy {name!r} is registered already.")
    if isinstance(place, type):
        where = f"{place.__module__}:{place.__qualname__}"
        _classes[name] = _policy(where, place)
        place = where
    _places[name] = _checked(name, place)


def get(name: str) -> type[SolverPolicy]:
    """The class of a policy.

    Raises:
        UnknownNameError: There is no such policy; the message has the nearest name.
        InvalidInputError: What it was registered with cannot be imported, or is no policy.
    """
    if name in _classes:
        return _classes[name]
    known = {**_entry_points(), **_places, **_incomplete}
    if not isinstance(name, str) or name not in known:
        raise UnknownNameError("policy", name, known)
    kind = _classes[name] = resolve(known[name])
    return kind


def resolve(place: str) -> type[SolverPolicy]:
    """The class at a place.

    Args:
        place: ``"package.module:Class"``.

    Raises:
        InvalidInputError: It cannot be imported, or is no class of policies.
    """
    module, _, attribute = place.partition(":")
    try:
        kind = functools.reduce(getattr, attribute.split("."), importlib.import_module(module))
    except (ImportError, AttributeError) as e:
        raise InvalidInputError(f"Policy {place!r}: cannot be imported: {e}.") from None
    return _policy(place, kind)


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
    return policy.for_scenario(scenarios.find(scenario), **parameters)


#: Classes that have been asked for.
_classes: dict[str, type[SolverPolicy]] = {}


@functools.cache
def _entry_points() -> dict[str, str]:
    """What other packages have registered; what has the name of one of ours is theirs to rename."""
    found = importlib.metadata.entry_points(group=GROUP)
    return {one.name: _checked(one.name, one.value) for one in found}


def _policy(place: str, kind: object) -> type[SolverPolicy]:
    if not (isinstance(kind, type) and issubclass(kind, SolverPolicy)):
        raise InvalidInputError(f"Policy {place!r}: expected a class derived from SolverPolicy, got {kind!r}.")
    return kind


def _checked(name: str, place: object) -> str:
    if not isinstance(place, str) or not re.fullmatch(r"[\w.]+:[\w.]+", place):
        raise InvalidInputError(f"Policy {name!r}: expected 'package.module:Class', got {place!r}.")
    return place
