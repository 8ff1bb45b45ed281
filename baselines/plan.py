"""What is to be evaluated: scenarios × policies × episodes as a list of jobs, checked before the first one runs."""

from __future__ import annotations

import ast
import dataclasses
import sys
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, Final, Literal

import numpy as np

from baselines import frozen as frozen_sets
from baselines import metrics, registry
from baselines.content import fingerprint
from baselines.files import ResultsError
from baselines.metrics import jsonable
from baselines.policy import SolverPolicy
from ikgym import scenarios as scenario_registry
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Preview, Scenario
from ikgym.validation import known_names, whole_number

#: A policy as text such as ``"dls:damping=1e-2"``, or its name and its parameters.
PolicySpec = str | tuple[str, Mapping[str, Any]]

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
        frozen: The digest of the frozen set that it belongs to, None where to none.
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
    frozen: str | None

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
    frozen: str | Iterable[str] = (),
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
        frozen: Names of frozen sets, instead of scenarios; they say themselves which episodes are played.
        episodes: Episodes of a random scenario. One that is the same at every reset has one, with seed 0.
        split: Where the seeds of random scenarios come from, see :data:`ikgym.scenarios.SPLITS`.
        steps: Most steps of an episode; the scenarios' own if left out.
        preview: Steps ahead that policies are shown; what each asks for if left out.
        timed: Episodes of each policy in each scenario that are timed, ``"all"`` for all of them.
        trust: Whether the files of all agents given are trusted, see :class:`baselines.agent.policy.Agent`.

    Raises:
        UnknownNameError: There is no such scenario, policy, parameter, split or frozen set.
        InvalidInputError: A value is out of range, two scenarios share a name, no policy suits any scenario, or a
            frozen set has drifted or is to be changed.
        ResultsError: The file of an agent cannot be used.
    """
    listed, sets = _scenarios(scenarios, steps), (frozen,) if isinstance(frozen, str) else tuple(frozen)
    if sets and (listed or (episodes, split, steps) != (1, "test", None)):
        raise InvalidInputError(
            f"A frozen set says itself what is played: with {', '.join(map(repr, sets))}, expected no scenarios, "
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


def parse_policy(spec: PolicySpec) -> tuple[str, dict[str, Any]]:
    """Name and parameters of a policy.

    Args:
        spec: ``"name"``, ``"name:parameter=value,parameter=value"`` or a pair of both; ``"agent:PATH"``, too. Values
            are Python's literals; anything else is taken for plain text.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: The text has another form, or names a parameter twice.
    """
    if isinstance(spec, str):
        name, _, text = spec.partition(":")
        name = name.strip()
        alone, known = registry.get(name).nameless, registry.get(name).parameter_names()
        if alone is not None and text.strip() and text.partition("=")[0].strip() not in known:
            parameters: dict[str, Any] = {alone: text.strip()}
        else:
            parameters = _parse_parameters(spec, text) if ":" in spec else {}
    elif isinstance(spec, tuple) and len(spec) == 2 and isinstance(spec[0], str) and isinstance(spec[1], Mapping):
        name, parameters = spec[0], dict(spec[1])
    else:
        raise InvalidInputError(f"policy: expected 'name:parameter=value' or (name, parameters), got {spec!r}.")
    known_names(f"parameter of {name}", parameters, registry.get(name).parameter_names())
    return name, parameters


def _frozen(names: Iterable[str]) -> Iterator[tuple[Scenario, tuple[int, ...], str | None]]:
    """The scenarios of frozen sets, their seeds and their digests."""
    for frozen in map(frozen_sets.get, names):
        yield frozen.scenario, frozen.seeds, frozen.digest


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


def _parse_parameters(spec: str, text: str) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for part in _split(text):
        name, equals, value = (piece.strip() for piece in part.partition("="))
        if not (name and equals and value):
            raise InvalidInputError(f"policy {spec!r}: expected name:parameter=value,…, got {part.strip()!r}.")
        if name in out:
            raise InvalidInputError(f"policy {spec!r}: parameter {name!r} is given twice.")
        try:
            out[name] = ast.literal_eval(value)
        except (ValueError, SyntaxError, TypeError, RecursionError, MemoryError):
            out[name] = value
    return out


def _split(text: str) -> list[str]:
    """Parts between commas that stand in no bracket."""
    parts, depth = [""], 0
    for letter in text:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts
