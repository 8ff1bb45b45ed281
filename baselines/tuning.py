"""The search for settings of solvers by Optuna: ``ikgym tune``.

A file of ranges has a table a solver, called by its specification, with one line a parameter:

    [mfac]
    damping = { low = 1e-6, high = 1.0, log = true }     # a float; an integer if both ends are integers
    rule = { choices = ["constant", "chan"] }

A parameter with a dot is a key of a parameter that is a table itself: ``"options.gain"``. One with ``when = { rule =
["chan"] }`` is varied only if a parameter above it has one of these values.

One file, although long: ranges and folders of trials are checked with the parts of a search.
"""

from __future__ import annotations

import contextlib
import dataclasses
import json
import operator
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import optuna
from optuna.distributions import CategoricalDistribution, FloatDistribution, IntDistribution
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.trial import FrozenTrial, Trial, TrialState

from baselines import registry
from baselines.canonical import DIGITS, canonical, rounded
from baselines.episodes import add_up, rollouts
from baselines.files import ResultsError, check_flags, read_bytes, reading
from baselines.fingerprints import fingerprint
from baselines.spec import parse_policy
from baselines.workers import Workers, finished
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.files import read_user_toml
from ikgym.scenarios import Scenario
from ikgym.validation import known_names, whole_number

#: The ranges that come with the solvers.
RANGES = pathlib.Path(__file__).parent / "data" / "ranges.toml"
#: Episodes that settings are searched on: never those that scores are published on.
SPLIT, EPISODES = "validation", 64
#: Episodes that are played before a trial can be pruned for the first time.
FIRST = 8
#: The file with the trials of a folder, for Optuna.
JOURNAL = "study.journal"
#: States of trials that count.
DONE = (TrialState.COMPLETE, TrialState.PRUNED)

#: How a parameter is varied: low, high, log, choices, when.
Range = Mapping[str, Any]


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
        return [float(add_up(one.tracking_cost + one.velocity_cost)) for one in played]

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
        ranges = canonical(dict(self.ranges))
        return {"fingerprint": fingerprint(self.scenario), "episodes": len(self.seeds), "seed": self.seed} | {
            "ranges": ranges
        }


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
                one.make(needed | _nested(name, value, {**given, **needed}))
    return found


def _suits(search: Search) -> bool:
    try:
        search.make({})
    except InvalidInputError:
        return False
    return True


def read(file: pathlib.Path) -> dict[str, dict[str, Range]]:
    """The ranges in a TOML file, by solver and parameter.

    Raises:
        InvalidInputError: The file cannot be read, or a range is invalid.
        UnknownNameError: A range has an unknown key.
    """
    tables = read_user_toml(file)
    for spec, table in tables.items():
        for name, line in table.items() if isinstance(table, dict) else [("", table)]:
            if not isinstance(line, dict):
                raise InvalidInputError(f"{file}: expected a table of ranges by parameter in [{spec}], got {line!r}.")
            known_names("key of a range", line, ("low", "high", "log", "choices", "when"))
            known_names(f"parameter above {name}", line.get("when", {}), list(table)[: list(table).index(name)])
            try:
                _distribution(line)
            except (KeyError, TypeError, ValueError) as e:
                raise InvalidInputError(f"{file}: [{spec}] {name}: expected low and high, or choices: {e}.") from None
    return tables


def _distribution(line: Range) -> CategoricalDistribution | FloatDistribution | IntDistribution:
    if "choices" in line:
        return CategoricalDistribution([json.dumps(value) for value in line["choices"]])  # lists are no choices
    low, high, log = line["low"], line["high"], line.get("log", False)
    kind = IntDistribution if isinstance(low, int) and isinstance(high, int) else FloatDistribution
    return kind(low, high, log=log)


def of(spec: str, ranges: Mapping[str, Mapping[str, Range]]) -> Mapping[str, Range]:
    """The ranges of a solver: the table of its specification, or of its name without the given parameters.

    Raises:
        UnknownNameError: There is no such policy or parameter.
        InvalidInputError: There are none.
    """
    name, given = parse_policy(spec)
    other = {key: line for key, line in ranges.get(name, {}).items() if key.partition(".")[0] not in given}
    found = ranges.get(spec) or other
    keys = [key.partition(".")[0] for key in found]
    known_names(f"parameter of {name}", keys, registry.get(name).parameter_names())
    if not found:
        raise InvalidInputError(
            f"There are no ranges for the parameters of {spec!r}: add a table of that name to --ranges FILE.toml. "
            f"There are ranges for: {', '.join(ranges)}."
        )
    return found


def suggested(trial: Trial, ranges: Mapping[str, Range], given: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a trial.

    Args:
        trial: The trial.
        ranges: How parameters are varied.
        given: Parameters that the solver is given; one with a dot in its name replaces one key of them.
    """
    out: dict[str, Any] = {}
    for name, line in ranges.items():
        if any(out.get(other) not in values for other, values in line.get("when", {}).items()):
            continue
        kind, value = _distribution(line), None
        if isinstance(kind, CategoricalDistribution):
            value = json.loads(str(trial.suggest_categorical(name, kind.choices)))
        elif isinstance(kind, IntDistribution):
            value = trial.suggest_int(name, kind.low, kind.high, log=kind.log)
        else:
            value = rounded(trial.suggest_float(name, kind.low, kind.high, log=kind.log), DIGITS)
        out |= _nested(name, value, {**given, **out})
    return out


def _nested(name: str, value: object, given: Mapping[str, Any]) -> dict[str, Any]:
    outer, _, inner = name.partition(".")
    return {outer: {**given.get(outer, {}), inner: value} if inner else value}


def run(
    folder: pathlib.Path, wanted: Sequence[Search], trials: int, *, workers: int, resume: bool, overwrite: bool
) -> list[dict[str, Any]]:
    """Searches, and returns the best settings of each solver; the caller has locked the folder.

    Args:
        folder: Where the journal of Optuna is kept.
        wanted: The searches.
        trials: Trials of each solver, pruned ones included.
        workers: Processes that play trials at the same time; with several, the result depends on their order.
        resume: Whether to continue with the trials in the folder.
        overwrite: Whether to replace them.

    Returns:
        For each solver: `spec`, best `settings`, number of trials `tried`, cost by `default` and when `tuned`.

    Raises:
        InvalidInputError: There are too many workers, or none.
        ResultsError: There is a journal and neither flag is given, or it is of another search, or damaged.
        WorkerError: A worker died.
    """
    file, crew = folder / JOURNAL, Workers(workers)
    check_flags(file, resume=resume, overwrite=overwrite)
    if overwrite:
        file.unlink(missing_ok=True)
    pathlib.Path(f"{file}.lock").unlink(missing_ok=True)  # of a process that was killed
    with reading(file, "Begin again with --overwrite."):
        if file.exists():  # without a line that was not written to its end
            content = read_bytes(file)
            os.truncate(file, content.rfind(b"\n") + 1)
        for one in wanted:
            _begin(file, one)
    units = [(file, one, trials, worker) for one in wanted for worker in range(crew.number)]
    if crew.here:
        for unit in units:
            _work(unit)
    else:
        # Not retried: a killed process may leave the journal locked.
        with contextlib.closing(finished(_work, units, crew, tries=1)) as done:
            for _, future in done:
                future.result()
    return [_best(_study(file, one), one) for one in wanted]


def _study(file: pathlib.Path, search: Search) -> optuna.Study:
    # Optuna's default lock is a symbolic link, which a relative path leaves dangling.
    storage = JournalStorage(JournalFileBackend(str(file), lock_obj=JournalFileOpenLock(str(file))))
    return optuna.create_study(study_name=search.spec, storage=storage, load_if_exists=True)


def _begin(file: pathlib.Path, search: Search) -> None:
    study = _study(file, search)
    known = study.user_attrs.get("about", search.about)
    if names := [name for name in search.about if known.get(name) != search.about[name]]:
        changes = ", ".join(f"{name} ({known.get(name)!r} there, {search.about[name]!r} here)" for name in names)
        raise ResultsError(f"{file} has another search of {search.spec}: {changes}. Choose another folder.")
    study.set_user_attr("about", search.about)
    for trial in study.get_trials(deepcopy=False, states=[TrialState.RUNNING]):  # of a process that was killed
        study.tell(trial.number, state=TrialState.FAIL)


def _work(unit: tuple[pathlib.Path, Search, int, int]) -> None:
    """Plays trials until there are enough."""
    file, search, trials, worker = unit
    study = _study(file, search)
    while (done := len(study.get_trials(deepcopy=False, states=DONE))) < trials:
        # Seeded for each trial, so that a search that is stopped and resumed comes to the same trials.
        words = np.random.SeedSequence([search.seed, worker, done]).generate_state(1)
        study.sampler = optuna.samplers.TPESampler(seed=int(words[0]))
        study.optimize(search, n_trials=1)


def _best(study: optuna.Study, search: Search) -> dict[str, Any]:
    default = float(np.exp(np.mean(np.log(search.costs({}, search.seeds)))))
    trials: list[FrozenTrial] = study.get_trials(deepcopy=False, states=DONE)
    complete: list[tuple[float, dict[str, Any]]] = [
        (one.value, one.user_attrs["settings"]) for one in trials if one.state is TrialState.COMPLETE and one.value
    ]
    cost, settings = min([(default, {}), *complete], key=operator.itemgetter(0))
    digits = {"default": rounded(default, DIGITS), "tuned": rounded(cost, DIGITS)}
    return {"spec": search.spec, "settings": settings, "tried": len(trials) + 1, **digits}
