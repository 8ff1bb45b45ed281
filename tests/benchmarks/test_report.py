"""The report of a run: a page with all tables."""

import math

import pytest

from benchmarks import table
from benchmarks.__main__ import SECTIONS, Command, main
from benchmarks.horizons import COLUMNS
from benchmarks.pose_solvers import OURS, RIVALS
from benchmarks.table import Table, page

TABLE = Table(
    "Speed of things",
    "On a quiet day.",
    ("step [µs]", "× first"),
    {"first": (12.3456, 1.0), "second": (2.0e6, None)},
    ("third: it is not there",),
)


def test_text_and_markdown(monkeypatch):
    assert TABLE.text().splitlines() == [
        "Speed of things",
        "          step [µs]  × first",
        "  first       12.35    1.000",
        "  second    2.000e6        –",
        "left out: third: it is not there",
    ]
    assert TABLE.markdown().splitlines()[4:] == [
        "|  | step [µs] | × first |",
        "| :-- | --: | --: |",
        "| first | 12.35 | 1.000 |",
        "| second | 2.000e6 | – |",
        "",
        "- left out: third: it is not there",
    ]
    monkeypatch.setattr(table, "LIBRARIES", ("gymnasium", "no-such-library"))
    text = page([TABLE], {"command": "mine"})
    assert TABLE.markdown() in text
    for line in ("- command: mine", "- gymnasium: 1.", "- no-such-library: not installed"):
        assert line in text


def test_quick_report_is_complete(tmp_path, capsys):
    tables = main(Command(tmp_path, quick=True))
    text = (tmp_path / "README.md").read_text(encoding="utf-8")
    printed = capsys.readouterr().out
    assert len({table.title for table in tables}) == len(tables) >= len(SECTIONS)
    for found in tables:
        assert found.markdown() in text
        assert found.text() in printed
        united = [k for k, column in enumerate(found.columns) if "[" in column]
        for row in found.rows.values():
            assert all(math.isfinite(row[k]) and row[k] > 0 for k in united if row[k] is not None)
        if found.columns == COLUMNS:  # no solver is below the best of them
            assert min(row[COLUMNS.index("worst excess")] for row in found.rows.values()) == 0.0
        if found.title.startswith("Inverse"):
            assert set(OURS) <= set(found.rows)
            assert len(found.rows) + len(found.skipped) == len(OURS) + len(RIVALS)


def test_unknown_sections_are_refused(tmp_path):
    with pytest.raises(SystemExit, match=r"expected some of .*horizons.*, got nonsense"):
        main(Command(tmp_path, quick=True, sections=("nonsense",)))
