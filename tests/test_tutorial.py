"""The tutorials: all of them are run, each in a folder of its own, and print what their pages say."""

from __future__ import annotations

import re

import pytest

import baselines
from baselines import registry
from docs.tutorial import PAGES, played

TEXT = PAGES[0].read_text(encoding="utf-8")
#: Pages that take longer; the options of their commands are looked at with those of all pages.
LONGER = {"reproducing", "training", "wrong_models"}
REMEDY = "write it anew with: python -m docs.tutorial"
#: The end of a line of the table of solvers: p50, p99 and misses, which are measured with a clock, and what follows.
CLOCK = re.compile(rf"\S+ +\S+ +\d+ +((yes|no) +({'|'.join(s.label for s in baselines.Status)}))$", re.MULTILINE)


def tokens(text):
    """Words and numbers, without what depends on the clock."""
    return re.sub(r"-{5,}", "-----", CLOCK.sub(r"\1", text)).split()


def same(one, other):
    try:
        return float(one) == pytest.approx(float(other), rel=1e-2)
    except ValueError:
        return one == other


def differences(one, other):
    first, second = tokens(one), tokens(other)
    found = [(a, b) for a, b in zip(first, second, strict=False) if not same(a, b)]
    return found or (first[len(second) :] + second[len(first) :])


@pytest.fixture(autouse=True)
def names_stay_as_they_were(monkeypatch):
    """A tutorial registers a policy."""
    monkeypatch.setattr(registry, "_import_paths", dict(registry._import_paths))
    monkeypatch.setattr(registry, "_classes", dict(registry._classes))


def marked(page):
    return pytest.param(page, id=page.stem, marks=pytest.mark.slow if page.stem in LONGER else ())


@pytest.mark.parametrize("page", [marked(page) for page in PAGES])
def test_it_runs_and_prints_what_the_page_says(page, tmp_path):
    if page.stem == "training":
        pytest.importorskip("torch")
    said = page.read_text(encoding="utf-8")
    text = played(said, tmp_path)
    assert not differences(text, said), REMEDY
    if page.stem == "tutorial":
        exported = sorted(file.name for file in (tmp_path / "results" / "export" / "weld").iterdir())
        assert [name.rpartition("-seed-0")[2] for name in exported] == [".csv", ".json"]


@pytest.mark.parametrize("page", [page for page in PAGES if page.stem in LONGER], ids=lambda page: page.stem)
def test_longer_ones_are_code(page):
    for snippet in re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        compile(snippet, page.name, "exec")


@pytest.mark.parametrize("page", [page for page in PAGES if page.stem != "tutorial"], ids=lambda page: page.stem)
def test_each_says_what_it_prints(page):
    text = page.read_text(encoding="utf-8")
    assert "`python -m docs.tutorial` runs it" in " ".join(text.split())
    assert "```text\n```" not in text, REMEDY


def test_a_page_that_says_something_else_is_noticed(tmp_path):
    block = "```python\nprint(x, 20.5, 'words')\n```\n\n```text\n7 20.5 words\n```\n"
    page = f"```python\nx = 7\n```\n\n{block}"
    assert not differences(played(page, tmp_path), page)
    for wrong in ("8 20.5 words", "7 20.9 words", "7 20.5 word", "7 20.5 words too", "7 20.5"):
        changed = page.replace("7 20.5 words\n", f"{wrong}\n")
        assert differences(played(changed, tmp_path), changed), wrong


def row(policy):
    """Cells of a solver in the table of the page: its marks, and numbers from the total cost on."""
    words = re.search(rf"^{policy} .*$", TEXT, re.MULTILINE)[0].translate({ord(mark): None for mark in "†§"}).split()
    keys = ("total", "tracking", "position", "orientation", "peak", "acceleration", "p50", "p99")
    return dict(zip(keys, map(float, words[1:9]), strict=True))


def test_what_it_says_of_the_table():
    rows = {name: row(name) for name in ("dls", "qp", "rhc")}
    assert re.findall(r"^(\w+) †", TEXT, re.MULTILINE) == ["dls", "qp"]
    assert rows["qp"]["position"] > 5.0  # [mm]
    assert rows["rhc"]["position"] < 0.1  # [mm]
    assert rows["rhc"]["peak"] < 0.5 * min(rows["dls"]["peak"], rows["qp"]["peak"])
    assert rows["rhc"]["total"] == min(one["total"] for one in rows.values())
    assert "`rhc` looks 29 steps ahead" in TEXT
    assert baselines.make("rhc", "panda-line").preview == 29
