"""The best settings of each solver, searched on validation episodes, and the file that keeps them."""

from __future__ import annotations

import dataclasses
import math
import pathlib
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, Self

from baselines import registry
from baselines.canonical import DIGITS, one_line, rounded, with_list
from baselines.evaluation.pages.entries import Entry
from baselines.evaluation.pages.measure import plan, play
from baselines.evaluation.pages.tuning.grids import GRIDS, Stage
from baselines.evaluation.summary import geometric_mean
from baselines.files import ResultsError, json_files, write
from baselines.fingerprints import fingerprint
from baselines.spec import parse_policy, refuse_trust
from baselines.workers import ALONE, Workers
from ikgym import scenarios
from ikgym.exceptions import IkgymError, InvalidInputError
from ikgym.scenarios import Scenario

#: Where the settings are that the leaderboards read, by the scenario that they were searched on.
DATA = pathlib.Path(__file__).parents[3] / "data" / "tuned"
#: What is tuned on: never what scores are published on.
SPLIT, EPISODES = "validation", 64


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

    def save(self, file: pathlib.Path) -> None:
        """Writes the settings as JSON, a solver a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {name: value for name, value in vars(self).items() if name != "solvers"}
        solvers = [one_line(dataclasses.asdict(solver)) for solver in self.solvers]
        write(file, (with_list(head, "solvers", solvers) + "\n").encode())

    @classmethod
    def load(cls, file: pathlib.Path) -> Self:
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
            again = update(file.stem)
            raise ResultsError(f"Cannot read settings from {file}: {reason}. Search them anew with: {again}") from None
        if out.stale:
            again = update(out.scenario)
            raise ResultsError(f"{file}: {out.scenario} has changed since it was tuned on. Tune again with: {again}")
        return out


def of(scenario: str) -> Tuning:
    """The settings for a scenario; none where nothing has been searched for it.

    Raises:
        ResultsError: See :meth:`Tuning.load`.
    """
    file = file_of(scenario)
    if file.is_file():
        return Tuning.load(file)
    return Tuning(update(scenario), "", scenario, fingerprint(scenarios.get(scenario)), SPLIT, 0, ())


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


def file_of(scenario: str) -> pathlib.Path:
    """Where the settings for a scenario are."""
    return DATA / f"{scenario}.json"


def update(scenario: str) -> str:
    """What searches the settings for a scenario."""
    return f"python -m baselines.leaderboard --tune baselines/data/tuned/{scenario}.json --sets {scenario}"


def suiting(scenario: Scenario, grids: Mapping[str, Iterable[Stage]]) -> dict[str, tuple[Stage, ...]]:
    """The grids of the solvers that suit a scenario: some are made for skew coordinates alone."""

    def suits(spec: str) -> bool:
        try:
            name, parameters = parse_policy(spec)
            registry.make(name, scenario, **parameters)
        except InvalidInputError:
            return False
        return True

    return {spec: tuple(stages) for spec, stages in grids.items() if suits(spec)}


def tune(
    command: str,
    date: str,
    scenario: Scenario,
    *,
    grids: Mapping[str, Iterable[Stage]] = GRIDS,
    episodes: int = EPISODES,
    workers: Workers = ALONE,
    progress: bool = False,
) -> Tuning:
    """Searches the settings with the lowest geometric mean of the total cost, stage by stage.

    The mean of logarithms does not change its order when each episode's cost is divided by its best known one, which
    nobody knows for validation episodes: the lowest cost is the lowest cost ratio.

    Args:
        command: What searches.
        date: Of today.
        scenario: What is tuned on. Solvers that do not suit it are left out.
        grids: The stages of each solver.
        episodes: Validation episodes.
        workers: Who plays.
        progress: Whether to show a bar on stderr for each stage.

    Raises:
        UnknownNameError: A grid has a solver or a parameter that there is not.
        InvalidInputError: A solver refuses a value.
        WorkerError: A worker process has died.
    """
    stages = suiting(scenario, grids)
    costs: dict[str, dict[str, tuple[float, Mapping[str, Any]]]] = {solver: {} for solver in stages}
    for number in range(-1, max(map(len, stages.values()))):
        trials = []
        for solver, known in costs.items():
            best = min(known.values(), key=lambda one: one[0])[1] if known else {}
            stage: Stage = ({},) if number < 0 else next(iter(stages[solver][number : number + 1]), ())
            found = [Trial(solver, {**best, **settings}) for settings in stage]
            trials += [trial for trial in found if trial.entry.name not in known]
        for trial, cost in zip(
            trials, _costs(scenario, trials, episodes, workers=workers, progress=progress), strict=True
        ):
            costs[trial.solver][trial.entry.name] = cost, trial.settings
    solvers = []
    for solver, known in costs.items():
        (default, _), (lowest, settings) = next(iter(known.values())), min(known.values(), key=lambda one: one[0])
        solvers.append(Tuned(solver, settings, len(known), rounded(default, DIGITS), rounded(lowest, DIGITS)))
    return Tuning(command, date, scenario.name, fingerprint(scenario), SPLIT, episodes, tuple(solvers))


def _costs(scenario: Scenario, trials: list[Trial], episodes: int, *, workers: Workers, progress: bool) -> list[float]:
    """The geometric mean of each trial's total costs; infinite where one is no number."""
    plans = plan(scenario, [trial.entry for trial in trials], episodes, split=SPLIT)
    rows = play(plans, workers=workers, progress=progress)
    totals = [[row.total_cost for row in rows[trial.entry.name]] for trial in trials]
    return [geometric_mean(some) if all(map(math.isfinite, some)) else math.inf for some in totals]
