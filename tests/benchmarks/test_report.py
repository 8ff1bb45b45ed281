"""The report of a run: JSON with units, and a page with all tables."""

from __future__ import annotations

import json
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


def test_json_has_all_digits_and_units():
    assert TABLE.as_json() == {
        "key": "speed",
        "title": "Speed of things",
        "conditions": "On a quiet day.",
        "columns": [
            {"key": "step_us", "title": "step", "unit": "µs"},
            {"key": "ratio", "title": "× first", "unit": ""},
        ],
        "rows": [
            {"name": "first", "step_us": 12.3456, "ratio": 1.0},
            {"name": "second", "step_us": 2.0e6, "ratio": None},
        ],
        "skipped": ["third: it is not there"],
    }


def test_a_missing_library_is_said_to_be_missing(monkeypatch):
    monkeypatch.setattr(report, "LIBRARIES", ("gymnasium", "no-such-library"))
    given = report.conditions()
    assert given["no-such-library"] is None
    assert given["gymnasium"]
    assert "- no-such-library: not installed" in report.page([], given)


def test_quick_report_is_complete(tmp_path, capsys):
    tables = main(Command(tmp_path, quick=True))
    document = json.loads((tmp_path / "bench.json").read_text(encoding="utf-8"))
    page = (tmp_path / "README.md").read_text(encoding="utf-8")
    printed = capsys.readouterr().out
    assert document["conditions"]["quick"] is True
    assert document["conditions"]["cores"] >= 1
    assert {"cpu", "python", "ikgym", "command", "finished", "casadi"} <= set(document["conditions"])
    assert [table["key"] for table in document["tables"]] == [table.key for table in tables]
    assert len({table.key for table in tables}) == len(tables) >= len(SECTIONS)
    for table, written in zip(tables, document["tables"], strict=True):
        assert table.markdown() in page
        assert table.text() in printed
        assert len(written["rows"]) == len(table.rows) >= 1
        for row in written["rows"]:
            united = [column for column in written["columns"] if column["unit"]]
            figures = [row[column["key"]] for column in united or written["columns"]]  # ratios alone have no unit
            assert figures
            assert all(math.isfinite(figure) and figure > 0 for figure in figures)


def test_sections_can_be_chosen(tmp_path):
    assert [table.key for table in main(Command(tmp_path, quick=True, sections=("start",)))] == ["import"]
    with pytest.raises(SystemExit, match=r"expected some of .*horizons.*, got nonsense"):
        main(Command(tmp_path, quick=True, sections=("nonsense",)))
