"""Collecting steps for PPO: both environments do the same work."""

import sys

from benchmarks import collection
from benchmarks.effort import QUICK
from tests.comparison import identical


def test_environments_of_stable_baselines3_are_the_same_and_collect():
    ours, other = collection.environments(3).values()
    for env in (ours, other):
        collection.stepping(env)()
        collection.collecting(env)()
        assert env.num_envs == 3
    for env in (ours, other):
        env.seed(4)
    assert identical(ours.reset(), other.reset())


def test_too_many_environments_are_not_collected(monkeypatch):
    monkeypatch.setattr(collection, "MOST_IN_A_ROW", 2)
    assert collection.tables(QUICK) == []


def test_without_the_library_it_is_left_out(monkeypatch):
    monkeypatch.delitem(sys.modules, "ikgym.sb3", raising=False)
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.monitor", None)
    (table,) = collection.tables(QUICK)
    assert table.rows == {}
    assert "ikgym[train]" in table.skipped[0]
    table.text(), table.markdown(), table.as_json()
