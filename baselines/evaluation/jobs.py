"""The jobs of an evaluation: scenarios × policies × episodes, checked before the first one is played."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple, Self

from baselines.episodes import Policy, Seeds
from baselines.evaluation import metrics
from baselines.evaluation import test_sets as known_sets
from baselines.evaluation.options import Options
from baselines.evaluation.policies import ALL, AnyPolicy, specifications
from baselines.evaluation.specification import Specification, shown_preview
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from baselines.oracle.stripped import ideal
from ikgym import scenarios as scenario_registry
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario


@dataclasses.dataclass(frozen=True, eq=False)
class Job:
    """One episode to be played.

    Args:
        scenario: The scenario.
        specification: The policy, not yet bound to the scenario.
        given: The parameters that the policy is made with for this episode.
        parameters: All of its parameters, as rows state them.
        seeds: Seeds of the episode.
        first: Whether it is the first episode of its policy in its scenario; its trajectory log is kept.
        record: Whether the record of the episode is needed, for the log or for an export.
        timed: Whether it is played by itself and timed.
        preview: Steps ahead that the policy is shown, or which ones.
        fingerprint: Digest of the scenario.
        ideal: Digest of the scenario with an ideal plant.
        test_set: Digest of the test set of the episode; None if it belongs to none.
        before: Number of episodes that the same arm plays before, with reset seeds that end at this one's; the policy
            keeps its state.
    """

    scenario: Scenario
    specification: Specification
    given: Mapping[str, Any]
    parameters: Mapping[str, Any]
    seeds: Seeds
    first: bool
    record: bool
    timed: bool
    preview: Preview
    fingerprint: str
    ideal: str
    test_set: str | None = None
    before: int = 0

    @property
    def policy(self) -> str:
        """The name of the policy."""
        return self.specification.name

    @property
    def key(self) -> metrics.Key:
        """The key of the row to come."""
        return metrics.key(self.scenario.name, self.policy, self.parameters, self.seeds, self.scenario.steps)

    def bind(self) -> Policy:
        """The policy.

        Raises:
            ResultsError: The file behind the policy has changed since the evaluation began.
        """
        policy = self.specification.bind(self.scenario, self.given, self.preview)
        now = self.specification.parameters(self.scenario, policy)
        if now != self.parameters:
            raise ResultsError(f"{self.policy} has changed since the evaluation began: {self.parameters} is now {now}.")
        return policy


class Skipped(NamedTuple):
    """A policy that does not suit a scenario.

    Attributes:
        scenario: The name of the scenario.
        policy: The name of the policy.
        reason: Why it does not suit.
    """

    scenario: str
    policy: str
    reason: str


def plan(
    scenarios: str | Scenario | Iterable[str | Scenario],
    policies: AnyPolicy | Iterable[AnyPolicy],
    options: Options | None = None,
) -> tuple[list[Job], list[Skipped]]:
    """All episodes of an evaluation, policy by policy within each scenario, and the policies that are skipped.

    Args:
        scenarios: Scenarios as :func:`ikgym.scenarios.find` takes them; ``"all"`` for all registered ones.
        policies: Policies as :func:`baselines.evaluation.policies.specifications` takes them.
        options: Options of the evaluation; the defaults if left out.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split or test set.
        InvalidInputError: A value is out of range, two scenarios share a name, no policy suits any scenario, or a test
            set has drifted or is given with options that it defines.
        ResultsError: The file of an agent cannot be used.
    """
    options = Options() if options is None else options
    timed = sys.maxsize if options.timed == ALL else int(options.timed)
    all_policies = specifications(policies, wrap=options.wrap)
    played = _episodes(scenarios, options)
    jobs: dict[metrics.Key, Job] = {}
    skipped: list[Skipped] = []
    for some in _with_ideal(played) if options.pairs else played:
        scenario = some.scenario
        digest, of_ideal = fingerprint(scenario), fingerprint(ideal(scenario))
        for one in all_policies:
            if reason := one.unsuited(scenario, some.seeds[0], options.preview):
                skipped.append(Skipped(scenario.name, one.name, reason))
                continue
            policy = one.bind(scenario, one.given(scenario, some.seeds[0]), options.preview)
            parameters, shown = one.parameters(scenario, policy), shown_preview(policy, options.preview)
            per_episode = one.per_episode(scenario)
            for number, seeds in enumerate(some.seeds):
                job = Job(
                    scenario=scenario,
                    specification=one,
                    given=one.given(scenario, seeds),
                    parameters=parameters,
                    seeds=seeds,
                    first=number == 0,
                    record=number == 0 or bool(options.export),
                    timed=number < timed,
                    preview=shown,
                    fingerprint=digest,
                    ideal=of_ideal,
                    test_set=some.test_set,
                    # A reference is made for one episode, and has nothing to learn from those before.
                    before=0 if per_episode else some.before(seeds),
                )
                jobs.setdefault(job.key, job)
    if not jobs:
        reasons = "; ".join(f"{one.policy} in {one.scenario}: {one.reason}" for one in skipped)
        raise InvalidInputError(f"Nothing to evaluate: {reasons or 'no scenario or no policy given.'}")
    return list(jobs.values()), skipped


@dataclasses.dataclass(frozen=True)
class _Episodes:
    """Episodes of a scenario.

    Args:
        scenario: The scenario.
        seeds: Seeds of each episode.
        test_set: Digest of their test set.
        length: Episodes that one arm plays one after the other.
    """

    scenario: Scenario
    seeds: tuple[Seeds, ...]
    test_set: str | None = None
    length: int = 1

    @classmethod
    def of(
        cls, scenario: Scenario, seeds: Iterable[int], noise_seeds: int, test_set: str | None = None, length: int = 1
    ) -> Self:
        """The episodes of reset seeds, once each where there is no noise."""
        times = noise_seeds if scenario.plant.noisy else 1
        arm_seeds = {seed: seed // length if length > 1 else None for seed in seeds}
        drawn = tuple(Seeds(seed, arm, noise) for seed, arm in arm_seeds.items() for noise in range(times))
        return cls(scenario, drawn, test_set, length)

    def before(self, seeds: Seeds) -> int:
        """Episodes that the same arm plays before."""
        return 0 if seeds.arm_seed is None else seeds.seed - seeds.arm_seed * self.length


def _episodes(scenarios: str | Scenario | Iterable[str | Scenario], options: Options) -> list[_Episodes]:
    """The episodes of all scenarios or test sets."""
    listed = _scenarios(scenarios, options.steps)
    if options.test_sets:
        changed = (options.episodes, options.split, options.steps, options.noise_seeds) != (1, "test", None, 1)
        if listed or changed:
            raise InvalidInputError(
                f"A test set defines what is played: with {', '.join(map(repr, options.test_sets))}, expected no "
                "scenarios, episodes, split, steps or noise_seeds."
            )
        sets = [known_sets.get(name) for name in options.test_sets]
        return [_Episodes.of(one.scenario, one.seeds, one.noise_seeds, one.digest, one.sequence) for one in sets]
    drawn = scenario_registry.seeds(options.split, options.episodes)
    return [
        _Episodes.of(
            scenario,
            # A scenario that is the same at every reset would only be played several times over.
            drawn if scenario.random or scenario.plant.random else (0,),
            options.noise_seeds,
            length=known_sets.sequence(scenario.name),
        )
        for scenario in listed
    ]


def _with_ideal(played: Sequence[_Episodes]) -> Iterator[_Episodes]:
    """The episodes, and those with an ideal plant on the same seeds, unless that scenario is played anyway."""
    yield from played
    there = {fingerprint(one.scenario) for one in played}
    names: dict[str, str] = {}
    for one in played:
        plain = ideal(one.scenario)
        if (content := fingerprint(plain)) not in there:
            name = names.setdefault(content, f"{one.scenario.name}, ideal plant")
            yield _Episodes.of(plain.replace(name=name), dict.fromkeys(seeds.seed for seeds in one.seeds), 1)


def _scenarios(given: str | Scenario | Iterable[str | Scenario], steps: int | None) -> list[Scenario]:
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
                    "scenario.replace(name=…), so that their results can be distinguished."
                )
    return list(out.values())
