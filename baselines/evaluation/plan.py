"""What is to be evaluated: scenarios × policies × episodes as a list of jobs, checked before the first one runs."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Literal

from baselines.evaluation import metrics
from baselines.evaluation import test_sets as known_sets
from baselines.evaluation.entrants import ALL, AnyPolicy, Entrant, Wrap, entrants
from baselines.evaluation.rollout import Player
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from ikgym import scenarios as scenario_registry
from ikgym.exceptions import InvalidInputError
from ikgym.preview import offsets
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import whole_number


@dataclasses.dataclass(frozen=True)
class Job:
    """One episode that is to be played.

    Args:
        scenario: What is to be tracked.
        policy: The name of who tracks it.
        entrant: Who tracks it, before it is made for the scenario.
        given: The parameters that the policy is made with for this episode.
        parameters: All of its parameters, as they stand in the row.
        seed: The reset seed.
        first: Whether it is the first episode of its policy in its scenario, whose trajectory log is kept for plots.
        timed: Whether it is played alone, by single calls with the clock.
        preview: Steps ahead that the policy is shown, or which ones.
        fingerprint: Of the scenario.
        test_set: The digest of the test set that it belongs to, None where to none.
        exported: Whether its joint motion is kept.
    """

    scenario: Scenario
    policy: str
    entrant: Entrant
    given: Mapping[str, Any]
    parameters: Mapping[str, Any]
    seed: int
    first: bool
    timed: bool
    preview: Preview
    fingerprint: str
    test_set: str | None
    exported: bool = False

    @property
    def key(self) -> tuple[str, str, str, int, int]:
        """The key of the row to come."""
        return metrics.key(self.scenario.name, self.policy, self.parameters, self.seed, self.scenario.steps)

    def make(self) -> Player:
        """The policy.

        Raises:
            ResultsError: It is no longer what it was when the job was planned: the file behind it has changed.
        """
        policy = self.entrant.make(self.scenario, self.given, self.preview)
        now = self.entrant.parameters(self.scenario, policy)
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
class EvaluationPlan:
    """What is to be done, and what is left out."""

    jobs: tuple[Job, ...]
    skipped: tuple[Skipped, ...]


def make_plan(
    scenarios: str | Scenario | Iterable[str | Scenario],
    policies: AnyPolicy | Iterable[AnyPolicy],
    *,
    test_sets: str | Iterable[str] = (),
    episodes: int = 1,
    split: str = "test",
    steps: int | None = None,
    preview: Preview | None = None,
    wrap: Wrap | None = None,
    timed: int | Literal["all"] = 1,
    trust: bool = False,
    exported: bool = False,
) -> EvaluationPlan:
    """All episodes of an evaluation, policy by policy within each scenario.

    Args:
        scenarios: Scenarios, or what :func:`ikgym.scenarios.find` takes; ``"all"`` stands for all that are registered.
        policies: What :func:`baselines.evaluation.entrants.entrants` takes; ``"all"`` stands for all registered ones.
        test_sets: Names of test sets, instead of scenarios; they say themselves which episodes are played.
        episodes: Episodes of a random scenario. One that is the same at every reset has one, with seed 0.
        split: Where the seeds of random scenarios come from, see :data:`ikgym.scenarios.SPLITS`.
        steps: Most steps of an episode; the scenarios' own if left out.
        preview: Steps ahead that policies are shown, or which ones; what each asks for if left out.
        wrap: Wraps the environment for those that are no :class:`baselines.SolverPolicy`.
        timed: Episodes of each policy in each scenario that are timed, ``"all"`` for all of them.
        trust: Whether the files of all agents given are trusted, see :class:`baselines.agents.policy.Agent`.
        exported: Whether the joint motions of all episodes are kept.

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
        offsets(preview)
    clocked = sys.maxsize if timed == ALL else whole_number("timed", timed, at_least=1)
    everyone = entrants(policies, trust=trust, wrap=wrap)
    jobs: dict[tuple[str, str, str, int, int], Job] = {}
    skipped: list[Skipped] = []
    for scenario, seeds, label in [*_fixed(sets), *_drawn(listed, drawn)]:
        digest = fingerprint(scenario)
        for one in everyone:
            if reason := one.unsuited(scenario, seeds[0], preview):
                skipped.append(Skipped(scenario.name, one.name, reason))
                continue
            policy = one.make(scenario, one.for_episode(scenario, seeds[0]), preview)
            own, shown = one.parameters(scenario, policy), one.shown(policy, preview)
            for number, seed in enumerate(seeds):
                given = one.for_episode(scenario, seed)
                first, alone = number == 0, number < clocked
                job = Job(scenario, one.name, one, given, own, seed, first, alone, shown, digest, label, exported)
                jobs.setdefault(job.key, job)
    if not jobs:
        raise InvalidInputError(
            "Nothing to evaluate: "
            + (
                "; ".join(f"{s.policy} in {s.scenario}: {s.reason}" for s in skipped)
                or "no scenario or no policy given."
            )
        )
    return EvaluationPlan(tuple(jobs.values()), tuple(skipped))


def _fixed(names: Iterable[str]) -> Iterator[tuple[Scenario, tuple[int, ...], str | None]]:
    """The scenarios of test sets, their seeds and their digests."""
    for one in map(known_sets.get, names):
        yield one.scenario, one.seeds, one.digest


def _drawn(
    scenarios: Iterable[Scenario], drawn: tuple[int, ...]
) -> Iterator[tuple[Scenario, tuple[int, ...], str | None]]:
    """Scenarios, the seeds that they are played with, and that they belong to no set."""
    for scenario in scenarios:
        # One that is the same at every reset would only be played N times over.
        yield scenario, drawn if scenario.random or scenario.plant.random else (0,), None


def _scenarios(given: str | Scenario | Iterable[str | Scenario], steps: int | None) -> list[Scenario]:
    if steps is not None:
        whole_number("steps", steps, at_least=1)
    out: dict[str, Scenario] = {}
    for item in (given,) if isinstance(given, (str, Scenario)) else given:
        names = scenario_registry.names() if isinstance(item, str) and item == ALL else (item,)
        for name in names:
            scenario = scenario_registry.find(name)
            if steps is not None:
                scenario = scenario.replace(steps=min(steps, scenario.steps))
            known = out.setdefault(scenario.name, scenario)
            if known is not scenario and fingerprint(known) != fingerprint(scenario):
                raise InvalidInputError(
                    f"Two different scenarios are called {scenario.name!r}: rename one with "
                    "scenario.replace(name=…), or nobody can tell their results apart."
                )
    return list(out.values())
