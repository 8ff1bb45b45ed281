"""The folder of an evaluation, complete on disk at any time, so that a run can be continued."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import pathlib
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from baselines.canonical import canonical
from baselines.evaluation.export import FORMATS, USUAL, Format, trajectory_log
from baselines.evaluation.jobs import Job, Options, Skipped
from baselines.evaluation.metrics import Row
from baselines.evaluation.motion.free_timing import as_long
from baselines.files import (
    ResultsError,
    check_flags,
    check_writable,
    csv_text,
    from_json,
    read_arrays,
    read_json,
    reading,
    write,
    write_json,
)
from baselines.recording import Episode
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import SPLITS
from ikgym.scenarios.preview import furthest

if TYPE_CHECKING:
    import pandas as pd

#: The columns of results.csv, which are the keys of a row in results.json.
COLUMNS = tuple(field.name for field in dataclasses.fields(Row))
#: The report of a folder.
PAGE = "report.html"
#: Files of a folder that are replaced by --overwrite; other files are left alone.
WRITTEN = (
    *("results.json", "results.csv", "README.md", PAGE, "series/*/*.npz"),
    *("table.csv", "table.md", "cost-time-*.png", "foresight.png", "map.csv", "map.md", "map.png"),
)

#: Most bytes of a name in a file name, which file systems limit to 255 in all.
LONGEST = 100


class Rows(list[Row]):
    """The rows of an evaluation.

    Attributes:
        skipped: Policies that do not suit a scenario and motions that no controller would accept, with the reasons.
    """

    def __init__(self, rows: Iterable[Row] = (), skipped: Sequence[Skipped] = ()) -> None:
        super().__init__(rows)
        self.skipped = tuple(skipped)

    def frame(self) -> pd.DataFrame:
        """The rows as a data frame of pandas: one line an episode, NaN for None."""
        from baselines.evaluation.summary import frame  # slow to import

        return frame(self)


class Results:
    """The folder of an evaluation.

    `results.json` holds all rows and is written anew after each batch of episodes; the trajectory logs of the first
    episodes are in `series/SCENARIO/POLICY-….npz`, joint motions in `export/SCENARIO/POLICY-…-seed-N.csv` and so on.
    Every file is replaced in one go, so that none is ever half written.

    Args:
        directory: The folder; created if it does not exist.
        jobs: The jobs. Their rows are kept in this order, after other rows of the folder.
        machine: Processor and versions, see :func:`baselines.evaluation.metrics.describe`.
        options: Options of the evaluation: resume, overwrite and export.

    Raises:
        ResultsError: The folder cannot be written; it has results and neither `resume` nor `overwrite` is given; its
            results are damaged or cannot be compared with new ones.
    """

    def __init__(
        self, directory: pathlib.Path, jobs: Sequence[Job], machine: Mapping[str, Any], options: Options
    ) -> None:
        self._export = [FORMATS[name] for name in options.export]
        self._accelerations = options.accelerations
        #: Motions that could not be exported, with the reason.
        self.not_exported: list[Skipped] = []
        self._order = [job.key for job in jobs]
        self.directory = directory
        self._file = directory / "results.json"
        if options.resume and (unclear := [job.policy for job in jobs if not job.specification.identifiable]):
            raise ResultsError(
                f"--resume: results of the object {unclear[0]} cannot be distinguished from those of another one. Give "
                "an import path such as 'package.module:make_policy', or choose --overwrite."
            )
        check_flags(self._file, resume=options.resume, overwrite=options.overwrite)
        check_writable(directory)
        for folder in (directory / "series", directory / "export"):
            for one in (folder, *folder.glob("*")):
                if one.is_symlink():  # files behind it belong to somebody else
                    raise ResultsError(f"{one} is a link to another folder: remove the link.")
        self._rows = {row.key: row for row in read_rows(self._file)} if options.resume and self._file.exists() else {}
        _check_comparable(self._file, list(self._rows.values()), jobs, machine)
        for file, row in {self.series_file(row): row for row in self._rows.values()}.items():
            if file.exists():
                self.series(row)  # a damaged log is refused before anything is played
        if options.overwrite:
            self._clear()

    @property
    def rows(self) -> list[Row]:
        """All rows: first other rows of the folder, then those of the jobs in their order."""
        planned = set(self._order)
        others = [row for key, row in self._rows.items() if key not in planned]
        return others + [self._rows[key] for key in self._order if key in self._rows]

    def done(self, job: Job) -> bool:
        """Whether an episode is finished: played, timed if it is to be, and its log and motion written."""
        row = self._rows.get(job.key)
        if row is None or (job.timed and row.time_first_us is None):
            return False
        files = [self.series_file(row)] * job.first + [self.export_file(row, kind) for kind in self._export]
        return all(file.exists() for file in files)

    def add(self, jobs: Sequence[Job], results: Iterable[tuple[Row, Episode | None]]) -> None:
        """Keeps the rows of jobs that were played, and the records of their episodes where files need them."""
        for job, (row, episode) in zip(jobs, results, strict=True):
            self._rows[row.key] = row
            if episode is None:
                continue
            if job.first:
                file = io.BytesIO()
                np.savez_compressed(file, allow_pickle=False, **trajectory_log(job.scenario, job.seeds, episode))
                write(self.series_file(row), file.getvalue())
            for kind in self._export:
                self._write_motion(job, row, kind, episode)
        self.save()

    def _write_motion(self, job: Job, row: Row, kind: Format, episode: Episode) -> None:
        try:
            content = kind.content(as_long(job.scenario, episode), job.seeds, episode, self._accelerations)
        except InvalidInputError as error:
            reason = f"no {kind.suffix} of seed {row.seed}: {error}"
            self.not_exported.append(Skipped(row.scenario, row.policy, reason))
            return
        write(self.export_file(row, kind), content)

    def save(self) -> None:
        """Writes results.json."""
        write_json(self._file, [row.to_json() for row in self.rows])

    def save_csv(self) -> None:
        """Writes results.csv: the rows as a table, None as an empty cell, objects and lists as JSON."""
        lines = [
            [canonical(v) if isinstance(v, (dict, list)) else v for v in row.to_json().values()] for row in self.rows
        ]
        write(self.directory / "results.csv", csv_text(COLUMNS, lines).encode())

    def series_file(self, row: Row) -> pathlib.Path:
        """The file with the trajectory log of the first episode of a row's policy in its scenario."""
        return self._path(row, "series", ".npz")

    def export_file(self, row: Row, kind: Format) -> pathlib.Path:
        """The file with the joint motion of an episode."""
        noise = f"-noise-{row.noise_seed}" if row.noise_seed else ""
        return self._path(row, "export", f"-seed-{row.seed}{noise}{kind.suffix}")

    def _path(self, row: Row, folder: str, ending: str) -> pathlib.Path:
        digest = hashlib.sha256(canonical(row.parameters).encode()).hexdigest()[:8]
        return self.directory / folder / slug(row.scenario) / f"{slug(row.policy)}-{digest}{ending}"

    def series(self, row: Row) -> dict[str, npt.NDArray[Any]]:
        """The trajectory log of the first episode of a row's policy in its scenario."""
        file, advice = self.series_file(row), "Delete it and run again with --resume."
        log = read_arrays(file, advice)
        with reading(file, advice):
            if missing := [name for name in USUAL if name not in log]:
                raise ValueError(f"the array {missing[0]} is missing")
        return log

    def _clear(self) -> None:
        """Removes the files of an earlier evaluation."""
        patterns = [*WRITTEN, *(f"export/*/*{kind.suffix}" for kind in FORMATS.values())]
        try:
            for pattern in patterns:
                for file in self.directory.glob(pattern):
                    file.unlink(missing_ok=True)
        except OSError as e:
            raise ResultsError(f"Cannot delete {e.filename}: {e.strerror}.") from None


def read_rows(file: pathlib.Path) -> list[Row]:
    """The rows of a results.json.

    Raises:
        ResultsError: It cannot be read, was written by a version with other columns, or is damaged; nothing is deleted.
    """
    advice = "Nothing was changed; mend or remove the file, or choose another directory."
    content = read_json(file, advice)
    with reading(file, advice):
        if not isinstance(content, list):
            raise ValueError(f"expected a list of rows, got {type(content).__name__}")
        rows = []
        for number, values in enumerate(content):
            try:
                rows.append(from_json(Row, Row.nan_restored(values)))
            except ValueError as e:
                raise ValueError(f"in row {number} {e}") from None
        if len({row.key for row in rows}) < len(rows):
            raise ValueError("a row is there twice")
    return rows


def slug(name: str) -> str:
    """A name as part of a file name; where that changes or shortens the name, a digest keeps different names apart."""
    safe = re.sub(r"[^\w.=+-]+", "_", name).strip(".").encode()[:LONGEST].decode(errors="ignore") or "_"
    return name if safe == name else f"{safe}-{hashlib.sha256(name.encode(errors='replace')).hexdigest()[:8]}"


def _check_comparable(file: pathlib.Path, rows: Sequence[Row], jobs: Sequence[Job], machine: Mapping[str, Any]) -> None:
    """Refuses to mix rows that cannot be compared."""
    by_scenario = {job.scenario.name: job for job in jobs}
    digests = {name: job.fingerprint for name, job in by_scenario.items()} if rows else {}
    previews = {(job.scenario.name, job.policy, canonical(job.parameters)): furthest(job.preview) for job in jobs}
    for row in rows:
        pairs = [("ikgym", row.machine.get("ikgym"), machine["ikgym"])]
        if (job := by_scenario.get(row.scenario)) is not None:
            preview = previews.get((row.scenario, row.policy, canonical(row.parameters)), row.preview)
            pairs += [
                (f"{row.scenario} with steps", row.steps, job.scenario.steps),
                (f"another scenario {row.scenario} with fingerprint", row.fingerprint, digests[row.scenario]),
                (f"{row.scenario} in the test set", row.test_set or "none", job.test_set or "none"),
                (f"{row.policy} in {row.scenario} with preview", row.preview, preview),
            ]
            if seed := job.seeds.seed:
                pairs.append((f"{row.scenario} on the split", _split(row.seed), _split(seed)))
        for part, there, here in pairs:
            if there != here:
                raise ResultsError(
                    f"{file} has results of {part} {there}, this run has {here}: they cannot be compared. Choose "
                    "another directory."
                )


def _split(seed: int) -> str:
    return next((name for name, seeds in SPLITS.items() if seed in seeds), "none")
