"""A search by Optuna in a folder: several processes, one journal, and whoever is stopped goes on where he was.

Values are suggested by the tree-structured Parzen estimator (Bergstra et al. 2011), and trials that are worse than the
median of those before at the same step are ended early (Golovin et al. 2017).
"""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Generic, TypeVar

import numpy as np
import optuna
from optuna.storages.journal import JournalFileBackend, JournalFileOpenLock
from optuna.trial import FrozenTrial, Trial, TrialState
from tqdm import tqdm

from baselines.files import ResultsError
from baselines.workers import WorkerError, Workers
from baselines.workers import finished as done_by
from ikgym.exceptions import IkgymError

#: Where the trials of a folder are.
JOURNAL = "study.journal"
#: Trials that are played to their end before any is ended early.
STARTUP = 5
#: What counts: the states of trials from which something was learned.
FINISHED = (TrialState.COMPLETE, TrialState.PRUNED)

#: The value of a trial, which is to be low. It reports values on the way, and ends early where that is asked for.
Objective = Callable[[Trial], float]
ObjectiveT = TypeVar("ObjectiveT", bound=Objective)


class StudyError(IkgymError):
    """A search cannot go on."""


@dataclasses.dataclass(frozen=True)
class Study(Generic[ObjectiveT]):
    """One search.

    Args:
        name: What it is called in the journal.
        objective: What is minimised; it can be sent to other processes.
        identity: What must be the same where it is gone on with, as JSON has it.
        budget: How much is spent before no further trial begins.
        seed: Of what is suggested. One worker comes to the same trials, whether or not it was stopped on the way;
            several ask in the order in which they get done.
        spent: What a finished trial has cost, in the unit of the budget.
    """

    name: str
    objective: ObjectiveT
    identity: Mapping[str, Any]
    budget: int
    seed: int
    spent: Callable[[FrozenTrial], int]


def prepare(folder: pathlib.Path, studies: Sequence[Study[Any]], *, resume: bool, overwrite: bool) -> None:
    """Makes the journal, or sees to it that the one that is there is of the same search.

    Trials that were under way when a process ended are given up. The caller has the folder to itself.

    Raises:
        ResultsError: There is a journal and neither flag is given; or it is damaged, or of another search.
    """
    file = folder / JOURNAL
    if resume and overwrite:
        raise ResultsError("--resume keeps the trials that are there, --overwrite replaces them: choose one.")
    if file.exists() and not (resume or overwrite):
        raise ResultsError(
            f"{file} is there already: go on with it by --resume, replace it by --overwrite, or choose another folder."
        )
    try:
        if overwrite:
            file.unlink(missing_ok=True)
        _mend(file)
        known = {study.study_name: study for study in _opened_all(file)}
        for study in studies:
            there = known.get(study.name) or _made(file, study)
            _check_same(file, study, there)
            for trial in there.get_trials(deepcopy=False, states=[TrialState.RUNNING]):
                there.tell(trial.number, state=TrialState.FAIL)
    except OSError as e:
        raise ResultsError(f"Cannot write into {folder}: {e.strerror or e}.") from None
    except (ValueError, KeyError) as e:  # what a damaged journal makes Optuna raise
        raise ResultsError(f"{file} is damaged: {e}. Begin anew with --overwrite.") from None


def search(folder: pathlib.Path, studies: Sequence[Study[Any]], *, workers: int, unit: str, progress: bool) -> None:
    """Spends the budgets of the studies, one study after the other.

    Args:
        folder: Where :func:`prepare` has made the journal.
        studies: What is searched.
        workers: Processes that play trials of the same study at the same time; 1 means this one.
        unit: Of the budgets, for the bar.
        progress: Whether to show a bar on stderr.

    Raises:
        StudyError: A worker process has died.
        IkgymError: What the objective raises.
    """
    bar = tqdm(
        total=sum(study.budget for study in studies),
        disable=not progress,
        file=sys.stderr,
        unit=unit,
        dynamic_ncols=True,
        mininterval=0.1 if sys.stderr.isatty() else 10.0,  # a log file has no cursor to go back with
    )

    there = [opened(folder, study.name) for study in studies]

    def show() -> None:
        done = sum(min(spent_by(study, one), study.budget) for study, one in zip(studies, there, strict=True))
        bar.update(done - bar.n)

    with bar:
        if workers == 1:
            for study in studies:
                _work(folder, study, 0, show)
        else:
            _in_processes(folder, studies, workers, show)
        show()


def opened(folder: pathlib.Path, name: str) -> optuna.Study:
    """A study of a folder."""
    file = folder / JOURNAL
    with _quietly():
        pruner = optuna.pruners.MedianPruner(n_startup_trials=STARTUP)
        return optuna.load_study(study_name=name, storage=_storage(file), pruner=pruner)


def spent_by(study: Study[Any], there: optuna.Study) -> int:
    """What the finished trials of a study have cost."""
    return sum(study.spent(trial) for trial in finished(there))


def finished(there: optuna.Study) -> list[FrozenTrial]:
    """The trials from which something was learned."""
    return there.get_trials(deepcopy=False, states=FINISHED)


def _work(folder: pathlib.Path, study: Study[Any], worker: int, show: Callable[[], None] | None = None) -> None:
    """Plays trials of a study until its budget is spent."""
    there = opened(folder, study.name)
    while spent_by(study, there) < study.budget:
        # A generator for each trial: what is suggested depends on what is known, not on who was stopped when.
        words = np.random.SeedSequence([study.seed, worker, len(finished(there))]).generate_state(1)
        there.sampler = optuna.samplers.TPESampler(seed=int(words[0]))
        with _quietly():
            there.optimize(study.objective, n_trials=1)
        if show is not None:
            show()


def _in_processes(folder: pathlib.Path, studies: Sequence[Study[Any]], workers: int, show: Callable[[], None]) -> None:
    for study in studies:
        units = [(folder, study, worker) for worker in range(workers)]
        # Not tried again: who is killed may leave the journal locked, which is mended where a search begins.
        for _, future in done_by(_share, units, Workers(workers), tries=1):
            try:
                future.result()
            except WorkerError as e:
                raise StudyError(f"{study.name}: {e} Finished trials are kept; continue with --resume.") from None
            show()


def _share(unit: tuple[pathlib.Path, Study[Any], int]) -> None:
    """What one of several workers does of a study."""
    _work(*unit)


def _storage(file: pathlib.Path) -> optuna.storages.JournalStorage:
    # Optuna's default is a symbolic link, which a relative path leaves dangling: who meets a left one waits for ever.
    return optuna.storages.JournalStorage(JournalFileBackend(str(file), lock_obj=JournalFileOpenLock(str(file))))


def _mend(file: pathlib.Path) -> None:
    """Removes what a killed process may have left: Optuna's lock, and a line that was not written to its end."""
    file.with_name(f"{file.name}.lock").unlink(missing_ok=True)
    if not file.exists():
        return
    with file.open("r+b") as journal:
        content = journal.read()
        journal.truncate(content.rfind(b"\n") + 1)


def _opened_all(file: pathlib.Path) -> list[optuna.Study]:
    with _quietly():
        storage = _storage(file)
        return [optuna.load_study(study_name=name, storage=storage) for name in optuna.get_all_study_names(storage)]


def _made(file: pathlib.Path, study: Study[Any]) -> optuna.Study:
    with _quietly():
        there = optuna.create_study(study_name=study.name, storage=_storage(file), direction="minimize")
        there.set_user_attr("identity", dict(study.identity))
    return there


def _check_same(file: pathlib.Path, study: Study[Any], there: optuna.Study) -> None:
    known = there.user_attrs.get("identity", {})
    names = [name for name in {**known, **study.identity} if known.get(name) != study.identity.get(name)]
    if names:
        what = ", ".join(f"{name} ({known.get(name)!r} there, {study.identity.get(name)!r} here)" for name in names)
        raise ResultsError(
            f"{file} has another search of {study.name}: {what}. Go on with that, or choose another folder."
        )


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """Without Optuna's line for every trial."""
    level = optuna.logging.get_verbosity()
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    try:
        yield
    finally:
        optuna.logging.set_verbosity(level)
