"""The documentation as a site: every page has its place, nothing is broken, and it needs no network."""

from __future__ import annotations

import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import baselines
import ikgym
from baselines import console
from docs import notebook
from docs.site import reference

ROOT = Path(__file__).parents[1]
SETTINGS = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
NOTEBOOK = json.loads(notebook.FILE.read_text(encoding="utf-8"))
needs_docs = pytest.mark.skipif(
    any(importlib.util.find_spec(name) is None for name in ("material", "mkdocstrings", "nbconvert", "ipykernel")),
    reason='the site needs: pip install "ikgym[docs]"',
)


def test_every_page_has_its_place():
    there = {str(page.relative_to(ROOT / "docs")) for page in (ROOT / "docs").rglob("*.md")}
    placed = re.findall(r": (\S+\.md)$", SETTINGS.partition("\nnav:")[2], re.MULTILINE)
    generated = {"contributing.md", "changelog.md", "reference/commands.md", "notebooks/panda.md"}
    generated |= {f"reference/{name}.md" for name in reference.PAGES}
    assert sorted(placed) == sorted(there | generated)


def test_the_reference_has_all_public_names():
    for name, page in (("ikgym", reference.api("ikgym")), ("baselines", reference.api("baselines"))):
        shown = re.findall(r"^::: (\S+)$", page, re.MULTILINE)
        assert len(shown) == len(set(shown))
        assert {f"{name}.{public}" for public in reference.public_names(importlib.import_module(name))} <= set(shown)
    assert {"ikgym.Arm", "ikgym.RedundantIKEnv", "ikgym.scenarios.get"} <= set(
        re.findall(r"::: (\S+)", reference.api("ikgym"))
    )
    assert {"baselines.make", "baselines.evaluate.evaluate"} <= set(
        re.findall(r"::: (\S+)", reference.api("baselines"))
    )
    assert ikgym.Arm is not baselines.SolverPolicy


def test_the_reference_has_all_commands():
    text = reference.commands()
    headings = re.findall(r"^## ikgym (\w+)$", text, re.MULTILINE)
    assert headings == [*console.COMMANDS, *console.LISTS]
    assert all(f"usage: ikgym {word}" in text for word in headings)
    assert "--severities" in text
    assert "## ikgym train apg" in text


def test_the_notebook_runs_with_few_steps(monkeypatch):
    """Its cells one after the other, in this process; pictures are not shown."""
    monkeypatch.setenv("MPLBACKEND", "Agg")
    names: dict = {}
    for cell in NOTEBOOK["cells"]:
        if cell["cell_type"] == "code":
            source = "".join(cell["source"])
            exec(re.sub(r"^STEPS = \d+$", "STEPS = 20", source, flags=re.MULTILINE), names)
    assert names["STEPS"] == 20
    assert list(names["tracks"]) == names["SOLVERS"]


def shown(cells):
    """What code cells have printed, cell by cell."""
    texts = []
    for cell in cells:
        outputs = [o for o in cell.get("outputs", ()) if o["output_type"] == "stream" and o["name"] == "stdout"]
        texts.append("".join("".join(output["text"]) for output in outputs).split())
    return texts


@needs_docs
@pytest.mark.slow
def test_the_notebook_shows_what_it_shows_when_it_is_run():
    again = notebook.executed(notebook.FILE)
    for before, after in zip(shown(NOTEBOOK["cells"]), shown(again["cells"]), strict=True):
        assert len(before) == len(after)
        for one, other in zip(before, after, strict=True):
            try:
                assert float(one) == pytest.approx(float(other), rel=2e-2), notebook.__doc__
            except ValueError:
                assert one == other, notebook.__doc__
    assert any("image/png" in o.get("data", {}) for cell in again["cells"] for o in cell.get("outputs", ()))


@needs_docs
@pytest.mark.slow
def test_it_builds_strictly_and_asks_for_nothing_from_elsewhere(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path)]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    for page in ("index", "papers/varga", "tutorials/first_policy", "reference/ikgym", "notebooks/panda"):
        text = (tmp_path / f"{page}.html").read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(?:https?:)?//', text)
    api = (tmp_path / "reference" / "ikgym.html").read_text(encoding="utf-8")
    assert 'id="ikgym.Arm.inverse"' in api
    assert ":class:`" not in api
    index = json.loads((tmp_path / "search" / "search_index.json").read_text(encoding="utf-8"))
    assert any("Levenberg" in one["text"] for one in index["docs"])
