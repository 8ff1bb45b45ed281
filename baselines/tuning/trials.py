"""The trials of searches: played by processes, kept in a journal, resumed, and the best of them."""

from __future__ import annotations

import contextlib
import operator
import os
import pathlib
from collections.abc import Sequence
from typing import Any

import numpy as np
import optuna
from optuna.storages import JournalStorage
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.trial import FrozenTrial, TrialState

from baselines.canonical import DIGITS, rounded
from baselines.files import ResultsError, check_flags, read_bytes, reading
from baselines.tuning.search import Search
from baselines.workers import Workers, finished

#: The file with the trials of a folder, for Optuna.
JOURNAL = "study.journal"
#: States of trials that count.
DONE = (TrialState.COMPLETE, TrialState.PRUNED)


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
