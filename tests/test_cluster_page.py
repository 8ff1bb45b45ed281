"""The page on clusters: its figures are those that are worked out, and it says what the code does."""

from __future__ import annotations

import pytest

from baselines.evaluation.units import BLOCK, REPLAYED
from baselines.workers import TOLERANCE, TRIES
from docs import cluster
from docs.cluster import Group, makespan

PAGE = " ".join(cluster.FILE.with_suffix(".md").read_text(encoding="utf-8").split())


def test_what_is_worked_out(monkeypatch):
    groups = [Group("dls", "near", 6, 2.0, 1.0), Group("rhc", "far", 1, 5.0, 2.0), Group("dls", "far", 0, 0.0, 3.0)]
    monkeypatch.setattr(cluster, "read", lambda: ({"date": "2026-01-01", "cpu": "some"}, groups))
    text = " ".join(cluster.paragraph().split())
    assert "The whole leaderboard is 7 units" in text
    assert "they take 17 s on 1 core, 5 s on 100, 5 s on 1,000: 3 and 3 times as fast" in text
    assert "the longest unit, 5 s of `rhc` on `far`" in text
    assert "one episode after the other: 6 s, whatever" in text
    assert "the whole takes 23 s, 11 s, 11 s" in text


@pytest.mark.slow
def test_a_group_is_measured():
    group = next(cluster.measured())
    assert (group.policy, group.episodes, group.units) == ("agent_alone", "varga7-pose-random", 32)
    assert group.unit > 0.0
    assert group.timed > 0.0


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
