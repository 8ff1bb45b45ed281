"""Who is evaluated: policies by name, specification, class, instance or place, and whatever has such a `predict`."""

from __future__ import annotations

import abc
import dataclasses
import inspect
import pickle
import sys
from collections.abc import Iterable, Mapping
from typing import Any, Final, cast

from baselines import registry
from baselines.canonical import jsonable
from baselines.evaluation.foreign import ForeignPolicy, Predictor, Wrap
from baselines.evaluation.rollout import Player
from baselines.fingerprints import same
from baselines.policy import Problem, SolverPolicy
from baselines.spec import PolicySpec, parse_place, parse_policy
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.simulator import offsets
from ikgym.validation import known_names

#: Stands for all policies, or all scenarios.
ALL: Final = "all"

#: One policy, in whatever way it may be said: see :func:`entrants`.
AnyPolicy = PolicySpec | type[Any] | Predictor | SolverPolicy | tuple[type[Any], Mapping[str, Any]]


@dataclasses.dataclass(frozen=True, eq=False)
class Entrant(abc.ABC):
    """Who is evaluated, before it is made for a scenario.

    Args:
        name: What rows call it.
    """

    name: str

    #: Whether rows tell it from another one of its name, so that results of both cannot be taken for each other.
    told_apart = True

    def for_episode(self, scenario: Scenario, seed: int) -> dict[str, Any]:
        """The parameters that it is made with for one episode."""
        del scenario, seed
        return {}

    @abc.abstractmethod
    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Player:
        """Who plays, made with what :meth:`for_episode` gave.

        Raises:
            IkgymError: It cannot be made.
        """

    @abc.abstractmethod
    def parameters(self, scenario: Scenario, player: Player) -> dict[str, Any]:
        """The parameters that rows have."""

    @abc.abstractmethod
    def unsuited(self, scenario: Scenario, seed: int, preview: Preview | None) -> str | None:
        """Why it does not suit a scenario; None where it does."""

    @abc.abstractmethod
    def shown(self, player: Player, preview: Preview | None) -> Preview:
        """The steps ahead that it is shown.

        Raises:
            InvalidInputError: They are not those that it needs.
        """


@dataclasses.dataclass(frozen=True, eq=False)
class SolverEntrant(Entrant):
    """A class of policies with its parameters.

    Args:
        name: What rows call it.
        kind: The class.
        given: The parameters that it is made with.
    """

    kind: type[SolverPolicy]
    given: Mapping[str, Any]

    def for_episode(self, scenario: Scenario, seed: int) -> dict[str, Any]:
        """The parameters, with the episode's seed for a reference that has to know which one it plays."""
        return {**self._seeded(scenario, seed), **self.given}

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> SolverPolicy:
        """See :meth:`Entrant.make`."""
        del preview
        return self.kind.for_scenario(scenario, **given)

    def parameters(self, scenario: Scenario, player: Player) -> dict[str, Any]:
        """All parameters, but for the seed that a reference was given for its episode."""
        assert isinstance(player, SolverPolicy)
        hidden = self._seeded(scenario, 0).keys() - self.given.keys()
        return {name: jsonable(value) for name, value in player.parameters.items() if name not in hidden}

    def unsuited(self, scenario: Scenario, seed: int, preview: Preview | None) -> str | None:
        """See :meth:`Entrant.unsuited`; a policy that is refused with other parameters only is not unsuited."""
        decisive = {key: self.given[key] for key in self.kind.decisive if key in self.given}
        try:
            self.make(scenario, {**self._seeded(scenario, seed), **decisive}, preview)
        except InvalidInputError as e:
            return str(e)
        return None

    def shown(self, player: Player, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        return covering(player, preview)

    def _seeded(self, scenario: Scenario, seed: int) -> dict[str, Any]:
        asks = scenario.random and self.kind.reference and "seed" in self.kind.parameter_names()
        return {"seed": seed} if asks else {}


@dataclasses.dataclass(frozen=True, eq=False)
class InstanceEntrant(Entrant):
    """A policy that has been made for a scenario already.

    Args:
        name: What rows call it.
        policy: The policy.
    """

    policy: SolverPolicy

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> SolverPolicy:
        """See :meth:`Entrant.make`."""
        del scenario, given, preview
        return self.policy

    def parameters(self, scenario: Scenario, player: Player) -> dict[str, Any]:
        """All parameters."""
        del scenario, player
        return {name: jsonable(value) for name, value in self.policy.parameters.items()}

    def unsuited(self, scenario: Scenario, seed: int, preview: Preview | None) -> str | None:
        """See :meth:`Entrant.unsuited`."""
        del seed, preview
        if self.policy.reference and scenario.random:
            return f"{self.name} has privileged information on one episode: give its name, not an instance of it."
        mine, there = self.policy.problem, Problem.of(scenario)
        for field in dataclasses.fields(Problem):
            if not same(getattr(mine, field.name), getattr(there, field.name)):
                return f"{self.name} was made for a scenario with another {field.name}."
        return None

    def shown(self, player: Player, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        return covering(player, preview)


class _RefusedError(InvalidInputError):
    """What makes a policy says that the scenario does not suit it."""


@dataclasses.dataclass(frozen=True, eq=False)
class ForeignEntrant(Entrant):
    """Something with the `predict` of Stable-Baselines3, or what makes such a thing.

    Args:
        name: What rows call it.
        model: The object, a class or factory of such objects, or where one of them is: ``"package.module:Class"``.
        given: The parameters that a class or factory is called with.
        wrap: Wraps the environment.
    """

    model: Any
    given: Mapping[str, Any]
    wrap: Wrap | None = None

    @property
    def told_apart(self) -> bool:  # type: ignore[override]  # of a class this is known, of an object it is not
        """Objects are not told from others of their class; places and classes are."""
        return isinstance(self.model, (str, type))

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Player:
        """See :meth:`Entrant.make`.

        Raises:
            InvalidInputError: It cannot be imported or made, has no `predict`, or nobody says what it is to be shown.
        """
        del given
        model = registry.load(self.model) if isinstance(self.model, str) else self.model
        if isinstance(model, type) or not callable(getattr(model, "predict", None)):
            model = self._called(model, scenario)
        if isinstance(model, SolverPolicy):
            if reason := InstanceEntrant(self.name, model).unsuited(scenario, 0, preview):
                raise _RefusedError(reason)
            return model
        if not callable(getattr(model, "predict", None)):
            raise InvalidInputError(f"Policy {self.name!r}: expected something with a predict, got {model!r}.")
        known = getattr(model, "parameters", None)
        own = self.given or (known if isinstance(known, Mapping) else {})
        return ForeignPolicy(self.name, cast(Predictor, model), self._preview(model, preview), self.wrap, jsonable(own))

    def parameters(self, scenario: Scenario, player: Player) -> dict[str, Any]:
        """Those that are known."""
        del scenario
        return dict(jsonable(getattr(player, "parameters")))  # noqa: B009

    def unsuited(self, scenario: Scenario, seed: int, preview: Preview | None) -> str | None:
        """See :meth:`Entrant.unsuited`."""
        del seed
        try:
            player = self.make(scenario, {}, preview)
        except _RefusedError as e:
            return str(e)
        return player.misfit(scenario) if isinstance(player, ForeignPolicy) else None

    def shown(self, player: Player, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        return covering(player, preview) if isinstance(player, SolverPolicy) else player.preview

    def _called(self, factory: Any, scenario: Scenario) -> Any:
        """What a class or factory makes; one that must be given something is given the scenario."""
        if not callable(factory):
            raise InvalidInputError(
                f"Policy {self.name!r}: expected a class derived from SolverPolicy, something with a predict, or what "
                f"makes one, got {factory!r}."
            )
        try:
            return factory(*([scenario] if _asks(factory, self.given) else []), **self.given)
        except InvalidInputError as e:
            raise _RefusedError(str(e)) from e
        except Exception as e:  # whatever the code of somebody else raises
            raise InvalidInputError(f"Policy {self.name!r}: cannot be made: {type(e).__name__}: {e}.") from e

    def _preview(self, model: Any, preview: Preview | None) -> Preview:
        own = getattr(model, "preview", None) if preview is None else preview
        if own is None:
            raise InvalidInputError(
                f"Policy {self.name!r}: nobody says how many steps ahead it is to be shown. Give preview=…, or give "
                "the object an attribute preview: a number, or the steps such as (1, 10, 40)."
            )
        try:
            offsets(own)
        except InvalidInputError as e:
            raise InvalidInputError(f"Policy {self.name!r}: {e}") from None
        shown: Preview = own
        return shown


@dataclasses.dataclass(frozen=True, eq=False)
class BrokenEntrant(Entrant):
    """A registered policy that cannot be imported: one of all, and no reason to leave the others out.

    Args:
        name: What rows call it.
        reason: Why not.
    """

    reason: str

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Player:
        """See :meth:`Entrant.make`."""
        raise InvalidInputError(self.reason)

    def parameters(self, scenario: Scenario, player: Player) -> dict[str, Any]:
        """None."""
        raise InvalidInputError(self.reason)

    def unsuited(self, scenario: Scenario, seed: int, preview: Preview | None) -> str:
        """See :meth:`Entrant.unsuited`."""
        return self.reason

    def shown(self, player: Player, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        raise InvalidInputError(self.reason)


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


def covering(player: Player, preview: Preview | None) -> Preview:
    """What a solver is shown: what it asks for, or something that has it in the place where it looks for it.

    Raises:
        InvalidInputError: Steps ahead that are no whole range are not those that it asks for.
    """
    if preview is None or isinstance(preview, int):
        return player.preview if preview is None else preview
    needed, shown = offsets(player.preview), offsets(preview)
    if shown[: len(needed)] != needed or not (isinstance(player.preview, int) or shown == needed):
        raise InvalidInputError(f"{player.name} needs to be shown the steps {needed} ahead, got preview={preview}.")
    return preview


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


def _asks(factory: Any, given: Mapping[str, Any]) -> bool:
    """Whether a class or factory cannot be called without an argument."""
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):  # some that are written in C do not tell
        return False
    positional = {inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD}
    return any(
        one.kind in positional and one.name not in given and (one.default is one.empty or one.name == "scenario")
        for one in parameters
    )
