"""All policies by name: where the class of each is found, which is imported when it is first asked for.

As text a policy is ``"dls"``, ``"dls:damping=1e-2"``, ``"agent:PATH"`` or ``"package.module:Class:gain=0.5"``.

Packages of others name theirs in the entry-point group :data:`GROUP`.
"""

from __future__ import annotations

import ast
import functools
import importlib.metadata
import inspect
import re
import sys
from collections.abc import Mapping
from typing import Any

from baselines.policy import SolverPolicy
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError, UnknownNameError
from ikgym.registry import IMPORT_PATH, check_import_path, import_object
from ikgym.scenarios import Scenario
from ikgym.validation import known_names

#: The entry points that other packages register policies by: ``name = "module:Class"``.
GROUP = "ikgym.policies"

#: A policy as text, or its name and its parameters.
PolicySpec = str | tuple[str, Mapping[str, Any]]

_SOLVERS = "baselines.solvers"

#: Names, in the order of tables, and where their classes are.
_import_paths: dict[str, str] = {
    "moore_penrose": f"{_SOLVERS}.resolved_rate.moore_penrose:MoorePenrose",
    "dls": f"{_SOLVERS}.resolved_rate.dls:DampedLeastSquares",
    "jacobian_transpose": f"{_SOLVERS}.resolved_rate.jacobian_transpose:JacobianTranspose",
    "weighted_pseudoinverse": f"{_SOLVERS}.resolved_rate.weighted_pseudoinverse:WeightedPseudoinverse",
    "null_space": f"{_SOLVERS}.resolved_rate.null_space:NullSpace",
    "truncated_svd": f"{_SOLVERS}.resolved_rate.truncated_svd:TruncatedSVD",
    "gram_schmidt": f"{_SOLVERS}.resolved_rate.gram_schmidt:GramSchmidt",
    "qp": f"{_SOLVERS}.quadratic_program.qp:QuadraticProgram",
    "qp_path": f"{_SOLVERS}.quadratic_program.path_following:PathFollowing",
    "sns": f"{_SOLVERS}.quadratic_program.sns:SaturationInNullSpace",
    "broyden": f"{_SOLVERS}.adaptive.broyden:Broyden",
    "offset_free": f"{_SOLVERS}.adaptive.offset_free:OffsetFree",
    "calibrated": f"{_SOLVERS}.adaptive.calibrated:Calibrated",
    "filter_bank": f"{_SOLVERS}.adaptive.filter_bank:FilterBank",
    "predicted": f"{_SOLVERS}.adaptive.predicted:Predicted",
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
    "agent_alone": "baselines.agents.policy:AgentAlone",
    "agent_track": "baselines.agents.policy:AgentTrack",
    "pink": f"{_SOLVERS}.rivals.task_program:Pink",
    "mink": f"{_SOLVERS}.rivals.task_program:Mink",
    "roboplan": f"{_SOLVERS}.rivals.oink:Roboplan",
    "follow_nominal": f"{_SOLVERS}.references.follow_nominal:FollowNominal",
    "oracle": "baselines.oracle.policy:Oracle",
}

#: Policies that need parameters, or suit some scenarios only, so that `all` leaves them out.
_incomplete: dict[str, str] = {
    "agent": "baselines.agents.policy:Agent",
    "published": f"{_SOLVERS}.references.published:Published",
    "told": f"{_SOLVERS}.references.told:Told",
}


def names() -> tuple[str, ...]:
    """The names of all policies that need no more than a scenario; nothing is imported for them."""
    return *_import_paths, *(name for name in _entry_points() if name not in _import_paths)


def register(name: str, import_path: str | type[SolverPolicy]) -> None:
    """Adds a policy. Results have the name that it is registered by, whatever the class calls itself.

    Args:
        name: Its new name.
        import_path: Where its class is, ``"package.module:Class"``, imported when it is first asked for; or the class.

    Raises:
        InvalidInputError: The name is taken or no name, the import path has another form, or the class is no policy.
    """
    if not isinstance(name, str) or not re.fullmatch(r"\w[\w.-]*", name):
        raise InvalidInputError(f"policy: expected a name of letters, digits, '_', '-' and '.', got {name!r}.")
    if name in names() or name in _incomplete:
        raise InvalidInputError(f"The policy {name!r} is registered already.")
    if isinstance(import_path, type):
        _classes[name] = check_class(import_path)
        _import_paths[name] = import_path_of(import_path)
    else:
        _import_paths[name] = check_import_path("policy", import_path)


def get(name: str) -> type[SolverPolicy]:
    """The class of a policy, by its name or its import path ``"package.module:Class"``.

    Raises:
        UnknownNameError: There is no such policy; the message has the nearest name.
        InvalidInputError: The class cannot be imported, or is no policy.
    """
    if not known(name):
        if isinstance(name, str) and ":" in name:
            return check_class(import_object("policy", name), name)
        raise UnknownNameError("policy", name, (*names(), *_incomplete))
    if name not in _classes:
        import_path = {**_entry_points(), **_import_paths, **_incomplete}[name]
        _classes[name] = check_class(import_object("policy", import_path), import_path)
    return _classes[name]


def known(name: object) -> bool:
    """Whether there is a policy of that name; nothing is imported to tell."""
    return isinstance(name, str) and (name in names() or name in _incomplete)


def name_of(kind: type[SolverPolicy]) -> str:
    """Name of a class in results: its name in the registry, else its import path."""
    import_path = import_path_of(kind)
    import_paths = {**_entry_points(), **_import_paths, **_incomplete}
    return next(
        (name for name, where in import_paths.items() if where == import_path and get(name) is kind), import_path
    )


def import_path_of(kind: type[Any]) -> str:
    """Import path of a class: ``"package.module:Class"``."""
    return f"{kind.__module__}:{kind.__qualname__}"


def find_imported(import_path: str) -> object:
    """The object at an import path whose module has been imported; None if it has not, or there is none."""
    module, _, attribute = import_path.partition(":")
    found: object = sys.modules.get(module)
    for name in attribute.split("."):
        found = getattr(found, name, None)
    return found


def make(name: str, scenario: str | Scenario, **parameters: Any) -> SolverPolicy:
    """A policy for a scenario.

    Args:
        name: One of :func:`names`, ``"agent"`` with the `path` of its file, or ``"package.module:Class"``.
        scenario: The tracking problem, as :func:`ikgym.scenarios.find` takes it. The policy is handed the scenario's
            model of the arm, not the arm itself.
        **parameters: Those of the policy, see its class.

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
    """Policies that other packages have registered, except those with the name of one of ours.

    Nothing is checked before it is asked for: one bad entry must not take the other policies away.
    """
    # Extras behind the import path, as in "module:Class [extra]", are for installers.
    return {one.name: one.value.partition("[")[0].strip() for one in importlib.metadata.entry_points(group=GROUP)}


def check_class(kind: object, import_path: str | None = None) -> type[SolverPolicy]:
    """The same class.

    Raises:
        InvalidInputError: It is none of policies, or is abstract.
    """
    if import_path is None:
        import_path = import_path_of(kind) if isinstance(kind, type) else repr(kind)
    if not (isinstance(kind, type) and issubclass(kind, SolverPolicy)):
        raise InvalidInputError(f"Policy {import_path!r}: expected a class derived from SolverPolicy, got {kind!r}.")
    if inspect.isabstract(kind):
        missing = ", ".join(sorted(kind.__abstractmethods__))
        raise InvalidInputError(f"Policy {import_path!r}: the class lacks {missing}.")
    return kind


def parse_policy(spec: PolicySpec) -> tuple[str, dict[str, Any]]:
    """Name or import path of a policy, and its parameters.

    Args:
        spec: ``"name"``, ``"name:parameter=value,parameter=value"`` or a pair of both; ``"agent:PATH"``, too. Instead
            of a name there may be an import path, ``"package.module:Class"``, which is not imported here. Values are
            Python's literals; anything else is taken for plain text.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The text has another form, or names a parameter twice.
    """
    if isinstance(spec, str):
        name, colon, text = (part.strip() for part in spec.partition(":"))
        attribute, more, rest = (part.strip() for part in text.partition(":"))
        if not known(name) and IMPORT_PATH.fullmatch(import_path := f"{name}:{attribute}"):
            return import_path, parse_parameters(rest, f"policy {spec!r}") if more else {}
        positional, accepted = get(name).positional, get(name).parameter_names()
        if positional is not None and text and text.partition("=")[0].strip() not in accepted:
            parameters: dict[str, Any] = {positional: text}
        else:
            parameters = parse_parameters(text, f"policy {spec!r}") if colon else {}
    elif isinstance(spec, tuple) and len(spec) == 2 and isinstance(spec[0], str) and isinstance(spec[1], Mapping):
        name, parameters = spec[0].strip(), dict(spec[1])
        if not known(name) and IMPORT_PATH.fullmatch(name):
            return name, parameters
    else:
        raise InvalidInputError(f"policy: expected 'name:parameter=value' or (name, parameters), got {spec!r}.")
    known_names(f"parameter of {name}", parameters, get(name).parameter_names())
    return name, parameters


def parse_parameters(text: str, source: str) -> dict[str, Any]:
    """Names and values of ``"name=value,name=value"``; values are Python's literals, anything else is plain text.

    Raises:
        InvalidInputError: The text has another form, or names one twice; the message begins with ``source``.
    """
    out: dict[str, Any] = {}
    for part in _split(text):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InvalidInputError(f"{source}: expected name=value,…, got {part.strip()!r}.")
        if name in out:
            raise InvalidInputError(f"{source}: {name!r} is given twice.")
        try:
            out[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
            out[name] = value
    return out


def _split(text: str) -> list[str]:
    """Parts between commas outside of brackets."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
