"""The report of a run as a page of Markdown: tables, machine and versions."""

from __future__ import annotations

import importlib.metadata
import pathlib
from collections.abc import Mapping, Sequence
from typing import Any

from baselines.evaluation.metrics import describe
from baselines.files import write
from benchmarks.table import Table

#: Libraries whose versions are stated, besides those of :func:`baselines.evaluation.metrics.describe`.
LIBRARIES = ("gymnasium", "mujoco", "envpool", "pin", "casadi", "crocoddyl", "stable-baselines3", "torch")


def conditions() -> dict[str, Any]:
    """The machine, and the versions of what is measured beside, None where it is missing."""
    return {**describe(), **{name: _version(name) for name in LIBRARIES}}


def save(directory: pathlib.Path, tables: Sequence[Table], given: Mapping[str, Any]) -> None:
    """Writes `README.md`.

    Args:
        directory: The folder; made if it is not there.
        tables: What was measured.
        given: Machine, versions, command and date.
    """
    directory.mkdir(parents=True, exist_ok=True)
    write(directory / "README.md", page(tables, given).encode())


def page(tables: Sequence[Table], given: Mapping[str, Any]) -> str:
    """All tables in Markdown."""
    listed = "\n".join(f"- {key}: {'not installed' if value is None else value}" for key, value in given.items())
    return "\n\n".join(
        [
            "# Speed",
            "Figures of one table come from one run and, but where it says otherwise, are medians of interleaved "
            "rounds, so that ratios hold on a noisy machine; those of different tables do not compare as well.",
            *(table.markdown() for table in tables),
            "## Conditions",
            listed,
        ]
    ) + "\n"  # fmt: skip


def _version(name: str) -> str | None:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return None
