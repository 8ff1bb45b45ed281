"""The table of the control loop."""

from __future__ import annotations

import pytest

from docs import loop
from docs.keeping import lines


def test_lines_of_the_table_are_what_is_measured():
    """The policy alone is lost, and stops at nothing; the loop is calm."""
    late, calm = (loop.line("qp", told, 0.004, None, 2) for told in ("perfect", "identify"))
    assert late["error_um"] > 1e4
    assert late["times_peak"] > 10.0
    case = {"policy": "qp", "drives": "identify", "period_ms": "4.0", "lag_ms": "0.0", "delay": "2"}
    (kept,) = (one for one in lines("loop") if case.items() <= one.items())
    assert float(kept["error_um"]) == pytest.approx(calm["error_um"], rel=0.05)
    assert float(kept["times_peak"]) == pytest.approx(calm["times_peak"], rel=0.05)
