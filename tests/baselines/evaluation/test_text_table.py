"""Tables that fit the terminal."""

from __future__ import annotations

import dataclasses

import pytest

from baselines.evaluation import report
from tests.baselines.evaluation.test_report import REFERENCE, row

ROWS = [
    row(policy="full_orientation", parameters={"policy": "dls"}, total_cost=2.801e14, deadline_misses=120),
    row(policy="rhc_foresight", parameters={}, status="iteration_limit", time_p99_us=1028.0, cost_ratio=1.234),
    dataclasses.replace(REFERENCE, orientation_error_max=5.3e-7),
]


@pytest.mark.parametrize("width", [80, 90, 100, 110, 120, 200])
def test_lines_fit(width):
    lines = report.table(ROWS, width=width).splitlines()
    assert max(len(line.replace("\u0307", "")) for line in lines) <= width


def test_what_is_least_important_is_left_out_first_and_named():
    narrow, wide = report.table(ROWS, width=80), report.table(ROWS, width=200)
    assert "left out" not in wide
    (said,) = [line for line in narrow.splitlines() if line.startswith("left out at 80 characters a line: ")]
    gone = said.partition(": ")[2].split(", ")
    assert gone[-1] == "misses"
    head = narrow.splitlines()[1].split()
    assert not set(gone).intersection(head)
    assert {"policy", "total", "status", "p50"} <= set(head)
    # What is shown is the same as in the wide table.
    assert all(cell in wide for cell in narrow.splitlines()[4].split())


def test_a_name_of_its_own_line_drops_no_column():
    many = {"gain": 0.123456, "damping": 1e-2, "another": "a rather long value for a parameter", "one": "more of them"}
    wide = report.table([row(parameters=many)], width=120)
    assert "left out" not in wide
