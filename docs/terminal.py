"""The command ``ikgym`` as it is called on a terminal, and what it prints there."""

from __future__ import annotations

import contextlib
import functools
import io
import os
import sys
from collections.abc import Iterator, Sequence
from unittest import mock

from baselines.cli import main

#: Characters of a line.
COLUMNS = 120


@contextlib.contextmanager
def terminal() -> Iterator[None]:
    """The process as the command is called in it."""
    with mock.patch.object(sys, "argv", ["ikgym"]), mock.patch.dict(os.environ, {"COLUMNS": str(COLUMNS)}):
        yield


def call(arguments: Sequence[str]) -> bool:
    """Calls the command with the words after ``ikgym``; whether it failed."""
    return bool(main(arguments))


@functools.cache
def manual_of(*words: str) -> str:
    """Output of ``ikgym WORDS --help``."""
    out = io.StringIO()
    with terminal(), contextlib.redirect_stdout(out), contextlib.suppress(SystemExit):
        call([*words, "--help"])
    return without_spaces(out.getvalue())


def without_spaces(text: str) -> str:
    """The text without spaces at the ends of its lines."""
    return "\n".join(line.rstrip() for line in text.strip().splitlines())
