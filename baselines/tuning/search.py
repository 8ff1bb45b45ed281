"""The search for the settings of solvers: trials of Optuna, kept in a journal, each the cost of validation episodes."""

from __future__ import annotations

import contextlib
import dataclasses
import operator
import os
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.trial import Trial, TrialState

from baselines import registry
from baselines.episodes import add_up, rollouts
from baselines.files import canonical, check_flags, check_same, read_bytes, reading
from baselines.fingerprints import fingerprint
from baselines.registry import parse_policy
from baselines.tuning.ranges import RANGES, Range, nest, ranges_of, read_ranges, round_digits, suggest
from baselines.workers import Workers, run_units
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import Scenario
from ikgym.validation import whole_number

#: Episodes that settings are searched on: never those that scores are published on.
SPLIT, EPISODES = "validation", 64
#: Episodes that are played before a trial can be pruned for the first time.
FIRST = 8
#: The file with the trials of a folder, for Optuna.
JOURNAL = "study.journal"
#: States of trials that count.
DONE = (TrialState.COMPLETE, TrialState.PRUNED)


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
        settings = suggest(trial, self.ranges, parse_policy(self.spec)[1])
        trial.set_user_attr("settings", settings)
        costs: list[float] = []
        while len(costs) < len(self.seeds):
            costs += self.costs(settings, self.seeds[len(costs) : max(FIRST, 2 * len(costs))])
            trial.report(_mean(costs), len(costs))
            if len(costs) < len(self.seeds) and trial.should_prune():
                raise optuna.TrialPruned
        return _mean(costs)

    def costs(self, settings: Mapping[str, Any], seeds: Sequence[int]) -> list[float]:
        """The total costs of episodes with some settings."""
        return [float(add_up(one.cost)) for one in rollouts(self.scenario, self.make(settings), seeds)]

    def make(self, settings: Mapping[str, Any]) -> Any:
        """The solver with some settings.

        Raises:
            InvalidInputError: It does not suit the scenario, or refuses a value.
        """
        name, parameters = parse_policy(self.spec)
        return registry.make(name, self.scenario, **{**parameters, **settings})


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
    if not scenario.varies:
        raise InvalidInputError(
            f"{scenario.name} is the same at every reset: expected a scenario whose episodes differ."
        )
    seeds, ranges = (
        scenarios.seeds(SPLIT, episodes),
        {**read_ranges(RANGES), **({} if file is None else read_ranges(file))},
    )
    whole_number("seed", seed, at_least=0)
    found = [Search(scenario, spec, ranges_of(spec, ranges), seeds, seed) for spec in policies or ranges]
    names = {one.spec.partition(":")[0] for one in found}
    if file is not None and names.isdisjoint(spec.partition(":")[0] for spec in read_ranges(file)):
        raise InvalidInputError(f"{file}: expected ranges of a solver that is searched, {', '.join(policies)}.")
    if not policies:
        found = [one for one in found if _suits(one)]
    for one in found:
        given = parse_policy(one.spec)[1]
        for name, line in one.ranges.items():
            needed = {other: values[0] for other, values in line.get("when", {}).items()}
            for value in line.get("choices") or (line["low"], line["high"]):
                one.make(needed | nest(name, value, {**given, **needed}))
    return found


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
    if not check_flags(file, resume=resume, overwrite=overwrite):
        file.unlink(missing_ok=True)
    pathlib.Path(f"{file}.lock").unlink(missing_ok=True)  # of a process that was killed
    with reading(file, "Begin again with --overwrite."):
        if file.exists():  # without a line that was not written to its end
            os.truncate(file, read_bytes(file).rfind(b"\n") + 1)
        for one in wanted:
            _begin(file, one)
    units = [(file, one, trials, worker) for one in wanted for worker in range(crew.number)]
    if crew.here:
        for unit in units:
            _work(unit)
    else:
        # Not retried: a killed process may leave the journal locked.
        with contextlib.closing(run_units(_work, units, crew, tries=1)) as done:
            for _, future in done:
                future.result()
    return [_best(_study(file, one), one) for one in wanted]


def _study(file: pathlib.Path, search: Search) -> optuna.Study:
    # Optuna's default lock is a symbolic link, which a relative path leaves dangling.
    storage = JournalStorage(JournalFileBackend(str(file), lock_obj=JournalFileOpenLock(str(file))))
    return optuna.create_study(study_name=search.spec, storage=storage, load_if_exists=True)


def _begin(file: pathlib.Path, search: Search) -> None:
    """Begins a study, or continues the same one."""
    study = _study(file, search)
    about = {"fingerprint": fingerprint(search.scenario), "episodes": len(search.seeds), "seed": search.seed}
    about |= {"ranges": canonical(dict(search.ranges))}
    check_same(file, study.user_attrs.get("about", about), about, f" of {search.spec}")
    study.set_user_attr("about", about)
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
    default, trials = _mean(search.costs({}, search.seeds)), study.get_trials(deepcopy=False, states=DONE)
    complete: list[tuple[float, dict[str, Any]]] = [
        (one.value, one.user_attrs["settings"]) for one in trials if one.state is TrialState.COMPLETE and one.value
    ]
    cost, settings = min([(default, {}), *complete], key=operator.itemgetter(0))
    digits = {"default": round_digits(default), "tuned": round_digits(cost)}
    return {"spec": search.spec, "settings": settings, "tried": len(trials) + 1, **digits}


def _mean(costs: Sequence[float]) -> float:
    """The geometric mean."""
    return float(np.exp(np.mean(np.log(costs))))


def _suits(search: Search) -> bool:
    try:
        search.make({})
    except InvalidInputError:
        return False
    return True
