"""The file of the best settings of each solver, which were searched on validation episodes."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Mapping
from typing import Any, Self

from baselines.canonical import one_line, with_list
from baselines.files import ResultsError, json_files, write
from baselines.fingerprints import fingerprint
from baselines.spec import parse_policy, refuse_trust
from ikgym import scenarios
from ikgym.exceptions import InvalidInputError

#: Where the settings are that the leaderboards read, by the scenario that they were searched on.
DATA = pathlib.Path(__file__).parents[1] / "data" / "tuned"
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
        with json_files.reading("settings", file, f"Search them anew with: {update(file.stem)}"):
            out = json_files.made(cls, json_files.read(file))
            for one in out.solvers:
                refuse_trust(one.variant, str(file))
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


def file_of(scenario: str) -> pathlib.Path:
    """Where the settings for a scenario are."""
    return DATA / f"{scenario}.json"


def update(scenario: str) -> str:
    """What searches the settings for a scenario, and writes them into the folder as tuned.json."""
    return f"ikgym tune --scenario {scenario} --out results/tune"
