"""Policy specifications: policies that are not yet bound to a scenario."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from typing import Any, cast

from baselines import registry
from baselines.canonical import jsonable
from baselines.evaluation.foreign import ForeignPolicy, Predictor, Wrap
from baselines.fingerprints import same
from baselines.policy import Problem, SolverPolicy
from baselines.policy.protocol import Policy
from baselines.recording import Seeds
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.scenarios import Preview, Scenario
from ikgym.scenarios.preview import offsets


class _RefusedError(InvalidInputError):
    """A class or factory refuses the scenario."""


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
        """Whether name and parameters identify the policy, so that its results can be continued later.

        Two objects of one class may differ.
        """
        return bool(self.missing) or isinstance(self.model, (str, type, SolverPolicy))

    def given(self, scenario: Scenario, seeds: Seeds) -> dict[str, Any]:
        """The parameters of a solver for one episode: the user's, and the seeds that a reference needs to know it."""
        return {**self._seeds(scenario, seeds), **self.chosen} if self.solver else {}

    def per_episode(self, scenario: Scenario) -> bool:
        """Whether each episode needs its own policy, as with references that have privileged information."""
        return self.given(scenario, Seeds(0)) != self.given(scenario, Seeds(1))

    def bind(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Policy:
        """The policy for a scenario, with the parameters from :meth:`given`, shown its own preview if None."""
        if self.missing:
            raise InvalidInputError(self.missing)
        if self.solver is not None:
            return self.solver.for_scenario(scenario, **given)
        model = registry.load(self.model) if isinstance(self.model, str) else self.model
        if isinstance(model, type) or not callable(getattr(model, "predict", None)):
            model = self._call(model, scenario)
        if isinstance(model, SolverPolicy):
            if reason := _misfit(self.name, model, scenario):
                raise _RefusedError(reason)
            return model
        if not callable(getattr(model, "predict", None)):
            raise InvalidInputError(f"Policy {self.name!r}: expected an object with a predict, got {model!r}.")
        known = getattr(model, "parameters", None)
        own = self.chosen or (known if isinstance(known, Mapping) else {})
        ahead = self._preview(model, preview)
        return ForeignPolicy(self.name, cast(Predictor, model), ahead, self.wrap, jsonable(own))

    def parameters(self, scenario: Scenario, policy: Policy) -> dict[str, Any]:
        """The parameters of the bound policy for rows: all except the seeds of the episode."""
        values: Mapping[str, Any] = getattr(policy, "parameters")  # noqa: B009
        hidden = self._seeds(scenario, Seeds(0, values.get("arm_seed"))).keys() - self.chosen.keys()
        return {name: jsonable(value) for name, value in values.items() if name not in hidden}

    def unsuited(self, scenario: Scenario, seeds: Seeds, preview: Preview | None) -> str | None:
        """The reason why the policy does not suit a scenario; None if it does.

        Refused parameters are an error of the user's, not a lack of suitability. A policy whose package is not
        installed suits no scenario.
        """
        if self.missing:
            return self.missing
        if self.solver is not None:
            decisive = {name: self.chosen[name] for name in self.solver.decisive if name in self.chosen}
            try:
                self.bind(scenario, {**self._seeds(scenario, seeds), **decisive}, preview)
            except (InvalidInputError, MissingDependencyError) as e:
                return str(e)
            return None
        try:
            policy = self.bind(scenario, {}, preview)
        except _RefusedError as e:
            return str(e)
        return policy.misfit(scenario) if isinstance(policy, ForeignPolicy) else None

    def _seeds(self, scenario: Scenario, seeds: Seeds) -> dict[str, Any]:
        """The seeds that a reference takes as parameters."""
        if self.solver is None or not self.solver.reference:
            return {}
        drawn = {"seed": scenario.random or scenario.plant.random, "arm_seed": seeds.arm_seed is not None}
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
            raise _RefusedError(str(e)) from e
        except Exception as e:  # whatever the user's code raises
            raise InvalidInputError(f"Policy {self.name!r}: cannot be made: {type(e).__name__}: {e}.") from e

    def _preview(self, model: Any, preview: Preview | None) -> Preview:
        own = getattr(model, "preview", None) if preview is None else preview
        if own is None:
            raise InvalidInputError(
                f"Policy {self.name!r}: the number of steps ahead that it is shown is unknown. Give preview=…, or give "
                "the object an attribute preview: a number, or the steps such as (1, 10, 40)."
            )
        try:
            offsets(own)
        except InvalidInputError as e:
            raise InvalidInputError(f"Policy {self.name!r}: {e}") from None
        return tuple(own) if isinstance(own, list) else cast(Preview, own)


def _misfit(name: str, policy: SolverPolicy, scenario: Scenario) -> str | None:
    """The reason why a bound policy does not suit a scenario; None if it does."""
    if policy.reference and scenario.random:
        return f"{name} has privileged information on one episode: give its name instead of an instance."
    mine, there = policy.problem, Problem.of(scenario)
    for field in dataclasses.fields(Problem):
        if not same(getattr(mine, field.name), getattr(there, field.name)):
            return f"{name} was made for a scenario with another {field.name}."
    return None


def shown_preview(policy: Policy, preview: Preview | None) -> Preview:
    """The steps ahead that a policy is shown: its own, or the user's, which begin with those that a solver needs."""
    if preview is None or isinstance(policy, ForeignPolicy):
        return policy.preview
    if isinstance(preview, int):
        return preview
    needed, shown = offsets(policy.preview), offsets(preview)
    if shown[: len(needed)] != needed or not (isinstance(policy.preview, int) or shown == needed):
        raise InvalidInputError(f"{policy.name} needs to be shown the steps {needed} ahead, got preview={preview}.")
    return preview


def _needs_argument(factory: Any, given: Mapping[str, Any]) -> bool:
    """Whether a class or factory cannot be called without an argument."""
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):  # some that are written in C have no signature
        return False
    positional = {inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD}
    return any(
        one.kind in positional and one.name not in given and (one.default is one.empty or one.name == "scenario")
        for one in parameters
    )
