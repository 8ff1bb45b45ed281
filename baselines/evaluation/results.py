"""The folder of an evaluation: complete on disk at any moment, so that a run can be taken up again."""

from __future__ import annotations

import csv
import dataclasses
import hashlib
import io
import json
import pathlib
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import ikgym
from baselines.canonical import canonical
from baselines.evaluation.export import FORMATS, Format
from baselines.evaluation.metrics import Row
from baselines.evaluation.plan import EvaluationPlan, Job, Skipped
from baselines.evaluation.units import Played
from baselines.files import ResultsError, archives, json_files, read_bytes, write
from ikgym.exceptions import InvalidInputError
from ikgym.preview import furthest
from ikgym.scenarios import SPLITS

#: The columns of results.csv, which are the keys of a row in results.json.
COLUMNS = tuple(field.name for field in dataclasses.fields(Row))


class Rows(list[Row]):
    """The rows of an evaluation, and what was left out of it.

    Attributes:
        skipped: Policies that do not suit a scenario, and why not.
    """

    def __init__(self, rows: Iterable[Row] = (), skipped: Sequence[Skipped] = ()) -> None:
        super().__init__(rows)
        self.skipped = tuple(skipped)


class Results:
    """The folder of an evaluation.

    `results.json` holds all rows and is written anew after each batch of episodes; the trajectory logs of the first
    episodes lie in `series/SCENARIO/POLICY-….npz`, joint motions in `export/SCENARIO/POLICY-…-seed-N.csv` and `.json`.
    Every file is replaced in one go, so that none is ever half written.

    Args:
        directory: The folder; made if it is not there.
        plan: What is to be done. Its rows stand in its order, after those that the folder had besides.
        machine: What it is done on, see :func:`baselines.evaluation.machine.describe`.
        resume: Goes on with what is there.
        overwrite: Overwrites what is there.
        export: What joint motions are written as, names of :data:`baselines.evaluation.export.FORMATS`.

    Raises:
        ResultsError: The folder cannot be written; has results, and neither flag is given; is to be gone on with
            but is damaged or was made by something else.
    """

    def __init__(
        self,
        directory: pathlib.Path,
        plan: EvaluationPlan,
        machine: Mapping[str, Any],
        *,
        resume: bool = False,
        overwrite: bool = False,
        export: Sequence[str] = (),
    ) -> None:
        self._export = [FORMATS[name] for name in export]
        if resume and overwrite:
            raise ResultsError("--resume keeps the results that are there, --overwrite replaces them: choose one.")
        self.directory = directory
        self._file = directory / "results.json"
        if resume and (untold := [job.policy for job in plan.jobs if not job.entrant.told_apart]):
            raise ResultsError(
                f"--resume: results of the object {untold[0]} cannot be told from those of another one. Give a place "
                "such as 'package.module:make_policy', or choose --overwrite."
            )
        self._order = [job.key for job in plan.jobs]
        try:
            there = self._file.exists()
        except OSError as e:
            raise ResultsError(f"Cannot read {self._file}: {e.strerror}.") from None
        if there and not (resume or overwrite):
            raise ResultsError(
                f"{self._file} is there already: go on with it by --resume, replace it by --overwrite, "
                "or choose another directory."
            )
        _check_writable(directory)
        self._rows = {row.key: row for row in read_rows(self._file)} if there and resume else {}
        _check_settings(self._file, list(self._rows.values()), plan, machine)
        if there and overwrite:
            self._clear()

    @property
    def rows(self) -> list[Row]:
        """All rows: those that were there besides, then those of the plan, in its order."""
        planned = set(self._order)
        besides = [row for key, row in self._rows.items() if key not in planned]
        return besides + [self._rows[key] for key in self._order if key in self._rows]

    def done(self, job: Job) -> bool:
        """Whether an episode has been played, timed if it is to be, and its trajectory log and motion kept."""
        row = self._rows.get(job.key)
        untimed = job.timed and (row is None or row.time_first_us is None)
        wanted = [self.series_file(job)] if job.first else []
        wanted += [self.export_file(job, kind) for kind in self._export]
        return row is not None and not untimed and all(file.exists() for file in wanted)

    def add(self, played: Iterable[Played]) -> None:
        """Keeps results.

        Args:
            played: What was done, and what came out.

        Raises:
            ResultsError: The folder cannot be written.
        """
        for job, row, log, motion in played:
            if log is not None:
                file = io.BytesIO()
                np.savez_compressed(file, allow_pickle=False, **log)
                write(self.series_file(job), file.getvalue())
            if motion is not None:
                for kind in self._export:
                    write(self.export_file(job, kind), kind.content(motion))
            self._rows[row.key] = row
        self.save()

    def save(self) -> None:
        """Writes results.json.

        Raises:
            ResultsError: The folder cannot be written.
        """
        rows = [row.to_json() for row in self.rows]
        write(self._file, (json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode())

    def save_csv(self) -> None:
        """Writes results.csv: the rows as a table, None as nothing, and objects as JSON.

        Raises:
            ResultsError: The folder cannot be written.
        """
        text = io.StringIO(newline="")
        table = csv.writer(text, lineterminator="\n")
        table.writerow(COLUMNS)
        for row in self.rows:
            cells = row.to_json().values()
            table.writerow([canonical(cell) if isinstance(cell, dict) else cell for cell in cells])
        write(self.directory / "results.csv", text.getvalue().encode())

    def series_file(self, of: Job | Row) -> pathlib.Path:
        """Where the trajectory log of the first episode of a policy in a scenario is kept."""
        return self._file_of(of, "series", ".npz")

    def export_file(self, of: Job | Row, kind: Format) -> pathlib.Path:
        """Where the joint motion of an episode is written."""
        noise = f"-noise-{of.noise_seed}" if of.noise_seed else ""
        return self._file_of(of, "export", f"-seed-{of.seed}{noise}{kind.suffix}")

    def _file_of(self, of: Job | Row, folder: str, ending: str) -> pathlib.Path:
        scenario = of.scenario if isinstance(of, Row) else of.scenario.name
        digest = hashlib.sha256(canonical(of.parameters).encode()).hexdigest()[:8]
        return self.directory / folder / slug(scenario) / f"{slug(of.policy)}-{digest}{ending}"

    def series(self, row: Row) -> dict[str, npt.NDArray[Any]]:
        """The trajectory log of the first episode of a row's policy in its scenario.

        Raises:
            ResultsError: The file is missing or damaged.
        """
        file = self.series_file(row)
        try:
            return archives.arrays(read_bytes(file, archives.MOST))
        except (OSError, ValueError) as e:
            raise ResultsError(f"Cannot read {file}: {e}. Delete it and run again with --resume.") from None

    def _clear(self) -> None:
        """Removes what an evaluation writes, and nothing else that may lie in the folder."""
        stale = [self.directory / name for name in (self._file.name, "results.csv", "README.md", "report.html")]
        stale += self.directory.glob("series/*/*.npz")
        stale += self.directory.glob("plots/*/*.png")
        stale += [file for kind in FORMATS.values() for file in self.directory.glob(f"export/*/*{kind.suffix}")]
        try:
            for file in stale:
                file.unlink(missing_ok=True)
        except OSError as e:
            raise ResultsError(f"Cannot delete {e.filename}: {e.strerror}.") from None


def _check_writable(directory: pathlib.Path) -> None:
    """Better now than after hours of work."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError as e:
        raise ResultsError(f"Cannot write into {directory}: {e.strerror or e}.") from None


def read_rows(file: pathlib.Path) -> list[Row]:
    """The rows of a results.json.

    Raises:
        ResultsError: It cannot be read, was written by a version with other columns, or is damaged; nothing is deleted.
    """
    advice = "Nothing was changed; mend or remove the file, or choose another directory."
    try:
        content = json_files.read(file)
    except OSError as e:
        raise ResultsError(f"Cannot read {file}: {e.strerror}.") from None
    except ValueError as e:
        raise ResultsError(f"{file} is damaged: {e}. {advice}") from None
    if not isinstance(content, list):
        raise ResultsError(f"{file} is damaged: expected a list of rows, got {type(content).__name__}. {advice}")
    rows: dict[Any, Row] = {}
    for number, values in enumerate(content):
        try:
            row = Row.from_json(values)
        except InvalidInputError as e:
            if (version := _other_version(values)) is not None:
                raise ResultsError(
                    f"{file} was written by ikgym {version}, this is {ikgym.__version__}: in row {number} {e}. Read it "
                    "with that version, or evaluate again with --overwrite."
                ) from None
            raise ResultsError(f"{file} is damaged: in row {number} {e}. {advice}") from None
        if row.key in rows:
            raise ResultsError(f"{file} is damaged: row {number} is there twice. {advice}")
        rows[row.key] = row
    return list(rows.values())


def _other_version(values: object) -> str | None:
    """The version that wrote a row, if it says so and is not this one."""
    machine = values.get("machine") if isinstance(values, Mapping) else None
    version = machine.get("ikgym") if isinstance(machine, Mapping) else None
    return version if isinstance(version, str) and version != ikgym.__version__ else None


def slug(name: str) -> str:
    """A name as part of a file name."""
    return re.sub(r"[^\w.=+-]+", "_", name).strip(".") or "_"


def _check_settings(file: pathlib.Path, rows: list[Row], plan: EvaluationPlan, machine: Mapping[str, Any]) -> None:
    """Refuses to mix rows that nobody may compare."""

    def refuse(what: str, there: object, here: object) -> None:
        raise ResultsError(
            f"{file} has results of {what} {there}, this run has {here}: they cannot be compared. Choose another "
            "directory."
        )

    jobs = {job.scenario.name: job for job in plan.jobs}
    previews = {(job.scenario.name, job.policy, canonical(job.parameters)): furthest(job.preview) for job in plan.jobs}
    for row in rows:
        if row.machine.get("ikgym") != machine["ikgym"]:
            refuse("ikgym", row.machine.get("ikgym"), machine["ikgym"])
        if row.scenario not in jobs:
            continue
        job = jobs[row.scenario]
        if row.steps != job.scenario.steps:
            refuse(f"{row.scenario} with", f"{row.steps} steps", f"{job.scenario.steps}")
        if row.fingerprint != job.fingerprint:
            refuse(f"another scenario {row.scenario}: fingerprint", row.fingerprint, job.fingerprint)
        if row.test_set != job.test_set:
            refuse(f"{row.scenario} in the test set", row.test_set or "none", job.test_set or "none")
        preview = previews.get((row.scenario, row.policy, canonical(row.parameters)), row.preview)
        if row.preview != preview:
            refuse(f"{row.policy} in {row.scenario} with preview", row.preview, preview)
        if job.seed and _split(row.seed) != _split(job.seed):
            refuse(f"{row.scenario} on the split", _split(row.seed), _split(job.seed))


def _split(seed: int) -> str:
    return next((name for name, seeds in SPLITS.items() if seed in seeds), "none")
