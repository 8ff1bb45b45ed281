"""Runs tutorials word by word, and writes what they print into their pages: ``python -m docs.tutorial [PAGE …]``."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest import mock

from baselines import registry
from docs.terminal import call, terminal, without_spaces

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = (README, ROOT / "docs" / "tutorial.md", *sorted((ROOT / "docs" / "tutorials").glob("*.md")))
# A block, with the name of the file that it is; blocks of text are what the block before has printed.
_BLOCK = re.compile(r"(?:<!-- file: (?P<file>\S+) -->\n)?```(?P<kind>\w*)\n(?P<content>.*?)```\n", re.DOTALL)


def parts(page: Path) -> tuple[str, str]:
    """The text of a page that is run, and the rest: the README is run up to its first heading."""
    begin, heading, rest = page.read_text(encoding="utf-8").partition("\n## " if page == README else "\0")
    return begin, heading + rest


def play(text: str, folder: Path) -> str:
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
            printed = _run_block(found["kind"], found["content"], names)
        return found[0]

    with contextlib.chdir(folder), mock.patch.object(sys, "path", [str(folder), *sys.path]), terminal():
        return _BLOCK.sub(replaced, text)


def _run_block(kind: str, content: str, names: dict[str, Any]) -> str:
    """Output of a block; of a command that fails its message, too."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        if kind == "python":
            exec(compile(content, "tutorial", "exec", dont_inherit=True), names)
            failed = False
        else:
            lines = content.replace("\\\n", " ").splitlines()
            with _no_names_of_snippets():
                failed = sum(call(shlex.split(line, comments=True)[1:]) for line in lines) > 0
    return without_spaces(out.getvalue() + (err.getvalue() if failed else "")) + "\n"


@contextlib.contextmanager
def _no_names_of_snippets() -> Iterator[None]:
    """The registry of a new process: a command knows no policy that a snippet has registered."""
    ours = {name: place for name, place in registry._import_paths.items() if place.startswith("baselines.")}
    with mock.patch.object(registry, "_import_paths", ours), mock.patch.object(registry, "_classes", {}):
        yield


def main() -> None:
    """Writes the pages anew, those that are named or all."""
    wanted = sys.argv[1:] or [page.stem for page in PAGES]
    for page in (page for page in PAGES if page.stem in wanted):
        text, rest = parts(page)
        with tempfile.TemporaryDirectory() as folder:
            text = play(text, Path(folder))
        page.write_text(text + rest, encoding="utf-8")


if __name__ == "__main__":
    main()
