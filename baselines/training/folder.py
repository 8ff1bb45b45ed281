"""The folder of a run: its files, each replaced in one go, and the conditions to resume it."""

from __future__ import annotations

import pathlib
from collections.abc import Mapping
from typing import Any

from baselines.files import ResultsError, read_json, resumed

#: The version of `run.json`.
FORMAT = 3


class Folder:
    """The files of one run.

    Args:
        path: The folder; it need not exist yet.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.run = path / "run.json"
        self.history = path / "history.json"
        self.checkpoint = path / "checkpoint.pt"
        self.agent = path / "agent.safetensors"
        self.tensorboard = path / "tensorboard"

    def prepare(self, identity: Mapping[str, Any], *, resume: bool, overwrite: bool) -> dict[str, Any] | None:
        """Prepares the folder for a run; the caller has locked it.

        Args:
            identity: Parts of `run.json` that must be equal in a run that is resumed.
            resume: Whether to continue the run that is there.
            overwrite: Whether to replace it.

        Returns:
            The `run.json` of the run to resume; None where there is none.

        Raises:
            ResultsError: There is a run and neither flag is given, it is another one, or it cannot be read.
        """
        there = resumed(self.run, {"format": FORMAT, **identity}, resume=resume, overwrite=overwrite)
        if there is None:
            # run.json first: without it, what is left after a kill is no run.
            for file in (self.run, self.checkpoint, self.history, self.agent):
                file.unlink(missing_ok=True)
            for file in self.tensorboard.glob("events.out.tfevents.*"):
                file.unlink(missing_ok=True)
        for draft in self.path.glob(".*.tmp"):  # of a run that was killed while writing
            draft.unlink(missing_ok=True)
        return there


def read_run(file: pathlib.Path) -> dict[str, Any]:
    """The content of a `run.json`.

    Raises:
        ResultsError: It cannot be read, or has another format.
    """
    content = read_json(file)
    keys = {"format", "method", "seed", "config"}
    if not isinstance(content, dict) or not keys <= content.keys() or content["format"] != FORMAT:
        raise ResultsError(f"{file}: expected the run.json of a training in format {FORMAT}.")
    return content
