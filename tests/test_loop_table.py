"""The table of the control loop."""

from __future__ import annotations

from docs import loop


def test_lines_of_the_table_are_what_is_measured():
    """The policy alone is lost, and stops at nothing; the loop is calm."""
    late, calm = (loop.measured("qp", told, 0.004, None, 2) for told in ("perfect", "identify"))
    assert late["error_um"] > 1e4
    assert late["times_peak"] > 10.0
    (row,) = (row for row in loop.table() if row[:3] == ("`qp`", "identify", "4"))
    assert row[5] == f"{calm['error_um']:.2g}, {calm['times_peak']:.2g}"
