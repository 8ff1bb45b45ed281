"""Settings of solvers, searched on validation episodes."""

from __future__ import annotations

import dataclasses
import datetime
import itertools
import math
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import optuna
from optuna.trial import FrozenTrial, Trial

from baselines import registry
from baselines.canonical import DIGITS, canonical, jsonable, rounded
from baselines.episodes import add_up, rollouts
from baselines.evaluation.summary import geometric_mean
from baselines.fingerprints import fingerprint
from baselines.spec import parse_policy
from baselines.tuning.ranges import Range, Ranges, ends, read, suggested
from baselines.tuning.settings import EPISODES, SPLIT, Tuned, Tuning
from baselines.tuning.study import Study, finished, opened
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import known_names

#: The ranges that come with the solvers.
FILE = pathlib.Path(__file__).parents[1] / "data" / "ranges.toml"
#: Episodes of the first part of a trial; each further part has as many as all before it.
FIRST = 8


@dataclasses.dataclass(frozen=True)
class Cost:
    """The geometric mean of the total costs of a solver on some episodes.

    The mean of logarithms does not change its order when each episode's cost is divided by its best known one, which
    nobody knows for validation episodes: the lowest cost is the lowest cost ratio.

    Args:
        scenario: What is tracked.
        spec: The solver as it is.
        ranges: What is tried.
        seeds: The reset seeds.
    """

    scenario: Scenario
    spec: str
    ranges: tuple[Range, ...]
    seeds: tuple[int, ...]

    def __call__(self, trial: Trial) -> float:
        """The cost with the settings of a trial, which is ended early where it is far from the best.

        Raises:
            InvalidInputError: The solver refuses a value.
            TrialPruned: It is ended early.
        """
        settings = suggested(trial, self.ranges, parse_policy(self.spec)[1])
        trial.set_user_attr("settings", settings)
        costs: list[float] = []
        for part in parts(self.seeds):
            costs += self.costs(settings, part)
            trial.report(_mean(costs), len(costs))
            if len(costs) < len(self.seeds) and trial.should_prune():
                raise optuna.TrialPruned
        return _mean(costs)

    def costs(self, settings: Mapping[str, Any], seeds: Sequence[int]) -> list[float]:
        """The total costs of episodes with some settings."""
        name, parameters = parse_policy(self.spec)
        policy = registry.make(name, self.scenario, **{**parameters, **settings})
        played = rollouts(self.scenario, policy, seeds)
        return [float(add_up(one.tracking_cost + one.velocity_cost)) for one in played]

    def as_it_is(self) -> float:
        """The cost of the solver without any of the settings."""
        return _mean([cost for part in parts(self.seeds) for cost in self.costs({}, part)])


def parts(seeds: Sequence[int]) -> list[Sequence[int]]:
    """Seeds that are played together: after each part a trial may be ended, so the first ones are short."""
    ends = [0, FIRST]
    while ends[-1] < len(seeds):
        ends.append(min(2 * ends[-1], ends[-1] + 64))
    return [seeds[a:b] for a, b in itertools.pairwise(ends)]


def spent(trial: FrozenTrial) -> int:
    """The episodes that a trial has played."""
    return trial.last_step or 0


def planned(
    scenario: Scenario,
    policies: Sequence[str],
    ranges: Ranges,
    *,
    episodes: int = EPISODES,
    budget: int,
    seed: int,
) -> list[Study[Cost]]:
    """The searches, checked before anything is played.

    Args:
        scenario: What is tuned on.
        policies: Specifications of solvers; all with ranges that suit the scenario if there are none.
        ranges: What is tried.
        episodes: Validation episodes of a trial that is not ended early.
        budget: Episodes that are played for each solver.
        seed: Of what is suggested.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: A solver has no ranges, or refuses the scenario or an end of a range.
    """
    if not (scenario.random or scenario.plant.random):
        raise InvalidInputError(
            f"{scenario.name} is the same at every reset: expected a scenario with episodes that differ."
        )
    if budget < 2 * episodes:
        raise InvalidInputError(
            f"budget: expected episodes for two trials at least, {2 * episodes}, got {budget}; the first one is the "
            "solver as it is."
        )
    seeds = scenarios.seeds(SPLIT, episodes)
    made = [Cost(scenario, spec, of(spec, ranges), seeds) for spec in policies or suiting(scenario, ranges)]
    for one in made:
        _check(one)
    about = {"fingerprint": fingerprint(scenario), "episodes": episodes, "seed": seed}
    return [
        Study(
            one.spec,
            one,
            {**about, "ranges": canonical([jsonable(dataclasses.asdict(line)) for line in one.ranges])},
            budget - episodes,
            seed,
            spent,
        )
        for one in made
    ]


def _check(cost: Cost) -> None:
    """Sees to it that a solver takes what is tried, as far as the ends of its ranges tell."""
    name, parameters = parse_policy(cost.spec)
    for settings in ({}, *ends(cost.ranges, parameters)):
        registry.make(name, cost.scenario, **{**parameters, **settings})


def of(spec: str, ranges: Ranges) -> tuple[Range, ...]:
    """The ranges of a solver: the table of its specification, or that of its name without what it gives.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: There are none.
    """
    name, parameters = parse_policy(spec)
    found = ranges.get(spec) or tuple(
        one for one in ranges.get(name, ()) if one.name.partition(".")[0] not in parameters
    )
    known_names(
        f"parameter of {name}", [one.name.partition(".")[0] for one in found], registry.get(name).parameter_names()
    )
    if not found:
        raise InvalidInputError(
            f"No range is stated for a parameter of {spec!r}: expected a table of that name in --ranges "
            f"FILE.toml. There are ranges for: {', '.join(ranges)}."
        )
    return found


def suiting(scenario: Scenario, ranges: Ranges) -> list[str]:
    """The solvers with ranges that suit a scenario: some are made for skew coordinates alone."""

    def suits(spec: str) -> bool:
        try:
            name, parameters = parse_policy(spec)
            registry.make(name, scenario, **parameters)
        except InvalidInputError:
            return False
        return True

    return [spec for spec in ranges if suits(spec)]


def stated(file: pathlib.Path | None = None) -> Ranges:
    """The ranges that come with the solvers; those of a file take precedence.

    Raises:
        InvalidInputError: The file cannot be read, or is none of ranges.
    """
    return {**read(FILE), **(read(file) if file is not None else {})}


def result(folder: pathlib.Path, studies: Sequence[Study[Cost]], scenario: Scenario, command: str) -> Tuning:
    """What came of the searches.

    Args:
        folder: Of the journal.
        studies: What was searched.
        scenario: What was tuned on.
        command: What searched.
    """
    today = datetime.datetime.now(datetime.UTC).date().isoformat()
    episodes = len(studies[0].objective.seeds)
    tuned = tuple(_tuned(folder, study) for study in studies)
    return Tuning(command, today, scenario.name, fingerprint(scenario), SPLIT, episodes, tuned)


def _tuned(folder: pathlib.Path, study: Study[Cost]) -> Tuned:
    cost = study.objective
    trials = finished(opened(folder, study.name))
    whole = [(trial.value, trial.user_attrs["settings"]) for trial in trials if trial.state.name == "COMPLETE"]
    default = cost.as_it_is()
    lowest, settings = min(
        [(default, {}), *((value, found) for value, found in whole if value is not None)], key=_first
    )
    return Tuned(study.name, settings, len(trials) + 1, rounded(default, DIGITS), rounded(lowest, DIGITS))


def _first(pair: tuple[float, Any]) -> float:
    return pair[0]


def _mean(costs: Sequence[float]) -> float:
    """The geometric mean, infinite where an episode has no cost."""
    return geometric_mean(list(costs)) if all(map(math.isfinite, costs)) else math.inf
