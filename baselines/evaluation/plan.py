"""What is to be evaluated: scenarios × policies × episodes as a list of jobs, checked before the first one runs."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, Literal

import numpy as np

from baselines import registry
from baselines.canonical import jsonable
from baselines.evaluation import metrics
from baselines.evaluation import test_sets as known_sets
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from baselines.policy import SolverPolicy
from baselines.spec import PolicySpec, parse_policy
from ikgym import scenarios as scenario_registry
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import whole_number

#: Stands for all scenarios, or all policies.
ALL: Final = "all"


@dataclasses.dataclass(frozen=True)
class Job:
    """One episode that is to be played.

    Args:
        scenario: What is to be tracked.
        policy: The name of who tracks it.
        given: The parameters that the policy is made with.
        parameters: All of its parameters, as they stand in the row.
        seed: The reset seed.
        first: Whether it is the first episode of its policy in its scenario, whose course is kept for plots.
        timed: Whether it is played alone, by single calls with the clock.
        preview: Steps ahead that the policy is shown, or which ones.
        fingerprint: Of the scenario.
        test_set: The digest of the test set that it belongs to, None where to none.
    """

    scenario: Scenario
    policy: str
    given: Mapping[str, Any]
    parameters: Mapping[str, Any]
    seed: int
    first: bool
    timed: bool
    preview: Preview
    fingerprint: str
    test_set: str | None

    @property
    def key(self) -> tuple[str, str, str, int, int]:
        """The key of the row to come."""
        return metrics.key(self.scenario.name, self.policy, self.parameters, self.seed, self.scenario.steps)

    def make(self) -> SolverPolicy:
        """The policy.

        Raises:
            ResultsError: It is no longer what it was when the job was planned: the file behind it has changed.
        """
        policy = registry.make(self.policy, self.scenario, **self.given)
        now = {name: jsonable(policy.parameters[name]) for name in self.parameters}
        if now != self.parameters:
            raise ResultsError(f"{self.policy} has changed since the evaluation began: {self.parameters} is now {now}.")
        return policy


@dataclasses.dataclass(frozen=True)
class Skipped:
    """A policy that does not suit a scenario, and why."""

    scenario: str
    policy: str
    reason: str


@dataclasses.dataclass(frozen=True)
class Plan:
    """What is to be done, and what is left out."""

    jobs: tuple[Job, ...]
    skipped: tuple[Skipped, ...]


def make_plan(
    scenarios: str | Scenario | Iterable[str | Scenario],
    policies: PolicySpec | Iterable[PolicySpec],
    *,
    test_sets: str | Iterable[str] = (),
    episodes: int = 1,
    split: str = "test",
    steps: int | None = None,
    preview: int | None = None,
    timed: int | Literal["all"] = 1,
    trust: bool = False,
) -> Plan:
    """All episodes of an evaluation, policy by policy within each scenario.

    Args:
        scenarios: Scenarios or their names; ``"all"`` stands for all that are registered.
        policies: Names with or without parameters; ``"all"`` stands for all that are registered.
        test_sets: Names of test sets, instead of scenarios; they say themselves which episodes are played.
        episodes: Episodes of a random scenario. One that is the same at every reset has one, with seed 0.
        split: Where the seeds of random scenarios come from, see :data:`ikgym.scenarios.SPLITS`.
        steps: Most steps of an episode; the scenarios' own if left out.
        preview: Steps ahead that policies are shown; what each asks for if left out.
        timed: Episodes of each policy in each scenario that are timed, ``"all"`` for all of them.
        trust: Whether the files of all agents given are trusted, see :class:`baselines.agents.policy.Agent`.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split or test set.
        InvalidInputError: A value is out of range, two scenarios share a name, no policy suits any scenario, or a
            test set has drifted or is to be changed.
        ResultsError: The file of an agent cannot be used.
    """
    listed, sets = _scenarios(scenarios, steps), (test_sets,) if isinstance(test_sets, str) else tuple(test_sets)
    if sets and (listed or (episodes, split, steps) != (1, "test", None)):
        raise InvalidInputError(
            f"A test set says itself what is played: with {', '.join(map(repr, sets))}, expected no scenarios, "
            "episodes, split or steps."
        )
    drawn = scenario_registry.seeds(split, episodes)
    if preview is not None:
        whole_number("preview", preview, at_least=1)
    clocked = sys.maxsize if timed == ALL else whole_number("timed", timed, at_least=1)
    specs = [(name, _trusting(name, given) if trust else given) for name, given in _specs(policies)]
    jobs: dict[tuple[str, str, str, int, int], Job] = {}
    skipped: list[Skipped] = []
    for scenario, seeds, label in [*_frozen(sets), *_drawn(listed, drawn)]:
        digest = fingerprint(scenario)
        for name, given in specs:
            if reason := _unsuited(scenario, name, given, seeds[0]):
                skipped.append(Skipped(scenario.name, name, reason))
                continue
            policy = registry.make(name, scenario, **_with_seed(scenario, name, given, seeds[0]))
            hidden = _with_seed(scenario, name, {}, seeds[0]).keys() - given.keys()
            own = {k: jsonable(v) for k, v in policy.parameters.items() if k not in hidden}
            shown = policy.preview if preview is None else preview
            for number, seed in enumerate(seeds):
                with_seed = _with_seed(scenario, name, given, seed)
                first, alone = number == 0, number < clocked
                job = Job(scenario, name, with_seed, own, seed, first, alone, shown, digest, label)
                jobs.setdefault(job.key, job)
    if not jobs:
        raise InvalidInputError(
            "Nothing to evaluate: "
            + (
                "; ".join(f"{s.policy} in {s.scenario}: {s.reason}" for s in skipped)
                or "no scenario or no policy given."
            )
        )
    return Plan(tuple(jobs.values()), tuple(skipped))


def _frozen(names: Iterable[str]) -> Iterator[tuple[Scenario, tuple[int, ...], str | None]]:
    """The scenarios of test sets, their seeds and their digests."""
    for one in map(known_sets.get, names):
        yield one.scenario, one.seeds, one.digest


def _drawn(
    scenarios: Iterable[Scenario], drawn: tuple[int, ...]
) -> Iterator[tuple[Scenario, tuple[int, ...], str | None]]:
    """Scenarios, the seeds that they are played with, and that they belong to no set."""
    for scenario in scenarios:
        # One that is the same at every reset would only be played N times over.
        yield scenario, drawn if scenario.random or np.any(scenario.disturbance.noise) else (0,), None


def _scenarios(given: str | Scenario | Iterable[str | Scenario], steps: int | None) -> list[Scenario]:
    if steps is not None:
        whole_number("steps", steps, at_least=1)
    out: dict[str, Scenario] = {}
    for item in (given,) if isinstance(given, (str, Scenario)) else given:
        names = scenario_registry.names() if isinstance(item, str) and item == ALL else (item,)
        for name in names:
            scenario = name if isinstance(name, Scenario) else scenario_registry.get(name)
            if steps is not None:
                scenario = scenario.replace(steps=min(steps, scenario.steps))
            known = out.setdefault(scenario.name, scenario)
            if known is not scenario and fingerprint(known) != fingerprint(scenario):
                raise InvalidInputError(
                    f"Two different scenarios are called {scenario.name!r}: rename one with "
                    "scenario.replace(name=…), or nobody can tell their results apart."
                )
    return list(out.values())


def _specs(given: PolicySpec | Iterable[PolicySpec]) -> list[tuple[str, dict[str, Any]]]:
    single = isinstance(given, str) or (isinstance(given, tuple) and len(given) == 2 and isinstance(given[1], Mapping))
    out: list[tuple[str, dict[str, Any]]] = []
    for spec in (given,) if single else given:
        if isinstance(spec, str) and spec == ALL:
            out.extend((name, {}) for name in registry.names())
        else:
            out.append(parse_policy(spec))  # type: ignore[arg-type]
    return out


def _with_seed(scenario: Scenario, name: str, given: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """The parameters, with the episode's seed for a reference that has to know which one it plays."""
    policy = registry.get(name)
    if scenario.random and policy.reference and "seed" in policy.parameter_names():
        return {"seed": seed, **given}
    return dict(given)


def _trusting(name: str, given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters, with the trust in its file for a policy that asks for it."""
    return {"trust": True, **given} if "trust" in registry.get(name).parameter_names() else dict(given)


def _unsuited(scenario: Scenario, name: str, given: Mapping[str, Any], seed: int) -> str | None:
    """Why a policy does not suit a scenario; a policy that is refused with other parameters only is not unsuited."""
    decisive = {key: given[key] for key in registry.get(name).decisive if key in given}
    try:
        registry.make(name, scenario, **_with_seed(scenario, name, decisive, seed))
    except InvalidInputError as e:
        return str(e)
    return None
