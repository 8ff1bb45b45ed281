"""A search of hyperparameters: trainings with other options, judged by their validation, by Optuna."""

from __future__ import annotations

import dataclasses
import json
import math
import pathlib
from collections import Counter
from typing import Any

import optuna
from optuna.trial import FrozenTrial, Trial

from baselines.canonical import canonical, jsonable
from baselines.files import write
from baselines.files.locks import locked
from baselines.fingerprints import fingerprint
from baselines.training.config.base import Config
from baselines.training.errors import TrainingError
from baselines.training.score import Score
from baselines.training.seeds import SeedRuns
from baselines.tuning.ranges import Range, ends, read, suggested
from baselines.tuning.study import Study, finished, opened, prepare, search
from ikgym.exceptions import InvalidInputError
from ikgym.validation import known_names

#: What is tried of each method.
FILE = pathlib.Path(__file__).parents[1] / "data" / "training_ranges.toml"
#: The options of the best trial, as a preset.
BEST = "best.toml"


@dataclasses.dataclass(frozen=True)
class Training:
    """The cost of an agent on validation episodes, by the options that it was trained with.

    Args:
        runs: The options that are not searched, and the folder; a trial has ``trial-N`` in it.
        seed: Of all trainings.
        ranges: What is searched.
    """

    runs: SeedRuns
    seed: int
    ranges: tuple[Range, ...]

    def __call__(self, trial: Trial) -> float:
        """The geometric mean of the costs of the kept agent.

        It is infinite where the weights diverge, or the method refuses the options: which ones suit each other depends
        on the scenario, such as divisors of what is collected in an episode.

        Raises:
            TrialPruned: It is ended early, as its validations are worse than those of others.
        """
        # PyTorch takes seconds to load.
        from baselines.training.run import train

        options = suggested(trial, self.ranges, {})
        trial.set_user_attr("options", options)

        def on_segment(done: int, score: Score | None) -> None:
            if score is None or not math.isfinite(score.cost):
                return
            trial.report(score.cost, done)
            if done < self.runs.config.segments and trial.should_prune():
                raise optuna.TrialPruned

        try:
            result = train(
                with_options(self.runs.config, options),
                self.seed,
                self.runs.out / f"trial-{trial.number}",
                overwrite=True,
                checkpoint_every=math.inf,
                command=self.runs.command,
                on_segment=on_segment,
            )
        except (TrainingError, InvalidInputError) as e:
            trial.set_user_attr("error", str(e))
            return math.inf
        return result.score.cost


def with_options(config: Config, options: dict[str, Any]) -> Config:
    """A configuration with some options changed, checked anew.

    Raises:
        UnknownNameError: There is no such option.
        InvalidInputError: A value is refused.
    """
    return type(config).from_json({**config.to_json(), **options})


def searched(
    runs: SeedRuns, seed: int, *, trials: int, ranges: pathlib.Path | None, workers: int, progress: bool
) -> str:
    """Searches, writes the options of the best trial as a preset, and says what they are.

    Args:
        runs: The options that are not searched; `resume` and `overwrite` are those of the search.
        seed: Of all trainings, and of what is suggested.
        trials: How many, with those that are ended early.
        ranges: A file of ranges; those that come with the methods if left out.
        workers: Processes that train at the same time.
        progress: Whether to show a bar on stderr.

    Raises:
        IkgymError: Something expected went wrong.
    """
    study = planned(runs, seed, trials, ranges)
    with locked(runs.out):
        prepare(runs.out, [study], resume=runs.resume, overwrite=runs.overwrite)
        search(runs.out, [study], workers=workers, unit="trial", progress=progress)
        ended = finished(opened(runs.out, study.name))
        without = Counter(trial.user_attrs["error"] for trial in ended if "error" in trial.user_attrs)
        whole = {trial.value: trial for trial in ended if trial.state.name == "COMPLETE" and trial.value is not None}
        best = whole[min(whole)]
        if not math.isfinite(min(whole)):
            raise TrainingError(f"None of {len(ended)} trials has an agent: {'; '.join(without)}")
        write(runs.out / BEST, _toml({"method": runs.config.method, **best.user_attrs["options"]}).encode())
    return "\n".join(
        [
            f"best of {len(ended)} trials: trial {best.number}, cost {best.value:.5g} on validation episodes",
            *(f"{name} = {value!r}" for name, value in best.user_attrs["options"].items()),
            *(f"without an agent, {count} of them: {error}" for error, count in without.items()),
        ]
    )


def planned(runs: SeedRuns, seed: int, trials: int, ranges: pathlib.Path | None) -> Study[Training]:
    """The search, checked before anything is trained.

    Raises:
        UnknownNameError: A range is of an option that the method has not.
        InvalidInputError: No range is stated for the method, the method refuses an end of one, or the file of ranges
            cannot be read.
    """
    config = runs.config
    tables = read(ranges or FILE)
    lines = tables.get(config.method, ())
    if not lines:
        raise InvalidInputError(
            f"No range is stated for an option of {config.method}: expected a table [{config.method}] in "
            f"{ranges or FILE.name}, there are: {', '.join(tables) or 'none'}."
        )
    known_names(f"option of {config.method}", [one.name for one in lines], config.to_json())
    for options in ends(lines, {}):
        with_options(config, options)
    identity = {
        "config": config.to_json(),
        "fingerprint": fingerprint(config.make_scenario()),
        "seed": seed,
        "ranges": canonical([jsonable(dataclasses.asdict(one)) for one in lines]),
    }
    return Study(config.method, Training(runs, seed, lines), identity, trials, seed, _one)


def _one(trial: FrozenTrial) -> int:
    """The budget is counted in trials."""
    del trial
    return 1


def _toml(values: dict[str, Any]) -> str:
    """Options as a preset has them: JSON's numbers, texts and lists are TOML's."""
    return "".join(f"{name} = {json.dumps(value)}\n" for name, value in values.items())
