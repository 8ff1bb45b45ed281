"""Reading files of unknown origin: their bytes, JSON in them, the trust that they need, and their errors."""

from __future__ import annotations

import difflib
import pathlib
import textwrap
from typing import Any, Final, NoReturn

from baselines.files import ResultsError, json_files, read_bytes

#: Agents of ours.
SUFFIX: Final = ".safetensors"
#: Models of Stable-Baselines3.
ZIP: Final = ".zip"

# Files of agents are small; what is larger is none, and is not read. In bytes.
MOST = 2**28
# Letters of a message: what is in a damaged file may be long.
MOST_WORDS = 600

_TRUST = (
    " With --trust, or trust=True, it is loaded: only for files whose maker you know. The safe format for what comes "
    "from others is .safetensors: whoever trained the model writes one by baselines.agents.sb3_zip.export_model, and "
    "train.py leaves an agent.safetensors beside each model.zip."
)


def parse_json(source: str, text: bytes) -> dict[str, Any]:
    """The object in a JSON text of unknown origin.

    Raises:
        ResultsError: It is none.
    """
    try:
        value = json_files.parse(text)
    except json_files.JsonError as e:
        refuse(source, f"is damaged: {e}")
    if not isinstance(value, dict):
        refuse(source, f"is damaged: expected a JSON object, got {type(value).__name__}")
    return value


def check_file(file: pathlib.Path) -> None:
    """Refuses a file that is not there; the message has the nearest."""
    try:
        if not file.is_file():
            refuse(str(file), "is no file" if file.exists() else "does not exist", _near(file))
    except (OSError, ValueError) as e:
        refuse(str(file), f"cannot be read: {getattr(e, 'strerror', None) or e}")


def read(file: pathlib.Path) -> bytes:
    """All bytes of a file that is not too large to be an agent's.

    Raises:
        ResultsError: There is no such file, the message has the nearest; it is too large, or cannot be read.
    """
    check_file(file)
    try:
        return read_bytes(file, MOST)
    except OSError as e:
        refuse(str(file), f"cannot be read: {e.strerror or e}")
    except ValueError as e:
        refuse(str(file), f"is no agent: {e}")


def check_trust(file: pathlib.Path, *, trust: bool) -> None:
    """Refuses a model of Stable-Baselines3 that nobody trusts.

    Args:
        file: Its .zip.
        trust: Whether the caller does.

    Raises:
        ResultsError: There is no such file, or it is not trusted.
    """
    check_file(file)
    if not trust:
        refuse(str(file), "may run code of its own when Stable-Baselines3 loads it", _TRUST)


def refuse(source: str, why: str, hint: str = "") -> NoReturn:
    """Raises the error of a file that cannot be used."""
    raise ResultsError(f"Agent {source} {textwrap.shorten(why, MOST_WORDS, placeholder=' …')}.{hint}")


def _near(file: pathlib.Path) -> str:
    """The hint at what may have been meant."""
    if not file.parent.is_dir():
        return f" There is no folder {file.parent}."
    names = sorted(other.name for other in file.parent.iterdir() if other.suffix in {SUFFIX, ZIP})
    nearest = difflib.get_close_matches(file.name, names, n=1, cutoff=0.5)
    return f" Did you mean {str(file.with_name(nearest[0]))!r}?" if nearest else ""
