"""All forms in which a user can give a policy: name, text with parameters, class, instance, import path, object."""

from __future__ import annotations

import dataclasses
import pickle
import sys
from collections.abc import Iterable, Mapping
from typing import Any, Final

from baselines import registry
from baselines.evaluation.foreign import Predictor, Wrap
from baselines.evaluation.specification import Specification, shown_preview
from baselines.policy import SolverPolicy
from baselines.recording import Seeds
from baselines.spec import PolicySpec, parse_place, parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import known_names

#: Stands for all registered policies, or all scenarios.
ALL: Final = "all"

#: A policy in any form that :func:`specifications` accepts.
AnyPolicy = PolicySpec | type[Any] | Predictor | SolverPolicy | tuple[type[Any], Mapping[str, Any]]


def specifications(given: AnyPolicy | Iterable[AnyPolicy], *, wrap: Wrap | None = None) -> list[Specification]:
    """All policies of an evaluation, in the forms that :func:`baselines.evaluate.evaluate` takes.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: Something is not a policy or cannot be imported, or no policy uses `wrap`.
    """
    out: list[Specification] = []
    objects: dict[int, Specification] = {}
    items: Iterable[Any] = (given,) if _single(given) else given  # type: ignore[assignment]  # is iterable then
    for item in items:
        if isinstance(item, str) and item == ALL:
            out.extend(map(_registered, registry.names()))
        elif not _is_object(item):
            out.append(specification(item, wrap=wrap))
        elif id(item) not in objects:
            found = specification(item, wrap=wrap)
            if found.foreign:
                found = dataclasses.replace(found, name=_unique(found.name, (one.name for one in out)))
            objects[id(item)] = found
            out.append(found)
    if wrap is not None and not any(one.foreign for one in out):
        raise InvalidInputError("wrap: expected a policy that uses it; a SolverPolicy plays without wrappers.")
    return out


def specification(item: AnyPolicy, *, wrap: Wrap | None = None) -> Specification:
    """One policy, see :func:`specifications`."""
    if isinstance(item, SolverPolicy):
        return Specification(registry.name_of(type(item)), item)
    if _is_object(item):
        return Specification(type(item).__name__, item, {}, wrap)
    if isinstance(item, type):
        return _of_class(item, {}, wrap)
    if isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], type) and isinstance(item[1], Mapping):
        return _of_class(item[0], item[1], wrap)
    if (found := parse_place(item)) is not None:
        import_path, parameters = found
        content = registry.load(import_path)
        if isinstance(content, type) and issubclass(content, SolverPolicy):
            return _of_class(registry.resolve(import_path), parameters, wrap)
        return Specification(import_path, import_path, parameters, wrap)
    if not isinstance(item, (str, tuple)):
        raise InvalidInputError(
            "policy: expected a name, 'package.module:Class', a class, or an object with the predict of "
            f"Stable-Baselines3, got {item!r}."
        )
    name, parameters = parse_policy(item)
    return Specification(name, registry.get(name), parameters)


def bind(
    policy: AnyPolicy, scenario: Scenario, seeds: Seeds, preview: Preview | None = None, wrap: Wrap | None = None
) -> tuple[Specification, dict[str, Any], Preview]:
    """The specification of a policy for one episode, its parameters, and the steps ahead that it is shown.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The policy does not suit the scenario, or is shown too little.
    """
    one = specification(policy, wrap=wrap)
    if reason := one.unsuited(scenario, seeds, preview):
        raise InvalidInputError(f"{one.name} does not suit {scenario.name}: {reason}")
    bound = one.bind(scenario, one.given(scenario, seeds), preview)
    return one, one.parameters(scenario, bound), shown_preview(bound, preview)


def check_picklable(all_of: Iterable[Specification]) -> None:
    """Refuses policies that cannot be sent to worker processes."""
    for one in all_of:
        try:
            pickle.dumps(one)
        except Exception as e:  # pickling runs code of the user's
            raise InvalidInputError(f"{one.name} cannot be sent to worker processes ({e}): use one worker.") from e
        kind = one.solver or type(one.model)
        if getattr(kind, "__module__", "") == "__main__" and not hasattr(sys.modules["__main__"], "__file__"):
            raise InvalidInputError(
                f"{one.name} cannot be sent to worker processes, because its class is in no file: use one worker."
            )


def _of_class(kind: type[Any], parameters: Mapping[str, Any], wrap: Wrap | None) -> Specification:
    if issubclass(kind, SolverPolicy):
        name, kind = registry.name_of(kind), registry.checked_class(kind)
        known_names(f"parameter of {name}", parameters, kind.parameter_names())
        return Specification(name, kind, dict(parameters))
    if not callable(getattr(kind, "predict", None)):
        raise InvalidInputError(f"policy: expected a class with the predict of Stable-Baselines3, got {kind!r}.")
    return Specification(registry.place_of(kind), kind, dict(parameters), wrap)


def _registered(name: str) -> Specification:
    """One of all registered policies; one that cannot be imported is no reason to leave the others out."""
    try:
        return Specification(name, registry.get(name))
    except InvalidInputError as e:
        return Specification(name, None, missing=str(e))


def _single(given: Any) -> bool:
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping):
        return True
    return isinstance(given, (str, type)) or _is_object(given) or not isinstance(given, Iterable)


def _is_object(item: Any) -> bool:
    return not isinstance(item, type) and callable(getattr(item, "predict", None))


def _unique(name: str, taken: Iterable[str]) -> str:
    """The name, numbered if another policy has it."""
    used = {*taken, *registry.names()}
    numbered = (name if number == 1 else f"{name}-{number}" for number in range(1, len(used) + 2))
    return next(one for one in numbered if one not in used)
