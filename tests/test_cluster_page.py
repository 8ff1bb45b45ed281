"""The page on clusters: its figures are those that are worked out, and it says what the code does."""

from __future__ import annotations

import pytest

from baselines.evaluation.units import BLOCK, REPLAYED
from baselines.workers import TOLERANCE, TRIES
from docs.cluster import PAGES, makespan, paragraph

PAGE = " ".join((PAGES / "cluster.md").read_text(encoding="utf-8").split())


def test_it_ends_with_what_is_worked_out():
    assert PAGE.endswith(paragraph()), "write it anew: docs.cluster.paragraph()"


def test_it_says_what_the_code_does():
    assert f"a block of at most {BLOCK} seeds" in PAGE
    assert TOLERANCE == 1e-6
    assert "a relative difference of 1e-6" in PAGE
    assert (TRIES, REPLAYED) == (3, 3)
    assert "up to three times in all" in PAGE
    assert "the first three policies" in PAGE


@pytest.mark.parametrize(("cores", "expected"), [(1, 10.0), (2, 6.0), (3, 5.0), (100, 4.0)])
def test_a_unit_goes_to_the_core_that_is_free_first(cores, expected):
    assert makespan([1.0, 2.0, 3.0, 4.0], cores) == expected
