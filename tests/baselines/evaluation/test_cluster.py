"""Episodes that workers of a cluster play: the same as here, or refused."""

from __future__ import annotations

import dataclasses

import pytest

from baselines.evaluate import evaluate
from baselines.evaluation import run as playing
from baselines.evaluation.results import read_rows
from baselines.workers import ClusterError, WorkerError, Workers
from tests.baselines.losing import LosingCluster

STEPS = 5


@pytest.fixture
def pool(monkeypatch):
    """The workers of the cluster."""
    return LosingCluster(monkeypatch)


@pytest.fixture
def one_by_one(monkeypatch):
    monkeypatch.setattr(playing, "BLOCK", 1)


def play(episodes=4, **options):
    return evaluate("varga7-random", "dls", episodes=episodes, steps=STEPS, **options)


def costs(rows):
    return [(row.seed, row.total_cost, row.tracking_cost) for row in rows]


def test_a_lost_node_changes_nothing(pool, one_by_one, tmp_path, caplog):
    pool.lost = {0, 2}
    rows = play(cluster="ray", out=tmp_path)
    assert costs(rows) == costs(play())
    assert len(pool.units) == 5  # three episodes, two of them twice
    assert caplog.text.count("its job is retried") == 2
    # Times are those of this machine alone, and a table without them has a dash.
    assert [row.time_p50_us is None for row in rows] == [False, True, True, True]
    assert read_rows(tmp_path / "results.json") == rows


def test_a_unit_that_kills_every_worker_is_named_and_the_others_are_kept(pool, one_by_one, tmp_path):
    pool.lost = {2, 3, 4}
    with pytest.raises(
        WorkerError, match="dls in varga7-random: workers died over it 3 times, the last time because its node was lost"
    ):
        play(cluster="ray", out=tmp_path)
    kept = [row.seed for row in read_rows(tmp_path / "results.json")]
    assert len(kept) == 2
    before = len(pool.units)
    assert costs(play(cluster="ray", out=tmp_path, resume=True)) == costs(play())
    assert len(pool.units) == before + 1


def test_another_version_of_the_code_is_refused(pool, monkeypatch):
    def other(*arguments, plain=playing.play):
        return [(dataclasses.replace(row, fingerprint="0" * 12), episode) for row, episode in plain(*arguments)]

    monkeypatch.setattr(playing, "play", other)
    with pytest.raises(WorkerError, match="dls in varga7-random: a worker returned results of another job or version"):
        play(cluster="ray")


def test_nothing_is_overwritten_before_there_is_a_cluster(monkeypatch, tmp_path):
    def check(self):
        assert self.cluster == "ray"
        raise ClusterError("nobody is there")

    rows = play(out=tmp_path)
    monkeypatch.setattr(Workers, "check", check)
    with pytest.raises(ClusterError):
        play(out=tmp_path, overwrite=True, cluster="ray")
    assert read_rows(tmp_path / "results.json") == rows
