"""The tutorials: all of them are run, each in an empty folder, and print what their pages say."""

from __future__ import annotations

import re

import pytest

import baselines
from baselines import registry
from docs.tutorial import PAGES, parts, play

#: Pages that take longer; the options of their commands are looked at with those of all pages.
LONGER = {"README", "reproducing", "training", "wrong_models"}
REMEDY = "write it anew with: python -m docs.tutorial"
#: The end of a line of a table of solvers: p50, p99 and misses, which are measured with a clock, and what follows.
CLOCK = re.compile(
    rf"\S+ +\S+ +(?:\d+ +((?:yes|no) +(?:{'|'.join(s.label for s in baselines.Status)}))|(yes|no))$", re.MULTILINE
)


def tokens(text):
    """Words and numbers, without what depends on the clock."""
    return re.sub(r"-{5,}", "-----", CLOCK.sub(r"\1\2", text)).split()


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
    said, _ = parts(page)
    text = play(said, tmp_path)
    assert not differences(text, said), REMEDY
    if page.stem == "tutorial":
        exported = sorted(file.name for file in (tmp_path / "results" / "export" / "weld").iterdir())
        assert [name.rpartition("-seed-0")[2] for name in exported] == [".csv", ".json"]


def test_a_page_that_says_something_else_is_noticed(tmp_path):
    block = "```python\nprint(x, 20.5, 'words')\n```\n\n```text\n7 20.5 words\n```\n"
    page = f"```python\nx = 7\n```\n\n{block}"
    assert not differences(play(page, tmp_path), page)
    for wrong in ("8 20.5 words", "7 20.9 words", "7 20.5 word", "7 20.5 words too", "7 20.5"):
        changed = page.replace("7 20.5 words\n", f"{wrong}\n")
        assert differences(play(changed, tmp_path), changed), wrong
