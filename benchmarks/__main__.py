"""Measures speed, prints the tables and writes them: ``python -m benchmarks --out DIR``."""

from __future__ import annotations

import dataclasses
import datetime
import pathlib
import sys

import tyro

from baselines.files import write
from benchmarks import environments, horizons, loop, policies, poses, resets
from benchmarks.measuring import FULL, QUICK
from benchmarks.table import Table, page

SECTIONS = {
    "environments": environments.tables,
    "resets": resets.tables,
    "kinematics": poses.tables,
    "policies": policies.tables,
    "loop": loop.tables,
    "horizons": horizons.tables,
}


@dataclasses.dataclass(frozen=True)
class Command:
    """Measures the speed of environments, kinematics and solvers, and of those of other libraries."""

    out: pathlib.Path = pathlib.Path("results/bench")
    """The folder of the report, README.md."""
    quick: bool = False
    """Measure everything once and small, to see that it runs."""
    sections: tuple[str, ...] = tuple(SECTIONS)
    """The sections to measure."""


def main(command: Command) -> list[Table]:
    """Measures the sections in turn, prints each table when it is done, and writes the report.

    Raises:
        SystemExit: There is no such section.
    """
    if unknown := set(command.sections) - set(SECTIONS):
        raise SystemExit(f"sections: expected some of {', '.join(SECTIONS)}, got {', '.join(sorted(unknown))}.")
    done: list[Table] = []
    for section in command.sections:
        for table in SECTIONS[section](QUICK if command.quick else FULL):
            print(f"\n{table.markdown()}", flush=True)
            done.append(table)
    run = {
        "command": " ".join(["python -m benchmarks", *sys.argv[1:]]),
        "finished": f"{datetime.datetime.now(datetime.UTC):%Y-%m-%d %H:%M} UTC",
        "quick": command.quick,
    }
    command.out.mkdir(parents=True, exist_ok=True)
    write(command.out / "README.md", page(done, run).encode())
    return done


if __name__ == "__main__":
    main(tyro.cli(Command))
