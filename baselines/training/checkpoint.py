"""The state of a run in one file, from which it continues as if it had never been interrupted."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import pathlib
from typing import Any

import torch

from baselines.files import reading, write

#: The version of the format.
FORMAT = 3
#: The beginning of a file, before the digest of the rest.
MAGIC = b"ikgym checkpoint "
# Length of the digest with the end of its line.
_DIGEST = 65


@dataclasses.dataclass
class Checkpoint:
    """The state of a run after a segment.

    Args:
        segments: Segments done.
        trainer: The `state` of the trainer; None before the first segment.
        history: A row for each segment, see :mod:`baselines.training.run`.
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
        content = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        stream = io.BytesIO()
        torch.save({"format": FORMAT, **content}, stream)
        write(file, sealed(stream.getvalue()))


def load(file: pathlib.Path) -> Checkpoint:
    """The checkpoint of a file.

    Raises:
        ResultsError: It cannot be read, is damaged, or has another format.
    """
    with reading(file, "Begin anew with --overwrite."):
        content = torch.load(io.BytesIO(_payload(file.read_bytes())), map_location="cpu", weights_only=True)
        if content.pop("format") != FORMAT:
            raise ValueError("it has another format")
        return Checkpoint(**content)


def sealed(payload: bytes) -> bytes:
    """The content of a file: its digest, then the payload."""
    return b"".join([MAGIC, hashlib.sha256(payload).hexdigest().encode(), b"\n", payload])


def _payload(content: bytes) -> bytes:
    """The payload of a file whose digest is right."""
    if not content.startswith(MAGIC):
        raise ValueError("it is no checkpoint")
    begin = len(MAGIC) + _DIGEST
    claimed, payload = content[len(MAGIC) : begin].rstrip(b"\n").decode(errors="replace"), content[begin:]
    if (digest := hashlib.sha256(payload).hexdigest()) != claimed:
        raise ValueError(f"it is damaged: expected the SHA-256 {claimed}, got {digest}")
    return payload
