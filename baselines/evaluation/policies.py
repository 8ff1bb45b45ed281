"""All forms in which a user can give a policy, and policies bound to scenarios."""

from __future__ import annotations

import dataclasses
import inspect
import pickle
import sys
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Final, TypeAlias, cast

from baselines import registry
from baselines.episodes import Policy, Seeds
from baselines.files import jsonable
from baselines.fingerprints import same
from baselines.policy import Problem, SolverPolicy
from baselines.registry import PolicySpec, parse_policy
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.registry import import_object
from ikgym.scenarios import Preview, Scenario
from ikgym.scenarios.preview import offsets
from ikgym.validation import known_names

if TYPE_CHECKING:
    from baselines.evaluation.foreign import Predictor, Wrap

#: All registered policies, or all scenarios.
ALL: Final = "all"

#: A policy in any form that :func:`specifications` accepts.
AnyPolicy: TypeAlias = "PolicySpec | type[Any] | Predictor | SolverPolicy | tuple[type[Any], Mapping[str, Any]]"


class UnsuitedError(InvalidInputError):
    """A policy does not suit a scenario: it is skipped there."""


@dataclasses.dataclass(frozen=True, eq=False)
class Specification:
    """A policy that is not yet bound to a scenario.

    Args:
        name: Its name in rows.
        model: A class of solvers; a solver; an object with the `predict` of Stable-Baselines3; a class or factory of
            one, which is called with the chosen parameters; or the import path of any but the first.
        chosen: The user's parameters.
        wrap: Wraps the environment for a foreign policy.
        missing: Why a registered policy cannot be imported.
    """

    name: str
    model: Any
    chosen: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    wrap: Wrap | None = None
    missing: str = ""

    @property
    def solver(self) -> type[SolverPolicy] | None:
        """The class of solvers, if it is one."""
        return self.model if isinstance(self.model, type) and issubclass(self.model, SolverPolicy) else None

    @property
    def foreign(self) -> bool:
        """Whether it may be a foreign policy, which plays in wrappers."""
        return not (self.solver or self.missing or isinstance(self.model, SolverPolicy))

    @property
    def identifiable(self) -> bool:
        """Whether name and parameters identify the policy: two objects of one class may differ."""
        return bool(self.missing) or isinstance(self.model, (str, type, SolverPolicy))

    def arguments(self, scenario: Scenario, seeds: Seeds) -> dict[str, Any]:
        """The parameters of a solver for one episode: the user's, and the seeds that a reference needs to know it."""
        return {**self._seeds(scenario, seeds), **self.chosen} if self.solver else {}

    def per_episode(self, scenario: Scenario) -> bool:
        """Whether each episode needs a new policy, as with references that have privileged information."""
        return self.arguments(scenario, Seeds(0)) != self.arguments(scenario, Seeds(1))

    def bind(self, scenario: Scenario, seeds: Seeds, preview: Preview | None = None) -> Policy:
        """The policy for an episode of a scenario; a foreign one is shown the preview, or what it states if None.

        Raises:
            UnsuitedError: It does not suit the scenario, or its package is not installed.
            InvalidInputError: Parameters are refused, or it is no policy.
        """
        if self.missing:
            raise UnsuitedError(self.missing)
        if self.solver is not None:
            return self._bind_solver(self.solver, scenario, seeds)
        model = import_object("policy", self.model) if isinstance(self.model, str) else self.model
        if isinstance(model, type) or not callable(getattr(model, "predict", None)):
            model = self._call(model, scenario)
        if isinstance(model, SolverPolicy):
            if reason := _misfit(self.name, model, scenario):
                raise UnsuitedError(reason)
            return model
        if not callable(getattr(model, "predict", None)):
            raise InvalidInputError(f"Policy {self.name!r}: expected an object with a predict, got {model!r}.")
        from baselines.evaluation.foreign import ForeignPolicy

        known = getattr(model, "parameters", None)
        parameters = self.chosen or (known if isinstance(known, Mapping) else {})
        shown = self._preview(model, preview)
        policy = ForeignPolicy(self.name, cast("Predictor", model), shown, jsonable(parameters))
        if reason := policy.misfit(scenario, self.wrap):
            raise UnsuitedError(reason)
        return policy

    def parameters(self, scenario: Scenario, policy: Policy) -> dict[str, Any]:
        """The parameters of the bound policy for rows: all except the seeds of the episode."""
        values: Mapping[str, Any] = getattr(policy, "parameters")  # noqa: B009
        hidden = self._seeds(scenario, Seeds(0, values.get("arm_seed"))).keys() - self.chosen.keys()
        return {name: jsonable(value) for name, value in values.items() if name not in hidden}

    def _bind_solver(self, solver: type[SolverPolicy], scenario: Scenario, seeds: Seeds) -> SolverPolicy:
        """A refused parameter is an error of the user's, unless the policy would not suit the scenario without it."""
        try:
            return solver.for_scenario(scenario, **self.arguments(scenario, seeds))
        except (InvalidInputError, MissingDependencyError):
            decisive = {name: self.chosen[name] for name in solver.decisive if name in self.chosen}
            try:
                solver.for_scenario(scenario, **{**self._seeds(scenario, seeds), **decisive})
            except (InvalidInputError, MissingDependencyError) as e:
                raise UnsuitedError(str(e)) from e
            raise

    def _seeds(self, scenario: Scenario, seeds: Seeds) -> dict[str, Any]:
        """The seeds that a reference takes as parameters."""
        if self.solver is None or not self.solver.reference:
            return {}
        drawn = {"seed": scenario.varies, "arm_seed": seeds.arm_seed is not None}
        names = self.solver.parameter_names()
        return {name: getattr(seeds, name) for name, needed in drawn.items() if needed and name in names}

    def _call(self, factory: Any, scenario: Scenario) -> Any:
        """The object that a class or factory makes; the scenario is passed if an argument is required."""
        if not callable(factory):
            raise InvalidInputError(
                f"Policy {self.name!r}: expected a class derived from SolverPolicy, an object with a predict, or a "
                f"class or function that makes one, got {factory!r}."
            )
        try:
            return factory(*([scenario] if _needs_argument(factory, self.chosen) else []), **self.chosen)
        except InvalidInputError as e:
            raise UnsuitedError(str(e)) from e
        except Exception as e:  # whatever the user's code raises
            raise InvalidInputError(f"Policy {self.name!r}: the factory raised {type(e).__name__}: {e}.") from e

    def _preview(self, model: Any, preview: Preview | None) -> Preview:
        shown = getattr(model, "preview", None) if preview is None else preview
        if shown is None:
            raise InvalidInputError(
                f"Policy {self.name!r}: the number of steps ahead that it is shown is unknown. Give preview=…, or give "
                "the object an attribute preview: a number, or the steps such as (1, 10, 40)."
            )
        try:
            offsets(shown)
        except InvalidInputError as e:
            raise InvalidInputError(f"Policy {self.name!r}: {e}") from None
        return tuple(shown) if isinstance(shown, list) else cast(Preview, shown)


def specifications(policies: Any, *, wrap: Wrap | None = None) -> list[Specification]:
    """All policies of an evaluation, in the forms that :func:`baselines.evaluate.evaluate` takes; objects once each.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: Something is not a policy or cannot be imported, or no policy uses `wrap`.
    """
    out: list[Specification] = []
    for item in {id(one): one for one in ((policies,) if _is_single(policies) else policies)}.values():
        if isinstance(item, str) and item == ALL:
            out.extend(map(_from_registry, registry.names()))
            continue
        found = specification(item, wrap=wrap)
        if _is_object(item) and found.foreign:
            used = {*registry.names(), *(one.name for one in out)}
            numbered = (f"{found.name}-{number}" for number in range(2, len(used) + 3))
            name = next(name for name in (found.name, *numbered) if name not in used)
            found = dataclasses.replace(found, name=name)
        out.append(found)
    if wrap is not None and not any(one.foreign for one in out):
        raise InvalidInputError("wrap: expected a policy that uses it; a SolverPolicy plays without wrappers.")
    return out


def specification(item: Any, *, wrap: Wrap | None = None) -> Specification:
    """One policy, see :func:`specifications`."""
    if isinstance(item, SolverPolicy):
        return Specification(registry.name_of(type(item)), item)
    if _is_object(item):
        return Specification(type(item).__name__, item, {}, wrap)
    if isinstance(item, type):
        return _of_class(item, {}, wrap)
    if isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], type) and isinstance(item[1], Mapping):
        return _of_class(item[0], item[1], wrap)
    if not isinstance(item, (str, tuple)):
        raise InvalidInputError(
            "policy: expected a name, 'package.module:Class', a class, or an object with the predict of "
            f"Stable-Baselines3, got {item!r}."
        )
    name, parameters = parse_policy(item)
    if registry.known(name):
        return Specification(name, registry.get(name), parameters)
    content = import_object("policy", name)
    if isinstance(content, type) and issubclass(content, SolverPolicy):
        return _of_class(content, parameters, wrap)
    return Specification(name, name, parameters, wrap)


def shown_preview(policy: Policy, preview: Preview | None) -> Preview:
    """The steps ahead that a policy is shown: its preview, or the user's, which begin with those that a solver needs.

    Raises:
        InvalidInputError: A solver needs other steps.
    """
    if preview is None or not isinstance(policy, SolverPolicy):
        return policy.preview
    if isinstance(preview, int):
        return preview
    needed, shown = offsets(policy.preview), offsets(preview)
    if shown[: len(needed)] != needed or not (isinstance(policy.preview, int) or shown == needed):
        raise InvalidInputError(f"{policy.name} needs to be shown the steps {needed} ahead, got preview={preview}.")
    return preview


def check_picklable(specifications: Iterable[Specification]) -> None:
    """Refuses policies that cannot be sent to worker processes."""
    for one in specifications:
        kind, reason = one.solver or type(one.model), ""
        try:
            pickle.dumps(one)
        except Exception as e:  # pickling runs code of the user's
            reason = str(e)
        if getattr(kind, "__module__", "") == "__main__" and not hasattr(sys.modules["__main__"], "__file__"):
            reason = "a class defined interactively cannot be pickled"
        if reason:
            raise InvalidInputError(f"{one.name} cannot be sent to worker processes ({reason}): use one worker.")


def _of_class(kind: type[Any], parameters: Mapping[str, Any], wrap: Wrap | None) -> Specification:
    if issubclass(kind, SolverPolicy):
        name, kind = registry.name_of(kind), registry.check_class(kind)
        known_names(f"parameter of {name}", parameters, kind.parameter_names())
        return Specification(name, kind, dict(parameters))
    if not callable(getattr(kind, "predict", None)):
        raise InvalidInputError(f"policy: expected a class with the predict of Stable-Baselines3, got {kind!r}.")
    return Specification(registry.import_path_of(kind), kind, dict(parameters), wrap)


def _from_registry(name: str) -> Specification:
    """One of all registered policies; one that cannot be imported is no reason to leave the others out."""
    try:
        return Specification(name, registry.get(name))
    except InvalidInputError as e:
        return Specification(name, None, missing=str(e))


def _is_single(policies: Any) -> bool:
    """Whether this is one policy; else several."""
    if isinstance(policies, tuple) and len(policies) == 2 and isinstance(policies[1], Mapping):
        return True
    return isinstance(policies, (str, type)) or _is_object(policies) or not isinstance(policies, Iterable)


def _is_object(item: Any) -> bool:
    return not isinstance(item, type) and callable(getattr(item, "predict", None))


def _misfit(name: str, policy: SolverPolicy, scenario: Scenario) -> str | None:
    """The reason why a bound policy does not suit a scenario; None if it does."""
    if policy.reference and scenario.random:
        return f"{name} has privileged information on one episode: give its name instead of an instance."
    problem, needed = policy.problem, Problem.of(scenario)
    for field in dataclasses.fields(Problem):
        if not same(getattr(problem, field.name), getattr(needed, field.name)):
            return f"{name} was made for a scenario with another {field.name}."
    return None


def _needs_argument(factory: Any, chosen: Mapping[str, Any]) -> bool:
    """Whether a class or factory cannot be called without an argument."""
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):  # some that are written in C have no signature
        return False
    positional = {inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD}
    return any(
        one.kind in positional and one.name not in chosen and (one.default is one.empty or one.name == "scenario")
        for one in parameters
    )
