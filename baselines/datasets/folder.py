"""The folder of a data set: blocks of episodes while it grows, and at its end what Minari reads, put there in one go.

| file | what it holds |
|---|---|
| `dataset.json` | what it is made of, so that nothing else goes on with it |
| `scenario.toml` | the scenario, where a file can hold it |
| `blocks/` | episodes that are done, while others are not |
| `data/` | the data set, once it is complete |
"""

from __future__ import annotations

import contextlib
import io
import json
import pathlib
import shutil
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from baselines.datasets.record import Block
from baselines.files import ResultsError, archives, json_files, read_bytes, write
from baselines.files.locks import NAME as LOCK

#: Bytes of a block that are read back at most: one long episode may have more than what is recorded together.
MOST = 2**34


class Folder:
    """The files of one data set.

    Args:
        path: The folder; it need not be there yet.
    """

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.about, self.scenario = path / "dataset.json", path / "scenario.toml"
        self.blocks, self.data = path / "blocks", path / "data"
        self.draft = path / ".data.tmp"

    @property
    def complete(self) -> bool:
        """Whether the data set is there."""
        return self.data.exists()

    def prepare(self, identity: Mapping[str, Any], *, resume: bool, overwrite: bool) -> None:
        """Makes sure that a data set may be written here.

        Args:
            identity: What it is made of.
            resume: Goes on with what is there.
            overwrite: Replaces what is there.

        Raises:
            ResultsError: There is a data set and neither flag is given, or there is another one, or something else;
                the folder cannot be read or written.
        """
        if resume and overwrite:
            raise ResultsError("--resume keeps the episodes that are there, --overwrite replaces them: choose one.")
        with self._errors():
            self._remove_drafts()
            self._refuse_strangers()
            if self.about.exists() and not overwrite:
                if not resume:
                    raise ResultsError(
                        f"{self.path} has a data set already: go on with it by --resume, replace it by --overwrite, or "
                        "choose another folder."
                    )
                self._check_same(identity)
            else:
                self._clear()
                write(self.about, (json.dumps(identity, indent=1, ensure_ascii=False) + "\n").encode())

    def has(self, number: int) -> bool:
        """Whether a block is done."""
        return self._block(number).exists()

    def add(self, number: int, block: Block) -> None:
        """Writes a block.

        Raises:
            ResultsError: It cannot be written.
        """
        content = io.BytesIO()
        np.savez(content, allow_pickle=False, **block)
        write(self._block(number), content.getvalue())

    def read(self, number: int) -> Block:
        """A block that was added.

        Raises:
            ResultsError: It cannot be read, or is damaged.
        """
        file = self._block(number)
        try:
            return archives.arrays(read_bytes(file, MOST), MOST)
        except (OSError, ValueError) as e:
            raise ResultsError(f"Cannot read {file}: {e}. Delete it, and go on with --resume.") from None

    @contextlib.contextmanager
    def completing(self) -> Iterator[pathlib.Path]:
        """A folder to be filled, which is the data set as soon as it is left; the blocks go then.

        Raises:
            ResultsError: It cannot be written.
        """
        with self._errors():
            yield self.draft
            self.draft.replace(self.data)
            self.tidy()

    def tidy(self) -> None:
        """Removes the blocks of a data set that is complete."""
        shutil.rmtree(self.blocks, ignore_errors=True)

    def _block(self, number: int) -> pathlib.Path:
        return self.blocks / f"{number:06}.npz"

    def _remove_drafts(self) -> None:
        """Removes what a process that was killed while it wrote has left."""
        for file in (self.about, self.scenario):
            for draft in self.path.glob(f".{file.name}.*.tmp"):
                draft.unlink()
        if self.draft.exists():
            shutil.rmtree(self.draft)

    def _refuse_strangers(self) -> None:
        known = {one.name for one in (self.about, self.scenario, self.blocks, self.data)} | {LOCK}
        others = sorted(file.name for file in self.path.iterdir() if file.name not in known)
        if others or (not self.about.exists() and any(file.name != LOCK for file in self.path.iterdir())):
            there = ", ".join(others) or "files without a dataset.json"
            raise ResultsError(f"{self.path}: expected an empty folder, or that of a data set, got {there}.")

    def _check_same(self, identity: Mapping[str, Any]) -> None:
        try:
            there = json_files.read(self.about)
        except ValueError as e:
            raise ResultsError(f"{self.about} is damaged: {e}. Make the data set anew with --overwrite.") from None
        if not isinstance(there, dict):
            raise ResultsError(f"{self.about} is damaged: expected an object, got {type(there).__name__}.")
        names = [name for name in {**there, **identity} if there.get(name) != identity.get(name)]
        if names:
            what = ", ".join(f"{name} ({there.get(name)!r} there, {identity.get(name)!r} here)" for name in names)
            raise ResultsError(f"{self.path} has another data set: {what}. Go on with that, or choose another folder.")

    def _clear(self) -> None:
        """Removes the episodes of a data set; a process that is killed meanwhile leaves one that lacks some."""
        self.scenario.unlink(missing_ok=True)
        if self.data.exists():
            self.data.replace(self.draft)
        for folder in (self.draft, self.blocks):
            if folder.exists():
                shutil.rmtree(folder)

    @contextlib.contextmanager
    def _errors(self) -> Iterator[None]:
        """Messages of the operating system as errors that are expected."""
        try:
            yield
        except OSError as e:
            raise ResultsError(f"Cannot write into {self.path}: {e.strerror or e}.") from None
