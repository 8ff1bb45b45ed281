"""Where a run stands: all that it needs to go on as if nothing had happened, in one file."""

from __future__ import annotations

import dataclasses
import hashlib
import io
import pathlib
import pickle
from typing import Any

import torch

from baselines.files import archives, read_bytes, write
from baselines.training.errors import TrainingError

#: Changes when earlier files can no longer be resumed.
FORMAT = 2
#: What a file begins with, before the digest of all that follows.
MAGIC = b"ikgym checkpoint "
#: Bytes of a file that are read at most: one with a buffer of the largest size has fewer.
MOST = 2**36
# Letters of the digest and the end of its line.
_DIGEST = 65


@dataclasses.dataclass
class Checkpoint:
    """Where a run stands after a segment.

    Args:
        segments: Segments done.
        trainer: What the trainer's `state` gave; None before the first segment.
        history: A row an evaluation or a segment, see :mod:`baselines.training.run`.
        best: The best evaluation so far: its score, segment and the weights of the policy; None without one.
        core_seconds: CPU time of this process and of those before it, in [s].
        wall_seconds: Time on the clock, in [s].
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
    """The checkpoint of a file; nothing in it is executed.

    Raises:
        TrainingError: It cannot be read, or is not as it was written.
    """
    try:
        content = torch.load(io.BytesIO(_payload(file)), map_location="cpu", weights_only=True)
        if content.pop("format") != FORMAT:
            raise ValueError("it was written by another version")
        return Checkpoint(**content)
    except (OSError, RuntimeError, ValueError, KeyError, TypeError, AttributeError, EOFError, pickle.PickleError) as e:
        reason = " ".join(str(e).split()) or type(e).__name__
        raise TrainingError(f"Cannot go on from {file}: {reason[:300]}. Begin anew with --overwrite.") from None


def sealed(payload: bytes) -> bytes:
    """What a file holds: the digest, and what it is of."""
    return b"".join([MAGIC, hashlib.sha256(payload).hexdigest().encode(), b"\n", payload])


def _payload(file: pathlib.Path) -> bytes:
    """What :func:`torch.load` may read: as it was written, and no archive that unpacks to more than its own bytes."""
    content = read_bytes(file, MOST)
    if not content.startswith(MAGIC):
        raise ValueError("it is no checkpoint, or was written by another version")
    begin = len(MAGIC) + _DIGEST
    claimed, payload = content[len(MAGIC) : begin].rstrip(b"\n").decode(errors="replace"), content[begin:]
    if (digest := hashlib.sha256(payload).hexdigest()) != claimed:
        raise ValueError(f"it is damaged: expected the SHA-256 {claimed}, got {digest}")
    archives.check_stored(payload)
    return payload
