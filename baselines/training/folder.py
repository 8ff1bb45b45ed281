"""The folder of a run: its files, each replaced in one go, and the conditions to resume it."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from typing import Any

from baselines.files import write
from baselines.training.config.base import differences
from baselines.training.errors import TrainingError

#: The version of `run.json`.
FORMAT = 3


class Folder:
    """The files of one run.

    Args:
        path: The folder; it need not be there yet.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.run = path / "run.json"
        self.history = path / "history.json"
        self.checkpoint = path / "checkpoint.pt"
        self.agent = path / "agent.safetensors"
        self.tensorboard = path / "tensorboard"

    def prepare(self, identity: Mapping[str, Any], *, resume: bool, overwrite: bool) -> dict[str, Any] | None:
        """Prepares the folder for a run.

        Args:
            identity: Parts of `run.json` that must be equal in a run that is resumed.
            resume: Whether to continue the run that is there.
            overwrite: Whether to replace it.

        Returns:
            The `run.json` of the run to resume; None where there is none.

        Raises:
            TrainingError: There is a run, and neither flag is given; it cannot be read, or was another one; the
                folder cannot be written to.
        """
        if resume and overwrite:
            raise TrainingError("--resume keeps the run that is there, --overwrite replaces it: choose one.")
        there = self.read() if self.run.exists() and not overwrite else None
        if there is not None and not resume:
            raise TrainingError(
                f"{self.run} is there already: resume it by --resume, replace it by --overwrite, or choose "
                "another directory."
            )
        if there is not None:
            self._check_same(there, identity)
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            if there is None:
                self._clear()
            for draft in self.path.glob(".*.tmp"):  # of a run that was killed while writing
                draft.unlink(missing_ok=True)
        except OSError as e:
            raise TrainingError(f"Cannot write into {self.path}: {e.strerror or e}.") from None
        return there

    def read(self) -> dict[str, Any]:
        """The content of `run.json`."""
        return read_run(self.run)

    def write_json(self, file: pathlib.Path, content: object) -> None:
        """Writes one of the files.

        Raises:
            ResultsError: It cannot be written.
        """
        write(file, (json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n").encode())

    def _check_same(self, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
        for part, wanted in here.items():
            found = there.get(part)
            if found == wanted:
                continue
            what = [f"({found!r} there, {wanted!r} here)"]
            if isinstance(found, Mapping) and isinstance(wanted, Mapping):
                what = differences(found, wanted)
            raise TrainingError(
                f"{self.run} is of a run with another {part}: {', '.join(what)}. Go on with the same, or choose "
                "another directory."
            )

    def _clear(self) -> None:
        """Removes the files of a run, and nothing else."""
        # run.json first: without it, what is left after a kill is no run.
        for file in (self.run, self.checkpoint, self.history, self.agent):
            file.unlink(missing_ok=True)
        for file in self.tensorboard.glob("events.out.tfevents.*"):
            file.unlink(missing_ok=True)


def read_run(file: pathlib.Path) -> dict[str, Any]:
    """The content of a `run.json`.

    Raises:
        TrainingError: It cannot be read, or has another format.
    """
    try:
        content: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        if content["format"] != FORMAT:
            raise ValueError(f"expected format {FORMAT}, got {content['format']!r}")
        if not {"method", "seed", "config"} <= content.keys():
            raise ValueError("expected a method, a seed and a config")
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as e:
        raise TrainingError(f"Cannot read {file}: {e}. Expected the run.json of a training.") from None
    return content
