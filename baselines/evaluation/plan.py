"""What is to be evaluated: scenarios × policies × episodes as a list of jobs, checked before the first one runs."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, Self

from baselines.episodes import Policy, Seeds
from baselines.evaluation import metrics
from baselines.evaluation import test_sets as known_sets
from baselines.evaluation.entrants import ALL, AnyPolicy, Entrant, Wrap, entrants
from baselines.files import ResultsError
from baselines.fingerprints import fingerprint
from baselines.oracle.stripped import ideal
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
        arm_seed: Which arm moves; the seed's own if it is None.
        noise_seed: Which noise there is in sensors and drives, see :class:`baselines.episodes.Seeds`.
        before: Reset seeds of the episodes that the arm plays before, and whose last state the policy is handed.
        ideal: The fingerprint of the scenario with an ideal plant.
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
    arm_seed: int | None = None
    noise_seed: int = 0
    before: tuple[int, ...] = ()
    ideal: str | None = None

    @property
    def seeds(self) -> Seeds:
        """Seeds of the episode."""
        return Seeds(self.seed, self.arm_seed, self.noise_seed)

    @property
    def key(self) -> metrics.Key:
        """The key of the row to come."""
        return metrics.key(self.scenario.name, self.policy, self.parameters, self.seeds, self.scenario.steps)

    def make(self) -> Policy:
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
    noise_seeds: int = 1,
    pairs: bool = False,
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
        noise_seeds: How often each episode is played, with other noise in sensors and drives; once where there is none.
            Test sets say so themselves.
        pairs: Whether each scenario whose plant is not ideal is played with an ideal one, too, on the same seeds.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split or test set.
        InvalidInputError: A value is out of range, two scenarios share a name, no policy suits any scenario, or a
            test set has drifted or is to be changed.
        ResultsError: The file of an agent cannot be used.
    """
    listed, sets = _scenarios(scenarios, steps), (test_sets,) if isinstance(test_sets, str) else tuple(test_sets)
    if sets and (listed or (episodes, split, steps, noise_seeds) != (1, "test", None, 1)):
        raise InvalidInputError(
            f"A test set says itself what is played: with {', '.join(map(repr, sets))}, expected no scenarios, "
            "episodes, split, steps or noise_seeds."
        )
    whole_number("noise_seeds", noise_seeds, at_least=1)
    drawn = scenario_registry.seeds(split, episodes)
    if preview is not None:
        offsets(preview)
    clocked = sys.maxsize if timed == ALL else whole_number("timed", timed, at_least=1)
    everyone = entrants(policies, trust=trust, wrap=wrap)
    jobs: dict[metrics.Key, Job] = {}
    skipped: list[Skipped] = []
    played = [*_fixed(sets), *_drawn(listed, drawn, noise_seeds)]
    for some in _paired(played) if pairs else played:
        scenario, draws = some.scenario, some.draws
        digest, of_ideal = fingerprint(scenario), fingerprint(ideal(scenario))
        for one in everyone:
            if reason := one.unsuited(scenario, draws[0], preview):
                skipped.append(Skipped(scenario.name, one.name, reason))
                continue
            policy = one.make(scenario, one.for_episode(scenario, draws[0]), preview)
            own, shown = one.parameters(scenario, policy), one.shown(policy, preview)
            for number, draw in enumerate(draws):
                given = one.for_episode(scenario, draw)
                first, alone = number == 0, number < clocked
                # A reference is made for one episode, and has nothing to learn from those before.
                before = () if one.made_for_episodes(scenario) else some.before(draw)
                job = Job(
                    *(scenario, one.name, one, given, own, draw.seed, first, alone, shown, digest, some.test_set),
                    *(exported, draw.arm_seed, draw.noise_seed, before, of_ideal),
                )
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


@dataclasses.dataclass(frozen=True)
class _Episodes:
    """Episodes of a scenario that are to be played.

    Args:
        scenario: What is to be tracked.
        draws: What is drawn how.
        test_set: The digest of the test set that they belong to, None where to none.
        sequence: Episodes that one arm plays one after the other.
    """

    scenario: Scenario
    draws: tuple[Seeds, ...]
    test_set: str | None = None
    sequence: int = 1

    @classmethod
    def of(
        cls, scenario: Scenario, seeds: Iterable[int], noise_seeds: int, test_set: str | None = None, sequence: int = 1
    ) -> Self:
        """The episodes with these seeds; each of them once where there is no noise."""
        times = noise_seeds if scenario.plant.noisy else 1
        arm_seeds = {seed: seed // sequence if sequence > 1 else None for seed in seeds}
        draws = tuple(Seeds(seed, arm, noise) for seed, arm in arm_seeds.items() for noise in range(times))
        return cls(scenario, draws, test_set, sequence)

    def before(self, draw: Seeds) -> tuple[int, ...]:
        """The seeds of the episodes that the same arm plays before."""
        return () if draw.arm_seed is None else tuple(range(draw.arm_seed * self.sequence, draw.seed))


def _fixed(names: Iterable[str]) -> Iterator[_Episodes]:
    """The episodes of test sets."""
    for one in map(known_sets.get, names):
        yield _Episodes.of(one.scenario, one.seeds, one.noise_seeds, one.digest, one.sequence)


def _drawn(scenarios: Iterable[Scenario], drawn: tuple[int, ...], noise_seeds: int) -> Iterator[_Episodes]:
    """Episodes of scenarios that belong to no set; arms play as many in a row as in the set of the same name."""
    for scenario in scenarios:
        # One that is the same at every reset would only be played N times over.
        seeds = drawn if scenario.random or scenario.plant.random else (0,)
        yield _Episodes.of(scenario, seeds, noise_seeds, sequence=known_sets.sequence(scenario.name))


def _paired(played: Sequence[_Episodes]) -> Iterator[_Episodes]:
    """The episodes, and those with an ideal plant on the same seeds, unless that scenario is played anyway."""
    yield from played
    there = {fingerprint(one.scenario) for one in played}
    names: dict[str, str] = {}
    for one in played:
        plain = ideal(one.scenario)
        if (content := fingerprint(plain)) not in there:
            name = names.setdefault(content, f"{one.scenario.name}, ideal plant")
            seeds = dict.fromkeys(draw.seed for draw in one.draws)
            yield _Episodes.of(plain.replace(name=name), seeds, noise_seeds=1)


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
