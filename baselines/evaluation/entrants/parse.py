"""Who is meant: policies by name, specification, class, instance or place, and whatever has such a `predict`."""

from __future__ import annotations

import dataclasses
import pickle
import sys
from collections.abc import Iterable, Mapping
from typing import Any, Final

from baselines import registry
from baselines.evaluation.entrants.base import Entrant
from baselines.evaluation.entrants.foreign import Predictor, Wrap
from baselines.evaluation.entrants.predictors import ForeignEntrant
from baselines.evaluation.entrants.solvers import BrokenEntrant, InstanceEntrant, SolverEntrant
from baselines.policy import SolverPolicy
from baselines.spec import PolicySpec, parse_place, parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names

#: Stands for all policies, or all scenarios.
ALL: Final = "all"

#: One policy, in whatever way it may be said: see :func:`entrants`.
AnyPolicy = PolicySpec | type[Any] | Predictor | SolverPolicy | tuple[type[Any], Mapping[str, Any]]


def entrants(given: AnyPolicy | Iterable[AnyPolicy], *, trust: bool = False, wrap: Wrap | None = None) -> list[Entrant]:
    """All who are evaluated.

    Args:
        given: Names, ``"name:parameter=value"``, ``"package.module:Class"`` with or without parameters, pairs of one of
            them or of a class and parameters, classes and instances of policies, and objects with the `predict` of
            Stable-Baselines3; ``"all"`` stands for all that are registered.
        trust: Whether the files of all agents given are trusted.
        wrap: Wraps the environment for those that are no :class:`SolverPolicy`.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: Something is no policy, cannot be imported, or there is nobody to wrap the environment for.
    """
    out: list[Entrant] = []
    objects: dict[int, Entrant] = {}
    items: Iterable[Any] = (given,) if _single(given) else given  # type: ignore[assignment]  # is iterable then
    for item in items:
        if isinstance(item, str) and item == ALL:
            out.extend(map(_registered, registry.names()))
        elif not _is_object(item):
            out.append(entrant(item, wrap=wrap))
        elif id(item) not in objects:
            found = entrant(item, wrap=wrap)
            taken = {one.name for one in (*out, *objects.values())}
            if isinstance(found, ForeignEntrant):
                found = dataclasses.replace(found, name=_unique(found.name, taken))
            objects[id(item)] = found
            out.append(found)
    if wrap is not None and not any(isinstance(one, ForeignEntrant) for one in out):
        raise InvalidInputError("wrap: expected a policy that it is for; a SolverPolicy plays what is not wrapped.")
    return [_trusting(one) if trust else one for one in out]


def entrant(item: AnyPolicy, *, wrap: Wrap | None = None) -> Entrant:
    """Who is meant by one policy, see :func:`entrants`."""
    if isinstance(item, SolverPolicy):
        return InstanceEntrant(registry.name_of(type(item)), item)
    if _is_object(item):
        return ForeignEntrant(type(item).__name__, item, {}, wrap)
    if isinstance(item, type):
        return _of_class(item, {}, wrap)
    if isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], type) and isinstance(item[1], Mapping):
        return _of_class(item[0], item[1], wrap)
    if (found := parse_place(item)) is not None:
        place, parameters = found
        content = registry.load(place)
        if isinstance(content, type) and issubclass(content, SolverPolicy):
            return _of_class(registry.resolve(place), parameters, wrap)
        return ForeignEntrant(place, place, parameters, wrap)
    if not isinstance(item, (str, tuple)):
        raise InvalidInputError(
            "policy: expected a name, 'package.module:Class', a class, or something with the predict of "
            f"Stable-Baselines3, got {item!r}."
        )
    name, parameters = parse_policy(item)
    return SolverEntrant(name, registry.get(name), parameters)


def check_sendable(all_of: Iterable[Entrant]) -> None:
    """Sees to it that policies can go to worker processes.

    Raises:
        InvalidInputError: One cannot.
    """
    for one in all_of:
        try:
            pickle.dumps(one)
        except Exception as e:  # pickling runs code of somebody else
            raise InvalidInputError(f"{one.name} cannot be sent to worker processes ({e}): use one worker.") from e
        made_of = one.kind if isinstance(one, SolverEntrant) else type(getattr(one, "model", one))
        if made_of.__module__ == "__main__" and not hasattr(sys.modules["__main__"], "__file__"):
            raise InvalidInputError(
                f"{one.name} cannot be sent to worker processes, as its class is in no file: use one worker."
            )


def _of_class(kind: type[Any], parameters: Mapping[str, Any], wrap: Wrap | None) -> Entrant:
    if issubclass(kind, SolverPolicy):
        name, kind = registry.name_of(kind), registry.checked_class(kind)
        known_names(f"parameter of {name}", parameters, kind.parameter_names())
        return SolverEntrant(name, kind, dict(parameters))
    if not callable(getattr(kind, "predict", None)):
        raise InvalidInputError(f"policy: expected a class with the predict of Stable-Baselines3, got {kind!r}.")
    return ForeignEntrant(registry.place_of(kind), kind, dict(parameters), wrap)


def _registered(name: str) -> Entrant:
    """One of all policies, whether or not it can be imported."""
    try:
        return SolverEntrant(name, registry.get(name), {})
    except InvalidInputError as e:
        return BrokenEntrant(name, str(e))


def _trusting(one: Entrant) -> Entrant:
    """The same, with the trust in its file for a policy that asks for it."""
    if isinstance(one, SolverEntrant) and "trust" in one.kind.parameter_names():
        return dataclasses.replace(one, given={"trust": True, **one.given})
    return one


def _single(given: Any) -> bool:
    if isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping):
        return True
    return isinstance(given, (str, type)) or _is_object(given) or not isinstance(given, Iterable)


def _is_object(item: Any) -> bool:
    return not isinstance(item, type) and callable(getattr(item, "predict", None))


def _unique(name: str, taken: Iterable[str]) -> str:
    """A name that no other policy has."""
    used = {*taken, *registry.names()}
    numbered = (name if number == 1 else f"{name}-{number}" for number in range(1, len(used) + 2))
    return next(one for one in numbered if one not in used)
