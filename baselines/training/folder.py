"""The folder of a run: its files, each replaced in one go, and the state from which the run continues.

| file | content |
|---|---|
| `run.json` | configuration, seed, versions, machine, computing time, validations, hash of the final weights |
| `history.json` | a row for each segment: its metrics, and the score if there was a validation |
| `checkpoint.pt` | the state to resume from, with its SHA-256 |
| `tensorboard/` | the history, for TensorBoard |
| `agent.safetensors` | at the end: the agent, a policy of :mod:`baselines` |
"""

from __future__ import annotations

import dataclasses
import hashlib
import io
import pathlib
from collections.abc import Mapping
from typing import Any

from baselines.files import ResultsError, read_bytes, read_json, reading, resumed, write

#: The version of `run.json` and of `checkpoint.pt`.
FORMAT = 3
#: The first bytes of a checkpoint; the digest of its payload, a line break and the payload follow.
MAGIC = b"ikgym checkpoint "


class Folder:
    """The files of one run; the folder need not exist yet."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self.run = path / "run.json"
        self.history = path / "history.json"
        self.checkpoint = path / "checkpoint.pt"
        self.agent = path / "agent.safetensors"
        self.tensorboard = path / "tensorboard"

    def prepare(self, identity: Mapping[str, Any], *, resume: bool, overwrite: bool) -> dict[str, Any] | None:
        """Prepares the folder, which the caller has locked; gives the `run.json` of the run to resume, if there is one.

        Raises:
            ResultsError: There is a run and neither flag is given, its identity is another, or it cannot be read.
        """
        there = resumed(self.run, {"format": FORMAT, **identity}, resume=resume, overwrite=overwrite)
        if there is None:
            self.clear()
        for draft in self.path.glob(".*.tmp"):  # of a run that was killed while writing
            draft.unlink(missing_ok=True)
        return there

    def clear(self) -> None:
        """Removes the files of a run, but no others."""
        # run.json first: without it, a folder after a kill is no run.
        events = self.tensorboard.glob("events.out.tfevents.*")
        for file in (self.run, self.checkpoint, self.history, self.agent, *events):
            file.unlink(missing_ok=True)


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


@dataclasses.dataclass
class Checkpoint:
    """The state of a run after a segment.

    Args:
        segments: Segments done.
        trainer: The `state` of the trainer; None before the first segment.
        history: A row for each segment.
        best: The best validation so far: its score, segment and the weights of the policy; None without one.
        core_seconds: CPU time of this process and of those before it, in [s].
        wall_seconds: Elapsed time, in [s].
    """

    segments: int = 0
    trainer: dict[str, Any] | None = None
    history: list[dict[str, Any]] = dataclasses.field(default_factory=list)
    best: dict[str, Any] | None = None
    core_seconds: float = 0.0
    wall_seconds: float = 0.0

    def save(self, file: pathlib.Path) -> None:
        """Writes the file in one go.

        Raises:
            ResultsError: It cannot be written.
        """
        import torch  # the command line reads run.json without it

        stream = io.BytesIO()
        torch.save({"format": FORMAT, **vars(self)}, stream)
        write(file, sealed(stream.getvalue()))

    @classmethod
    def load(cls, file: pathlib.Path) -> Checkpoint:
        """The checkpoint in a file.

        Raises:
            ResultsError: It cannot be read, is damaged, or has another format.
        """
        import torch

        with reading(file, "Begin anew with --overwrite."):
            content = torch.load(io.BytesIO(_payload(read_bytes(file))), map_location="cpu", weights_only=True)
            if content.pop("format") != FORMAT:
                raise ValueError("it has another format")
            return cls(**content)


def sealed(payload: bytes) -> bytes:
    """The content of a checkpoint: magic bytes and digest, then the payload."""
    return b"".join([MAGIC, hashlib.sha256(payload).hexdigest().encode(), b"\n", payload])


def _payload(content: bytes) -> bytes:
    """The payload of a checkpoint with the right digest."""
    head, _, payload = content.partition(b"\n")
    if not head.startswith(MAGIC):
        raise ValueError("it is no checkpoint")
    claimed, digest = head.removeprefix(MAGIC).decode(errors="replace"), hashlib.sha256(payload).hexdigest()
    if digest != claimed:
        raise ValueError(f"it is damaged: expected the SHA-256 {claimed}, got {digest}")
    return payload
