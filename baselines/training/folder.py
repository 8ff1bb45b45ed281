"""The folder of a run: its files, each replaced in one go, and who may resume them."""

from __future__ import annotations

import json
import pathlib
from collections.abc import Mapping
from typing import Any

from baselines.files import json_files, write
from baselines.training.config.base import differences
from baselines.training.errors import TrainingError
from ikgym.validation import whole_number

#: The version of `run.json`. Its configuration had other names before 2.
FORMAT = 2


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
        self.zip = path / "model.zip"
        self.model = path / "model.safetensors"
        self.agent = path / "agent.safetensors"
        self.tensorboard = path / "tensorboard"

    def prepare(self, identity: Mapping[str, Any], *, resume: bool, overwrite: bool) -> dict[str, Any] | None:
        """Makes sure that a run may write here.

        Args:
            identity: What must be the same in the `run.json` of a run that is resumed, part by part.
            resume: Goes on with what is there.
            overwrite: Replaces what is there.

        Returns:
            The `run.json` of the run to go on with, None where there is none.

        Raises:
            TrainingError: There is a run, and neither flag is given; it cannot be read, or was another one; the
                folder cannot be written to.
        """
        if resume and overwrite:
            raise TrainingError("--resume keeps the run that is there, --overwrite replaces it: choose one.")
        there = self.read() if self.run.exists() and not overwrite else None
        if there is not None and not resume:
            raise TrainingError(
                f"{self.run} is there already: go on with it by --resume, replace it by --overwrite, or choose "
                "another directory."
            )
        if there is not None:
            self._check_same(there, identity)
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            if there is None:
                self._clear()
            for draft in self.path.glob(".*.tmp"):  # of one that was killed while it wrote
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
        """Removes what a run writes, and nothing else that may lie in the folder."""
        # First what says that there is a run: whoever is killed on the way leaves no run that is half there.
        for file in (self.run, self.checkpoint, self.history, self.zip, self.model, self.agent):
            file.unlink(missing_ok=True)
        for file in self.tensorboard.glob("events.out.tfevents.*"):
            file.unlink(missing_ok=True)


def read_run(file: pathlib.Path) -> dict[str, Any]:
    """The content of a `run.json`.

    Raises:
        TrainingError: It cannot be read, is none, or is of another version.
        InvalidInputError: Its seed is none.
    """
    try:
        content = json_files.read(file)
    except OSError as e:
        raise TrainingError(f"Cannot read {file}: {e.strerror}.") from None
    except ValueError as e:
        raise TrainingError(f"{file} is damaged: {e}.") from None
    if not isinstance(content, dict) or not {"method", "seed", "config"} <= content.keys():
        raise TrainingError(f"{file} is no run.json of a training.")
    if content.get("format") != FORMAT:
        versions = content.get("versions")
        version = versions.get("ikgym") if isinstance(versions, dict) else None
        raise TrainingError(
            f"{file} was written by ikgym {version or 'of another version'}, whose options have other names: go on "
            f'with it by that version, pip install "ikgym=={version or "0.1.0"}", or train anew.'
        )
    if not isinstance(content["config"], dict) or not isinstance(content["method"], str):
        raise TrainingError(f"{file} is damaged: expected a method, and its config by name.")
    whole_number("seed", content["seed"], at_least=0)
    return content
