"""The report of a run: a page with all tables."""

from __future__ import annotations

import math

import pytest

from benchmarks import report
from benchmarks.__main__ import SECTIONS, Command, main
from benchmarks.table import Column, Table

TABLE = Table(
    "speed",
    "Speed of things",
    "On a quiet day.",
    (Column("step_us", "step", "µs"), Column("ratio", "× first")),
    {"first": (12.3456, 1.0), "second": (2.0e6, None)},
    ("third: it is not there",),
)


def test_text():
    assert TABLE.text().splitlines() == [
        "Speed of things",
        "          step [µs]  × first",
        "  first       12.35    1.000",
        "  second    2.000e6        –",
        "left out: third: it is not there",
    ]


def test_markdown():
    assert TABLE.markdown().splitlines() == [
        "## Speed of things",
        "",
        "On a quiet day.",
        "",
        "|  | step [µs] | × first |",
        "| :-- | --: | --: |",
        "| first | 12.35 | 1.000 |",
        "| second | 2.000e6 | – |",
        "",
        "- left out: third: it is not there",
    ]


def test_a_missing_library_is_said_to_be_missing(monkeypatch):
    monkeypatch.setattr(report, "LIBRARIES", ("gymnasium", "no-such-library"))
    given = report.conditions()
    assert given["no-such-library"] is None
    assert given["gymnasium"]
    assert "- no-such-library: not installed" in report.page([], given)


def test_quick_report_is_complete(tmp_path, capsys):
    tables = main(Command(tmp_path, quick=True))
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    printed = capsys.readouterr().out
    assert len({table.key for table in tables}) == len(tables) >= len(SECTIONS)
    for table in tables:
        assert table.markdown() in page
        assert table.text() in printed
        united = [k for k, column in enumerate(table.columns) if column.unit]
        for row in table.rows.values():
            assert all(math.isfinite(row[k]) and row[k] > 0 for k in united if row[k] is not None)


def test_sections_can_be_chosen(tmp_path):
    assert [table.key for table in main(Command(tmp_path, quick=True, sections=("start",)))] == ["import"]
    with pytest.raises(SystemExit, match=r"expected some of .*horizons.*, got nonsense"):
        main(Command(tmp_path, quick=True, sections=("nonsense",)))
