"""Runs the tutorial word by word, and writes what it prints into the page: ``python -m docs.tutorial``."""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from baselines.console import main as console

PAGE = Path(__file__).parent / "tutorial.md"
# A block, with the name of the file that it is; blocks of text are what the block before has printed.
_BLOCK = re.compile(r"(?:<!-- file: (?P<file>\S+) -->\n)?```(?P<kind>\w*)\n(?P<content>.*?)```\n", re.DOTALL)


def played(text: str, folder: Path) -> str:
    """The page with what its commands and snippets print in this folder, which becomes the current one."""
    names: dict[str, Any] = {}
    printed = ""

    def replaced(found: re.Match[str]) -> str:
        nonlocal printed
        if found["kind"] == "text":
            return f"```text\n{printed}```\n"
        if found["file"]:
            (folder / found["file"]).write_text(found["content"], encoding="utf-8")
        elif found["kind"] in ("sh", "python"):
            printed = _printed(found["kind"], found["content"], names)
        return found[0]

    with contextlib.chdir(folder), _terminal():
        return _BLOCK.sub(replaced, text)


@contextlib.contextmanager
def _terminal() -> Iterator[None]:
    """The command as it is called on a terminal with 110 characters a line."""
    with mock.patch.object(sys, "argv", ["ikgym"]), mock.patch.dict(os.environ, {"COLUMNS": "110"}):
        yield


def _printed(kind: str, content: str, names: dict[str, Any]) -> str:
    """What a block prints; of a command that fails its message, too."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        if kind == "python":
            exec(compile(content, PAGE.name, "exec", dont_inherit=True), names)
            failed = False
        else:
            codes = [console(shlex.split(line)[1:]) for line in content.splitlines()]
            failed = any(codes)
    text = out.getvalue() + (err.getvalue() if failed else "")
    return "\n".join(line.rstrip() for line in text.strip().splitlines()) + "\n"


def main() -> None:
    """Writes the page anew."""
    with tempfile.TemporaryDirectory() as folder:
        text = played(PAGE.read_text(encoding="utf-8"), Path(folder))
    PAGE.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
