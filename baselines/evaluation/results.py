"""The folder of an evaluation, complete on disk at any time, so that a run can be continued."""

from __future__ import annotations

import hashlib
import io
import pathlib
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

import ikgym
from baselines.episodes import Episode
from baselines.evaluation.export import FORMATS, Format
from baselines.evaluation.jobs import Job, Options
from baselines.evaluation.log import trajectory_log
from baselines.evaluation.metrics import Row, Skipped
from baselines.files import (
    ResultsError,
    canonical,
    check_flags,
    check_same,
    check_writable,
    csv_text,
    from_json,
    read_arrays,
    read_json,
    reading,
    write,
    write_json,
)
from ikgym.exceptions import InvalidInputError
from ikgym.scenarios import SPLITS
from ikgym.scenarios.preview import furthest

#: The report of a folder.
PAGE = "report.html"
#: Files of a folder that are replaced by --overwrite; other files are left alone.
WRITTEN = (
    *("results.json", "results.csv", "README.md", PAGE, "series/*/*.npz"),
    *("table.csv", "table.md", "cost-time-*.png", "map.csv", "map.md", "map.png"),
    *(f"export/*/*{kind.suffix}" for kind in FORMATS.values()),
)

#: Most bytes of a name in a file name, which file systems limit to 255 in all.
LONGEST = 100


class Results:
    """The folder of an evaluation.

    `results.json` holds all rows and is written anew after each batch of episodes; the trajectory logs of the first
    episodes are in `series/SCENARIO/POLICY-….npz`, joint motions in `export/SCENARIO/POLICY-…-seed-N.csv` and so on.
    Every file is replaced in one go, so that none is ever half written.

    Args:
        jobs: The jobs. Their rows are kept in this order, after other rows of the folder.
        options: Options of the evaluation. The folder, `out`, is created if it does not exist.

    Raises:
        ResultsError: The folder cannot be written; it has results and neither `resume` nor `overwrite` is given; its
            results are damaged or cannot be compared with new ones.
    """

    def __init__(self, jobs: Sequence[Job], options: Options) -> None:
        #: Motions that could not be exported, with the reason.
        self.not_exported: list[Skipped] = []
        self.directory = directory = pathlib.Path(options.out or "")
        self._file = directory / "results.json"
        self._order = dict.fromkeys(job.key for job in jobs)
        self._export, self._accelerations = [FORMATS[name] for name in options.export], options.accelerations
        if options.resume and (unclear := [job.policy for job in jobs if not job.specification.identifiable]):
            raise ResultsError(
                f"--resume: results of the object {unclear[0]} cannot be distinguished from those of another one. Give "
                "an import path such as 'package.module:make_policy', or choose --overwrite."
            )
        resumed = check_flags(self._file, resume=options.resume, overwrite=options.overwrite)
        check_writable(directory)
        for folder in (directory / "series", directory / "export"):
            for one in (folder, *folder.glob("*")):
                if one.is_symlink():  # files behind it belong to somebody else
                    raise ResultsError(f"{one} is a link to another folder: remove the link.")
        self._rows = {row.key: row for row in read_rows(self._file)} if resumed else {}
        _check_comparable(self._file, list(self._rows.values()), jobs)
        if options.overwrite:
            self._clear()

    @property
    def rows(self) -> list[Row]:
        """All rows: first other rows of the folder, then those of the jobs in their order."""
        others = [row for key, row in self._rows.items() if key not in self._order]
        return others + [self._rows[key] for key in self._order if key in self._rows]

    def is_done(self, job: Job) -> bool:
        """Whether an episode is finished: played, timed if it is to be, and its log and motion written."""
        row = self._rows.get(job.key)
        if row is None or (job.timed and row.time_first_us is None):
            return False
        files = [self.series_file(row)] * job.first + [self.export_file(row, kind) for kind in self._export]
        return all(file.exists() for file in files)

    def add(self, batch: Sequence[Job], played: Sequence[tuple[Row, Episode | None]]) -> None:
        """Keeps the rows of jobs that were played, and the records of their episodes where files need them."""
        for job, (row, episode) in zip(batch, played, strict=True):
            self._rows[row.key] = row
            if episode is None:
                continue
            if job.first:
                file = io.BytesIO()
                np.savez_compressed(file, allow_pickle=False, **trajectory_log(episode))
                write(self.series_file(row), file.getvalue())
            for kind in self._export:
                try:
                    motion = kind.content(episode, self._accelerations)
                except InvalidInputError as error:
                    reason = f"no {kind.suffix} of seed {row.seed}: {error}"
                    self.not_exported.append(Skipped(row.scenario, row.policy, reason))
                else:
                    write(self.export_file(row, kind), motion)
        write_json(self._file, [row.to_json() for row in self.rows])

    def save(self) -> None:
        """Writes results.json, and results.csv: None as an empty cell, objects and lists as JSON."""
        rows = [row.to_json() for row in self.rows]
        lines = [[canonical(v) if isinstance(v, (dict, list)) else v for v in row.values()] for row in rows]
        write_json(self._file, rows)
        write(self.directory / "results.csv", csv_text(rows[0], lines).encode())

    def write(self, name: str, content: bytes) -> None:
        """Writes a file of the folder."""
        write(self.directory / name, content)

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
        return read_arrays(self.series_file(row), "Delete it and run again with --resume.")

    def _clear(self) -> None:
        """Removes the files of an earlier evaluation."""
        try:
            for file in [file for pattern in WRITTEN for file in self.directory.glob(pattern)]:
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
            raise ValueError("a row occurs twice")
    return rows


def slug(name: str) -> str:
    """A name as part of a file name; where that changes or shortens the name, a digest keeps different names apart."""
    safe = re.sub(r"[^\w.=+-]+", "_", name).strip(".").encode()[:LONGEST].decode(errors="ignore") or "_"
    return name if safe == name else f"{safe}-{hashlib.sha256(name.encode(errors='replace')).hexdigest()[:8]}"


def _check_comparable(file: pathlib.Path, rows: Sequence[Row], jobs: Sequence[Job]) -> None:
    """Refuses to mix rows that cannot be compared."""
    by_scenario = {job.scenario.name: job for job in jobs} if rows else {}
    previews = {(job.scenario.name, job.policy, canonical(job.parameters)): furthest(job.preview) for job in jobs}
    for row in rows:
        there: dict[str, Any] = {"version of ikgym": row.machine.get("ikgym")}
        here: dict[str, Any] = {"version of ikgym": ikgym.__version__}
        if (job := by_scenario.get(row.scenario)) is not None:
            there |= {"steps": row.steps, "fingerprint": row.fingerprint, "test set": row.test_set}
            here |= {"steps": job.scenario.steps, "fingerprint": job.fingerprint, "test set": job.test_set}
            there["preview"] = row.preview
            here["preview"] = previews.get((row.scenario, row.policy, canonical(row.parameters)), row.preview)
            if job.seeds.seed:
                there["split"], here["split"] = (
                    next((name for name, seeds in SPLITS.items() if seed in seeds), None)
                    for seed in (row.seed, job.seeds.seed)
                )
        check_same(file, there, here, f" of {row.policy} in {row.scenario}")
