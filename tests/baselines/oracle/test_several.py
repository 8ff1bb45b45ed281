"""Best known costs that workers find are those that are found here."""

import dataclasses

import pytest

from baselines.episodes import Seeds
from baselines.oracle import Search, several
from baselines.oracle.cache import read_cached
from baselines.oracle.several import SearchJob, find_all
from baselines.workers import WorkerError, Workers
from ikgym import scenarios
from tests.baselines.losing import LosingCluster

HOW = Search(starts=1, chains=1, generations=0, polished=1, knots=20)
FAR = Workers(cluster="ray")


@pytest.fixture
def pool(monkeypatch):
    return LosingCluster(monkeypatch, lost=[0])


def wanted(*, cached=True):
    scenario = scenarios.get("varga7-random").replace(steps=40)
    return [SearchJob(scenario, Seeds(seed), HOW, cached=cached) for seed in (7_000_000, 7_000_001)]


def costs(found):
    return {one.draw.seed: optimum.cost for one, optimum in found}


def test_they_are_the_same_and_kept_here(pool, monkeypatch, tmp_path):
    monkeypatch.setenv("IKGYM_CACHE", str(tmp_path))
    alone = costs(find_all(wanted(cached=False)))
    assert costs(find_all(wanted(cached=False), FAR)) == alone
    assert read_cached(wanted()[0].scenario, 7_000_000, HOW) is None
    assert costs(find_all(wanted(), FAR)) == alone
    assert read_cached(wanted()[0].scenario, 7_000_000, HOW).cost == alone[7_000_000]
    asked = len(pool.units)
    assert asked == 2 + 1 + 2  # one was lost
    assert costs(find_all(wanted(), FAR)) == alone
    assert len(pool.units) == asked  # an interrupted search continues: nothing is searched twice


def test_a_path_that_costs_something_else_here_is_refused(pool, monkeypatch):
    def find(one, plain=several.find):
        optimum = plain(one)
        return dataclasses.replace(optimum, cost=optimum.cost * (1.0 - 1e-5))

    monkeypatch.setattr(several, "find", find)
    with pytest.raises(WorkerError, match="expected a relative difference of at most 1e-06"):
        costs(find_all(wanted(cached=False), FAR))


def test_an_episode_over_which_all_workers_die_is_named(pool):
    pool.lost = {0, 1, 2}
    with pytest.raises(WorkerError, match="varga7-random, seed 7000000: workers died over it 3 times"):
        costs(find_all(wanted(cached=False), FAR))
