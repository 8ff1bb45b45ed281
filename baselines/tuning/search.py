"""The search for the settings of one solver: its episodes and their cost."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import optuna
from optuna.trial import Trial

from baselines import registry
from baselines.canonical import canonical
from baselines.episodes import rollouts
from baselines.fingerprints import fingerprint
from baselines.recording import add_up
from baselines.spec import parse_policy
from baselines.tuning.ranges import RANGES, Range, nested, of, read, suggested
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import whole_number

#: Episodes that settings are searched on: never those that scores are published on.
SPLIT, EPISODES = "validation", 64
#: Episodes that are played before a trial can be pruned for the first time.
FIRST = 8


@dataclasses.dataclass(frozen=True)
class Search:
    """The search for the settings of one solver. Called with a trial of Optuna, it returns the cost.

    The cost is the geometric mean of the total costs of the episodes. Its order is that of the geometric mean of cost
    ratios, whose best known costs are not known for validation episodes.

    Args:
        scenario: The scenario.
        spec: The solver, such as ``rhc:horizon=3``.
        ranges: How its parameters are varied, by name.
        seeds: The reset seeds of the episodes.
        seed: Seed of Optuna's sampler.
    """

    scenario: Scenario
    spec: str
    ranges: Mapping[str, Range]
    seeds: tuple[int, ...]
    seed: int

    def __call__(self, trial: Trial) -> float:
        """The cost with the settings of a trial.

        Raises:
            TrialPruned: It is above the median of earlier trials after a part of the episodes.
        """
        settings = suggested(trial, self.ranges, parse_policy(self.spec)[1])
        trial.set_user_attr("settings", settings)
        logarithms: list[float] = []
        while len(logarithms) < len(self.seeds):
            part = self.seeds[len(logarithms) : max(FIRST, 2 * len(logarithms))]
            logarithms += np.log(self.costs(settings, part)).tolist()
            trial.report(float(np.exp(np.mean(logarithms))), len(logarithms))
            if len(logarithms) < len(self.seeds) and trial.should_prune():
                raise optuna.TrialPruned
        return float(np.exp(np.mean(logarithms)))

    def costs(self, settings: Mapping[str, Any], seeds: Sequence[int]) -> list[float]:
        """The total costs of episodes with some settings."""
        played = rollouts(self.scenario, self.make(settings), seeds)
        return [float(add_up(one.cost)) for one in played]

    def make(self, settings: Mapping[str, Any]) -> Any:
        """The solver with some settings.

        Raises:
            InvalidInputError: It does not suit the scenario, or refuses a value.
        """
        name, parameters = parse_policy(self.spec)
        return registry.make(name, self.scenario, **{**parameters, **settings})

    @property
    def about(self) -> dict[str, Any]:
        """The values that must be equal when a search is resumed."""
        about = {"fingerprint": fingerprint(self.scenario), "episodes": len(self.seeds), "seed": self.seed}
        return about | {"ranges": canonical(dict(self.ranges))}


def searches(
    scenario: Scenario,
    policies: Sequence[str] = (),
    file: pathlib.Path | None = None,
    *,
    episodes: int = EPISODES,
    seed: int = 0,
) -> list[Search]:
    """The searches for several solvers, checked before anything is played.

    Args:
        scenario: The scenario, one whose episodes differ.
        policies: Specifications of solvers; all solvers with ranges that suit the scenario if empty.
        file: Further ranges, which take precedence over those that come with the solvers.
        episodes: Validation episodes of a trial that is not pruned.
        seed: Seed of Optuna's sampler.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: A solver has no ranges, or refuses the scenario or the end of a range.
    """
    if not (scenario.random or scenario.plant.random):
        raise InvalidInputError(
            f"{scenario.name} is the same at every reset: expected a scenario whose episodes differ."
        )
    seeds, ranges = scenarios.seeds(SPLIT, episodes), {**read(RANGES), **({} if file is None else read(file))}
    whole_number("seed", seed, at_least=0)
    found = [Search(scenario, spec, of(spec, ranges), seeds, seed) for spec in policies or ranges]
    names = [one.spec.partition(":")[0] for one in found]
    if file is not None and not any(spec.partition(":")[0] in names for spec in read(file)):
        raise InvalidInputError(f"{file}: expected ranges of a solver that is searched, {', '.join(policies)}.")
    if not policies:
        found = [one for one in found if _suits(one)]
    for one in found:
        given = parse_policy(one.spec)[1]
        for name, line in one.ranges.items():
            needed = {other: values[0] for other, values in line.get("when", {}).items()}
            for value in line.get("choices") or (line["low"], line["high"]):
                one.make(needed | nested(name, value, {**given, **needed}))
    return found


def _suits(search: Search) -> bool:
    try:
        search.make({})
    except InvalidInputError:
        return False
    return True
