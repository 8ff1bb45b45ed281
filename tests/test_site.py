"""The documentation as a site: every page has its place, nothing is broken, and it needs no network."""

import importlib
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from baselines import cli
from docs.site import reference

ROOT = Path(__file__).parents[1]
SETTINGS = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
FILE = ROOT / "docs" / "notebooks" / "panda.ipynb"
NOTEBOOK = json.loads(FILE.read_text(encoding="utf-8"))
UPDATE = "jupyter nbconvert --to notebook --execute --inplace docs/notebooks/panda.ipynb"
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


def test_the_reference_has_all_commands():
    text = reference.commands()
    assert re.findall(r"^## ikgym (\w+)$", text, re.MULTILINE) == [*cli.COMMANDS]
    assert all(f"usage: ikgym {word}" in text for word in cli.COMMANDS)
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
def test_the_notebook_shows_what_it_shows_when_it_is_run(monkeypatch):
    monkeypatch.delenv("MPLBACKEND", raising=False)  # that of tests draws no picture into a notebook
    import nbformat
    from nbclient import NotebookClient

    again = NotebookClient(nbformat.read(FILE, as_version=4), timeout=300).execute()
    for before, after in zip(shown(NOTEBOOK["cells"]), shown(again["cells"]), strict=True):
        assert len(before) == len(after)
        for one, other in zip(before, after, strict=True):
            try:
                assert float(one) == pytest.approx(float(other), rel=2e-2), UPDATE
            except ValueError:
                assert one == other, UPDATE
    assert any("image/png" in o.get("data", {}) for cell in again["cells"] for o in cell.get("outputs", ()))


@needs_docs
def test_the_landing_page_shows_the_replay_or_says_that_there_is_none(tmp_path, caplog):
    from mkdocs.config import load_config

    from docs.site import replay

    landing = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    assert "built without" in replay.place_report(landing, there=False)
    assert "<iframe" not in replay.place_report(landing, there=False)
    assert f'src="{replay.PAGE}"' in replay.place_report(landing, there=True)
    settings = load_config(str(ROOT / "mkdocs.yml"), extra={"report": "results/none/report.html"})
    with caplog.at_level("INFO", logger="mkdocs"):
        assert replay.file(settings) is None
    assert "no results/none/report.html: the landing page is without a replay" in caplog.text


@needs_docs
def test_with_broken_links_there_is_no_site(tmp_path):
    from mkdocs.commands.build import build
    from mkdocs.config import load_config
    from mkdocs.exceptions import Abort

    folders = {"docs_dir": str(tmp_path / "docs"), "site_dir": str(tmp_path / "site")}
    (tmp_path / "docs").mkdir()

    def built(text):
        (tmp_path / "docs" / "index.md").write_text(f"# Title\n\n{text}", encoding="utf-8")
        build(load_config(str(ROOT / "mkdocs.yml"), **folders, nav=["index.md"], hooks=[], plugins=["autorefs"]))

    built("[x](index.md#title)")
    with pytest.raises(Abort, match="4 warnings"):
        built("[x](nowhere.md) [x](index.md#nothing) [x][ikgym.nothing] ![x](no.png)")


@needs_docs
@pytest.mark.slow
def test_it_builds_strictly_and_asks_for_nothing_from_elsewhere(tmp_path):
    report = tmp_path / "report.html"
    report.write_text("<h2 id='replay-head'>Replay</h2>", encoding="utf-8")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "REPORT": str(report)}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    tmp_path /= "site"
    assert (tmp_path / "replay.html").read_bytes() == report.read_bytes()
    assert '<iframe src="replay.html"' in (tmp_path / "index.html").read_text(encoding="utf-8")
    for page in ("index", "papers/varga", "tutorials/first_policy", "reference/ikgym", "notebooks/panda"):
        text = (tmp_path / f"{page}.html").read_text(encoding="utf-8")
        assert not re.findall(r'<(?:script|link|img)[^>]+(?:src|href)="(?:https?:)?//', text)
    api = (tmp_path / "reference" / "ikgym.html").read_text(encoding="utf-8")
    assert 'id="ikgym.Arm.inverse"' in api
    assert ":class:`" not in api
    index = json.loads((tmp_path / "search" / "search_index.json").read_text(encoding="utf-8"))
    assert any("Levenberg" in one["text"] for one in index["docs"])
