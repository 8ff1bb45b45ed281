"""The one table model: costs, errors and times of each entry on each set of episodes, and the file that keeps them."""

from __future__ import annotations

import dataclasses
import pathlib
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Self

import numpy as np

from baselines.canonical import DIGITS, one_line, rounded, with_list
from baselines.evaluation.metrics import Row
from baselines.evaluation.pages import sets
from baselines.evaluation.pages.entries import ENOUGH, FORESIGHT, PAPER, Entry, Training, label
from baselines.evaluation.summary import Spread, times
from baselines.files import ResultsError, json_files, write
from baselines.fingerprints import fingerprint
from baselines.oracle import best_known
from baselines.status import Status
from ikgym.exceptions import InvalidInputError
from ikgym.validation import FloatArray

#: Of the files; those of another one are refused.
FORMAT = 2
#: Kinds of lines, in the order of the legend.
AGENT, RESIDUAL, FAR, NEAR, REFERENCE = "agent", "residual agent", "solver with foresight", "solver", "reference"
#: A number of each run: a row a seed, a column an episode.
Runs = tuple[tuple[float, ...], ...]


@dataclasses.dataclass(frozen=True)
class Line:
    """A solver or an agent on a set of episodes.

    Args:
        name: The solver's spec, or the agent's name.
        settings: Parameters that were searched on validation episodes; none for a solver as it is, and for agents.
        preview: Steps ahead that it sees.
        seeds: Seeds of training, or of the policy; none where nothing is drawn at random.
        cost: Total cost of each episode, a row a seed; one row where there is none. Who takes very long has played
            fewer than the others, the first ones.
        error: Largest distance from the nominal position in [m], likewise; None in what was measured when only the
            number of runs that lost track was kept.
        lost: How many runs lost track, see :func:`baselines.evaluation.metrics.lost`; where no angles are kept, by
            their position alone.
        timed: Episodes that were played with the clock.
        time_p50_us: Median of the medians over the calls after the first, in [µs]; None where nothing was timed.
        time_p99_us: Largest 99th percentile of them, in [µs].
        time_first_us: Longest first call, in [µs].
        training: What it has cost to train; None for solvers.
        angle: Largest geodesic angle to the nominal orientation in [rad], like the error; None where the scenario has
            no orientation, and in what was measured when arms were lost by their position alone.
        held: Steps in which a stop, the velocity and the acceleration limit held a joint back, over all runs; None in
            what was measured when they were not kept.
        unsolved: Steps in which the solver found nothing and the arm was stopped, likewise.
    """

    name: str
    settings: Mapping[str, Any]
    preview: int
    seeds: tuple[int, ...]
    cost: Runs
    error: Runs | None
    lost: int
    timed: int
    time_p50_us: float | None
    time_p99_us: float | None
    time_first_us: float | None
    training: Training | None
    angle: Runs | None = None
    held: tuple[int, int, int] | None = None
    unsolved: int | None = None

    @classmethod
    def of(cls, entry: Entry, rows: Sequence[Row]) -> Self:
        """The line of an entry's rows, seed by seed."""
        clocked = times(rows)
        angles = [row.orientation_error_max for row in rows if row.orientation_error_max is not None]
        p50, p99, first = (None if time is None else rounded(time) for time in clocked[1:])
        return cls(
            name=entry.name,
            settings=dict(entry.settings),
            preview=max(int(np.max(row.preview)) for row in rows),
            seeds=entry.seeds,
            cost=_by_seed(entry, (rounded(row.total_cost, DIGITS) for row in rows)),
            error=_by_seed(entry, (rounded(row.position_error_max) for row in rows)),
            lost=sum(row.lost for row in rows),
            timed=clocked.timed,
            time_p50_us=p50,
            time_p99_us=p99,
            time_first_us=first,
            training=entry.training,
            angle=_by_seed(entry, map(rounded, angles)) if angles else None,
            held=(
                sum(row.steps_at_joint_limit for row in rows),
                sum(row.steps_at_velocity_limit for row in rows),
                sum(row.steps_at_acceleration_limit for row in rows),
            ),
            unsolved=sum(row.status_counts.get(Status.DIVERGED.label, 0) for row in rows),
        )

    @property
    def label(self) -> str:
        """What tells it from all others."""
        return label(self.name, self.settings)

    @property
    def kind(self) -> str:
        """What it is, in words."""
        if self.training is None:
            return NEAR if self.preview <= PAPER else FAR
        return AGENT if self.training.base_policy is None else RESIDUAL

    @property
    def learned(self) -> bool:
        """Whether it was trained."""
        return self.training is not None

    @property
    def benchmark(self) -> bool:
        """Whether it has seeds enough to be more than an anecdote."""
        return not self.learned or len(self.seeds) >= ENOUGH

    def within(self, distance: float) -> float | None:
        """The share of all runs that never were farther from the nominal position, in [m]; None if not kept."""
        return None if self.error is None else float(np.mean(np.array(self.error) <= distance))

    @property
    def runs(self) -> int:
        """Seeds × episodes."""
        return int(np.size(self.cost))

    @property
    def episodes(self) -> int:
        """How many it has played, the first ones of the set."""
        return len(self.cost[0])


@dataclasses.dataclass(frozen=True)
class Section:
    """A set of episodes and all that was measured on it.

    Args:
        name: Of the test set or the scenario, see :func:`baselines.evaluation.pages.sets.get`.
        fingerprint: Of the scenario.
        test_set: The digest of the test set; None where it is none.
        seeds: The reset seeds.
        lines: What was measured.
    """

    name: str
    fingerprint: str
    test_set: str | None
    seeds: tuple[int, ...]
    lines: tuple[Line, ...]

    @property
    def best_known(self) -> list[float] | None:
        """The best known cost of each episode; None where one is not known."""
        costs = [cost for cost in best_known.costs(sets.get(self.name), self.seeds) if cost is not None]
        return costs if len(costs) == len(self.seeds) else None

    @property
    def oriented(self) -> bool:
        """Whether arms count as lost by their orientation, too."""
        return any(line.angle is not None for line in self.lines)

    @property
    def quantity(self) -> str:
        """What :meth:`cost_ratios` states, in words."""
        return "cost ratio" if self.best_known is not None else f"cost relative to {FORESIGHT}"

    @property
    def reference(self) -> FloatArray:
        """What the costs are stated relative to: the best known ones, else the lowest over the foresight's seeds.

        One seed would not do: even that preset loses track now and then, and all others would seem to excel there.

        Raises:
            InvalidInputError: There is neither.
        """
        if (known := self.best_known) is not None:
            return np.array(known)
        presets = [line for line in self.lines if line.label.partition(":")[0] == FORESIGHT]
        costs = [row for line in presets for row in line.cost if len(row) == len(self.seeds)]
        if not costs:
            raise InvalidInputError(f"{self.name} has no best known costs, and {FORESIGHT} was not played to stand in.")
        lowest: FloatArray = np.array(costs).min(axis=0)
        return lowest

    def cost_ratios(self) -> dict[str, FloatArray]:
        """The cost of each line relative to the reference, by its label. Shape (s, e) each."""
        reference = self.reference
        return {line.label: np.array(line.cost) / reference[: line.episodes] for line in self.lines}

    def spreads(self) -> dict[str, Spread]:
        """The cost ratio of each line over all of its runs, by its label."""
        return {name: Spread.over(cost_ratios) for name, cost_ratios in self.cost_ratios().items()}

    def ranked(self) -> list[Line]:
        """The lines from the lowest geometric mean on."""
        spreads = self.spreads()
        return sorted(self.lines, key=lambda line: spreads[line.label].mean)

    @property
    def stale(self) -> bool:
        """Whether the scenario, or the cost, is no longer what was measured."""
        return fingerprint(sets.get(self.name)) != self.fingerprint


@dataclasses.dataclass(frozen=True)
class Submitted:
    """A submission, see :mod:`baselines.evaluation.pages.submissions`.

    Args:
        name: That of its line.
        authors: Who made it.
        commands: What it was made with.
        foresight: Steps ahead that it looks.
        tuned_on: The splits on which anything was trained or chosen.
        digest: Of its files, in twelve digits.
        date: When it was scored, as YYYY-MM-DD.
    """

    name: str
    authors: tuple[str, ...]
    commands: tuple[str, ...]
    foresight: int
    tuned_on: tuple[str, ...]
    digest: str
    date: str


@dataclasses.dataclass(frozen=True)
class Renewal:
    """Lines that were played after the others, see :mod:`baselines.evaluation.pages.renewal`.

    Args:
        labels: Of the lines.
        command: What played them.
        date: When, as YYYY-MM-DD.
    """

    labels: tuple[str, ...]
    command: str
    date: str


@dataclasses.dataclass(frozen=True)
class Measurement:
    """What a page is made from.

    Args:
        command: What measured it.
        date: When, as YYYY-MM-DD.
        machine: On what, see :func:`baselines.evaluation.machine.describe`.
        sections: What came out, by sets of episodes.
        submissions: Those of the lines that others have handed in.
        renewals: Those that were played after the others.
    """

    command: str
    date: str
    machine: Mapping[str, Any]
    sections: tuple[Section, ...]
    submissions: tuple[Submitted, ...] = ()
    renewals: tuple[Renewal, ...] = ()

    def save(self, file: pathlib.Path) -> None:
        """Writes it as JSON, a line of the table a line.

        Raises:
            ResultsError: The file cannot be written.
        """
        head = {"format": FORMAT, "command": self.command, "date": self.date, "machine": dict(self.machine)}
        for name in ("submissions", "renewals"):
            if records := getattr(self, name):
                head[name] = [dataclasses.asdict(one) for one in records]
        sections = []
        for one in self.sections:
            about = {name: value for name, value in vars(one).items() if name != "lines"}
            sections.append(with_list(about, "lines", [one_line(dataclasses.asdict(line)) for line in one.lines]))
        write(file, (with_list(head, "sections", sections) + "\n").encode())

    @classmethod
    def load(cls, file: pathlib.Path) -> Self:
        """What :meth:`save` wrote.

        Raises:
            ResultsError: It cannot be read, is damaged, or has another format.
        """
        with json_files.reading("what was measured", file):
            content = json_files.read(file)
            if isinstance(content, dict) and (there := content.pop("format", 1)) != FORMAT:
                raise ResultsError(f"{file}: expected format {FORMAT}, got {there!r:.60}. Measure again with --out.")
            out = json_files.made(cls, content)
            for section in out.sections:
                _check_runs(section)
        return out


def _check_runs(section: Section) -> None:
    """Insists on a cost above 0 of each episode, and an error of each where they are kept."""
    for line in section.lines:
        for name, runs in (("cost", line.cost), ("error", line.error), ("angle", line.angle)):
            lengths = {len(row) for row in (*(runs or ()), *line.cost)}
            if runs is not None and not (runs and len(lengths) == 1 and 0 < lengths.pop() <= len(section.seeds)):
                raise InvalidInputError(
                    f"{section.name}, {line.label}: the key {name!r} should have at most {len(section.seeds)} episodes "
                    "a row, as many as it has costs"
                )
        if any(cost < 0.0 for row in line.cost for cost in row):
            raise InvalidInputError(f"{section.name}, {line.label}: expected costs of at least 0")


def _by_seed(entry: Entry, numbers: Iterable[float]) -> Runs:
    each = list(numbers)
    size = len(each) // max(len(entry.seeds), 1)
    return tuple(tuple(each[first : first + size]) for first in range(0, len(each), size))
