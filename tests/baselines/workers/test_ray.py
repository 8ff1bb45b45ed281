"""Ray: two nodes on this machine, one of which is killed half-way."""

from __future__ import annotations

import os
import socket
import time

import pytest

pytest.importorskip("ray", reason='needs Ray: pip install "ikgym[cluster]"')

import ray
from ray.cluster_utils import Cluster

from baselines.evaluate import evaluate
from baselines.evaluation import runner
from baselines.workers import ClusterError, Workers, ray_cluster

# Ray leaves files and sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
SMALL = {"num_cpus": 1, "object_store_memory": 80 * 2**20}
EPISODES, STEPS = 12, 1000


@pytest.fixture
def cluster(monkeypatch):
    """Two nodes with a core each."""
    nodes = Cluster(initialize_head=True, head_node_args={**SMALL, "include_dashboard": False})
    monkeypatch.setenv("RAY_ADDRESS", nodes.address)
    try:
        yield nodes, nodes.add_node(**SMALL)
    finally:
        ray.shutdown()
        nodes.shutdown()


@pytest.mark.slow
def test_one_of_two_nodes_is_killed_half_way(cluster, monkeypatch, tmp_path, caplog):
    nodes, other = cluster
    monkeypatch.setattr(runner, "BLOCK", 1)
    check, done = runner.Checks.check, []

    def kill_half_way(self, unit, outcome):
        done.append(unit.digest)
        if len(done) == EPISODES // 2:
            nodes.remove_node(other, allow_graceful=False)
        check(self, unit, outcome)

    monkeypatch.setattr(runner.Checks, "check", kill_half_way)
    # Units of some tenths of a second, so that both nodes are at work when one is killed; what is played again here has
    # been loaded by then.
    given = {"scenarios": "varga7-random", "policies": "rhc", "episodes": EPISODES + 1, "steps": STEPS, "plots": False}
    alone = evaluate(**given)
    rows = evaluate(**given, cluster="ray", out=tmp_path)
    assert len(done) == len(set(done)) == EPISODES
    assert "its unit is done again" in caplog.text
    assert [untimed(row) for row in rows] == [untimed(row) for row in alone]
    assert [row.time_p50_us is None for row in rows] == [False] + [True] * EPISODES


def untimed(row):
    values = row.to_json()
    values["machine"].pop("cores")
    return {name: value for name, value in values.items() if "time" not in name and name != "deadline_misses"}


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("", "expected its address in the environment variable RAY_ADDRESS"),
        ("nowhere", "RAY_ADDRESS: expected HOST:PORT, ray://HOST:PORT or auto, got 'nowhere'"),
        ("127.0.0.1:99999", "No cluster of Ray can be reached at 127.0.0.1:99999"),
        ("closed", r"No cluster of Ray can be reached at .* \(Connection refused\)"),
    ],
)
def test_addresses_without_a_cluster(monkeypatch, address, message):
    if address == "closed":
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"127.0.0.1:{free.getsockname()[1]}"
    monkeypatch.setitem(os.environ, "RAY_ADDRESS", address)
    with pytest.raises(ClusterError, match=message):
        Workers(cluster="ray").pool(1)


def test_one_who_does_not_answer_is_given_up(monkeypatch):
    monkeypatch.setattr(ray_cluster, "CONNECTED", 0.1)
    with socket.socket() as mute:
        mute.bind(("127.0.0.1", 0))
        mute.listen()
        monkeypatch.setattr(ray_cluster.ray, "init", lambda **_: time.sleep(1.0))
        with pytest.raises(ClusterError, match=r"no answer of Ray within 0\.1 s"):
            ray_cluster.connect(f"127.0.0.1:{mute.getsockname()[1]}")
