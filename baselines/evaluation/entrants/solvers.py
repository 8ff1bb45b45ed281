"""Policies of our own kind: by class, made already, or registered and not to be had."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from baselines.canonical import jsonable
from baselines.episodes import Policy, Seeds
from baselines.evaluation.entrants.base import Entrant, covering
from baselines.fingerprints import same
from baselines.policy import Problem, SolverPolicy
from ikgym.exceptions import InvalidInputError, MissingDependencyError
from ikgym.scenarios import Preview, Scenario


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

    def for_episode(self, scenario: Scenario, draw: Seeds) -> dict[str, Any]:
        """The parameters, with the episode's seeds for a reference that has to know which one it plays."""
        return {**self._seeded(scenario, draw), **self.given}

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> SolverPolicy:
        """See :meth:`Entrant.make`."""
        del preview
        return self.kind.for_scenario(scenario, **given)

    def parameters(self, scenario: Scenario, player: Policy) -> dict[str, Any]:
        """All parameters, but for the seeds that a reference was given for its episode."""
        assert isinstance(player, SolverPolicy)
        hidden = self._seeded(scenario, Seeds(0, player.parameters.get("arm_seed"))).keys() - self.given.keys()
        return {name: jsonable(value) for name, value in player.parameters.items() if name not in hidden}

    def unsuited(self, scenario: Scenario, draw: Seeds, preview: Preview | None) -> str | None:
        """See :meth:`Entrant.unsuited`; a policy that is refused with other parameters only is not unsuited.

        One whose package is not installed suits no scenario here.
        """
        decisive = {key: self.given[key] for key in self.kind.decisive if key in self.given}
        try:
            self.make(scenario, {**self._seeded(scenario, draw), **decisive}, preview)
        except (InvalidInputError, MissingDependencyError) as e:
            return str(e)
        return None

    def shown(self, player: Policy, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        return covering(player, preview)

    def _seeded(self, scenario: Scenario, draw: Seeds) -> dict[str, Any]:
        """What a reference asks for among the seeds of an episode."""
        asked = self.kind.parameter_names() if self.kind.reference else ()
        drawn = {"seed": scenario.random or scenario.plant.random, "arm_seed": draw.arm_seed is not None}
        return {name: getattr(draw, name) for name, given in drawn.items() if given and name in asked}


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

    def parameters(self, scenario: Scenario, player: Policy) -> dict[str, Any]:
        """All parameters."""
        del scenario, player
        return {name: jsonable(value) for name, value in self.policy.parameters.items()}

    def unsuited(self, scenario: Scenario, draw: Seeds, preview: Preview | None) -> str | None:
        """See :meth:`Entrant.unsuited`."""
        del draw, preview
        if self.policy.reference and scenario.random:
            return f"{self.name} has privileged information on one episode: give its name, not an instance of it."
        mine, there = self.policy.problem, Problem.of(scenario)
        for field in dataclasses.fields(Problem):
            if not same(getattr(mine, field.name), getattr(there, field.name)):
                return f"{self.name} was made for a scenario with another {field.name}."
        return None

    def shown(self, player: Policy, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        return covering(player, preview)


@dataclasses.dataclass(frozen=True, eq=False)
class BrokenEntrant(Entrant):
    """A registered policy that cannot be imported: one of all, and no reason to leave the others out.

    Args:
        name: What rows call it.
        reason: Why not.
    """

    reason: str

    def make(self, scenario: Scenario, given: Mapping[str, Any], preview: Preview | None) -> Policy:
        """See :meth:`Entrant.make`."""
        raise InvalidInputError(self.reason)

    def parameters(self, scenario: Scenario, player: Policy) -> dict[str, Any]:
        """None."""
        raise InvalidInputError(self.reason)

    def unsuited(self, scenario: Scenario, draw: Seeds, preview: Preview | None) -> str:
        """See :meth:`Entrant.unsuited`."""
        return self.reason

    def shown(self, player: Policy, preview: Preview | None) -> Preview:
        """See :meth:`Entrant.shown`."""
        raise InvalidInputError(self.reason)
