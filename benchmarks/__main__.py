"""Measures everything, prints the tables and writes them: ``python -m benchmarks --out DIR``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
import subprocess
import sys

import tyro

from benchmarks import environments, horizons, kernels, policies, poses, report
from benchmarks.effort import FULL, QUICK, Effort
from benchmarks.table import Column, Table

SECTIONS = {
    "start": lambda effort: [_import_table(effort)],
    "environments": environments.tables,
    "kinematics": kernels.tables,
    "poses": poses.tables,
    "policies": policies.tables,
    "horizons": horizons.tables,
}


@dataclasses.dataclass(frozen=True)
class Command:
    """Measures speed beside other environments, libraries and solvers."""

    out: pathlib.Path = pathlib.Path("results/bench")
    """The folder for README.md, the report."""
    quick: bool = False
    """Everything once and small, to see that it runs."""
    sections: tuple[str, ...] = tuple(SECTIONS)
    """What to measure."""


def main(command: Command) -> list[Table]:
    """Measures section after section, prints each table when it is done, and writes the report.

    Raises:
        SystemExit: There is no section of a name.
    """
    if unknown := set(command.sections) - set(SECTIONS):
        raise SystemExit(f"sections: expected some of {', '.join(SECTIONS)}, got {', '.join(sorted(unknown))}.")
    done: list[Table] = []
    for section in command.sections:
        for table in SECTIONS[section](QUICK if command.quick else FULL):
            print(f"\n{table.text()}", flush=True)
            done.append(table)
    given = {
        "command": " ".join(["python -m benchmarks", *sys.argv[1:]]),
        "finished": f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC",
        "quick": command.quick,
    }
    report.save(command.out, done, given | report.conditions())
    return done


def _import_table(effort: Effort) -> Table:
    code = "import time; t = time.perf_counter(); import ikgym; print(time.perf_counter() - t)"
    seconds = min(
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)
        for _ in range(3 if effort is FULL else 1)
    )
    return Table(
        "import",
        "Start",
        "The import of ikgym, warm, best of three.",
        (Column("s", "time", "s"),),
        {"import ikgym": (seconds,)},
    )


if __name__ == "__main__":
    main(tyro.cli(Command))
