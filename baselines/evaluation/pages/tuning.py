"""The best settings of each solver, searched on validation episodes, and the file that keeps them."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, Self

from baselines.canonical import DIGITS, one_line, rounded, with_list
from baselines.evaluation.pages.entries import Entry
from baselines.evaluation.pages.grids import GRIDS, Stage
from baselines.evaluation.pages.measure import plan, play
from baselines.evaluation.summary import geometric_mean
from baselines.files import ResultsError, json_files, write
from baselines.fingerprints import fingerprint
from baselines.spec import parse_policy, refuse_trust
from ikgym import scenarios
from ikgym.exceptions import IkgymError, InvalidInputError

#: The settings that the leaderboard reads.
DATA = pathlib.Path(__file__).parents[2] / "data" / "tuned.json"
#: What is tuned on: never what scores are published on.
SCENARIO, SPLIT, EPISODES = "varga7-random", "validation", 64
#: What brings the file up to date.
UPDATE = "python -m baselines.leaderboard --tune baselines/data/tuned.json"


@dataclasses.dataclass(frozen=True)
class Tuned:
    """The best settings of a solver.

    Args:
        spec: The solver as it was, see :data:`baselines.spec.PolicySpec`.
        settings: The parameters that make it better; none where nothing that was tried did.
        tried: How many settings were tried, the solver as it was among them.
        default: Geometric mean of the total cost of the solver as it was.
        tuned: The same with the settings.
    """

    spec: str
    settings: Mapping[str, Any]
    tried: int
    default: float
    tuned: float

    @property
    def variant(self) -> tuple[str, dict[str, Any]]:
        """Name and parameters."""
        name, parameters = parse_policy(self.spec)
        return name, {**parameters, **self.settings}


@dataclasses.dataclass(frozen=True)
class Tuning:
    """All settings, and what they were searched on.

    Args:
        command: What searched.
        date: When, as YYYY-MM-DD.
        scenario: The name of what was played.
        fingerprint: Of that scenario.
        split: Where the episodes come from.
        episodes: The first so many seeds of the split.
        solvers: What came out of it.

    Raises:
        InvalidInputError: The split is that for testing.
    """

    command: str
    date: str
    scenario: str
    fingerprint: str
    split: str
    episodes: int
    solvers: tuple[Tuned, ...]

    def __post_init__(self) -> None:
        if self.split == "test":
            raise InvalidInputError("Nothing may be tuned on the split 'test', which scores are published on.")

    @property
    def settings(self) -> dict[str, Mapping[str, Any]]:
        """The best settings of each solver, by its spec."""
        return {one.spec: one.settings for one in self.solvers}

    @property
    def seeds(self) -> tuple[int, ...]:
        """The reset seeds of the episodes."""
        return scenarios.seeds(self.split, self.episodes)

    @property
    def stale(self) -> bool:
        """Whether the scenario, or the cost, is no longer what the settings were searched on."""
        return fingerprint(scenarios.get(self.scenario)) != self.fingerprint

    def save(self, file: pathlib.Path = DATA) -> None:
        """Writes the settings as JSON, a solver a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {name: value for name, value in vars(self).items() if name != "solvers"}
        solvers = [one_line(dataclasses.asdict(solver)) for solver in self.solvers]
        write(file, (with_list(head, "solvers", solvers) + "\n").encode())

    @classmethod
    def load(cls, file: pathlib.Path = DATA) -> Self:
        """What :meth:`save` wrote.

        Raises:
            ResultsError: It cannot be read, or is damaged, or belongs to a scenario or cost that has changed since.
        """
        try:
            out = json_files.made(cls, json_files.read(file))
            for one in out.solvers:
                refuse_trust(one.variant, str(file))
        except (OSError, ValueError, IkgymError) as e:
            reason = str(e).removesuffix(".")
            raise ResultsError(f"Cannot read settings from {file}: {reason}. Search them anew with: {UPDATE}") from None
        if out.stale:
            raise ResultsError(f"{file}: {out.scenario} has changed since it was tuned on. Tune again with: {UPDATE}")
        return out


class Trial(NamedTuple):
    """A solver with settings that are tried."""

    solver: str
    settings: Mapping[str, Any]

    @property
    def entry(self) -> Entry:
        """What is measured; its name tells it from all other trials."""
        name, parameters = parse_policy(self.solver)
        variant = name, {**parameters, **self.settings}
        return Entry(one_line({"solver": self.solver, **self.settings}), (variant,), timed=0)


def tune(
    command: str,
    date: str,
    *,
    grids: Mapping[str, Iterable[Stage]] = GRIDS,
    episodes: int = EPISODES,
    workers: int = 1,
    progress: bool = False,
) -> Tuning:
    """Searches the settings with the lowest geometric mean of the total cost, stage by stage.

    The mean of logarithms does not change its order when each episode's cost is divided by its best known one, which
    nobody knows for validation episodes: the lowest cost is the lowest cost ratio.

    Args:
        command: What searches.
        date: Of today.
        grids: The stages of each solver.
        episodes: Validation episodes.
        workers: Processes.
        progress: Whether to show a bar on stderr for each stage.

    Raises:
        UnknownNameError: A grid has a solver or a parameter that there is not.
        InvalidInputError: A solver refuses a value.
        WorkerError: A worker process has died.
    """
    stages = {solver: tuple(stages) for solver, stages in grids.items()}
    costs: dict[str, dict[str, tuple[float, Mapping[str, Any]]]] = {solver: {} for solver in grids}
    for number in range(-1, max(map(len, stages.values()))):
        trials = []
        for solver, known in costs.items():
            best = min(known.values(), key=lambda one: one[0])[1] if known else {}
            stage: Stage = ({},) if number < 0 else next(iter(stages[solver][number : number + 1]), ())
            found = [Trial(solver, {**best, **settings}) for settings in stage]
            trials += [trial for trial in found if trial.entry.name not in known]
        for trial, cost in zip(trials, _costs(trials, episodes, workers, progress), strict=True):
            costs[trial.solver][trial.entry.name] = cost, trial.settings
    solvers = []
    for solver, known in costs.items():
        (default, _), (lowest, settings) = next(iter(known.values())), min(known.values(), key=lambda one: one[0])
        solvers.append(Tuned(solver, settings, len(known), rounded(default, DIGITS), rounded(lowest, DIGITS)))
    return Tuning(command, date, SCENARIO, fingerprint(scenarios.get(SCENARIO)), SPLIT, episodes, tuple(solvers))


def _costs(trials: list[Trial], episodes: int, workers: int, progress: bool) -> list[float]:
    """The geometric mean of each trial's total costs; infinite where one is no number."""
    plans = plan(scenarios.get(SCENARIO), [trial.entry for trial in trials], episodes, split=SPLIT)
    rows = play(plans, workers=workers, progress=progress)
    totals = [[row.total_cost for row in rows[trial.entry.name]] for trial in trials]
    return [geometric_mean(some) if all(map(math.isfinite, some)) else math.inf for some in totals]
