"""Policies of others: objects with the `predict` of Stable-Baselines3, and what makes such objects."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Mapping
from typing import Any, cast

from baselines import registry
from baselines.canonical import jsonable
from baselines.episodes import Policy, Seeds
from baselines.evaluation.entrants.base import Entrant, covering
from baselines.evaluation.entrants.foreign import ForeignPolicy, Predictor, Wrap
from baselines.evaluation.entrants.solvers import InstanceEntrant
from baselines.policy import SolverPolicy
from ikgym.exceptions import InvalidInputError
from ikgym.preview import offsets
from ikgym.scenarios import Preview, Scenario


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

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Policy:
        """See :meth:`Entrant.make`.

        Raises:
            InvalidInputError: It cannot be imported or made, has no `predict`, or nobody says what it is to be shown.
        """
        del given
        model = registry.load(self.model) if isinstance(self.model, str) else self.model
        if isinstance(model, type) or not callable(getattr(model, "predict", None)):
            model = self._called(model, scenario)
        if isinstance(model, SolverPolicy):
            if reason := InstanceEntrant(self.name, model).unsuited(scenario, Seeds(0), preview):
                raise _RefusedError(reason)
            return model
        if not callable(getattr(model, "predict", None)):
            raise InvalidInputError(f"Policy {self.name!r}: expected something with a predict, got {model!r}.")
        known = getattr(model, "parameters", None)
        own = self.given or (known if isinstance(known, Mapping) else {})
        return ForeignPolicy(self.name, cast(Predictor, model), self._preview(model, preview), self.wrap, jsonable(own))

    def parameters(self, scenario: Scenario, player: Policy) -> dict[str, Any]:
        """Those that are known."""
        del scenario
        return dict(jsonable(getattr(player, "parameters")))  # noqa: B009

    def unsuited(self, scenario: Scenario, draw: Seeds, preview: Preview | None) -> str | None:
        """See :meth:`Entrant.unsuited`."""
        del draw
        try:
            player = self.make(scenario, {}, preview)
        except _RefusedError as e:
            return str(e)
        return player.misfit(scenario) if isinstance(player, ForeignPolicy) else None

    def shown(self, player: Policy, preview: Preview | None) -> Preview:
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
        shown: Preview = tuple(own) if isinstance(own, list) else own
        return shown


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
