"""Ray: two nodes on this machine, one of which is killed half-way."""

from __future__ import annotations

import os
import pathlib
import signal
import socket
import tempfile
import time

import pytest

pytest.importorskip("ray", reason='needs Ray: pip install "ikgym[cluster]"')

import ray
from ray.cluster_utils import Cluster

from baselines.evaluate import evaluate
from baselines.evaluation import run as playing
from baselines.workers import ClusterError, Workers, run_units
from tests.baselines.test_workers import needs_proc, wait_for

# Ray leaves files and sockets to the garbage collector.
pytestmark = [
    pytest.mark.filterwarnings("ignore::ResourceWarning"),
    pytest.mark.filterwarnings("ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::DeprecationWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]
EPISODES = 12
#: Where nodes of a test write what they are at, and which of them one is; and the file that the one that is to be
#: killed writes when it is at its last unit.
FOLDER, NODE, AT_WORK = "IKGYM_TEST_FOLDER", "IKGYM_TEST_NODE", "at-work"
#: In [s]: far more than it takes.
PATIENCE = 100


@pytest.fixture
def cluster(monkeypatch):
    """Two nodes with a core each, of which neither a process nor a file is left in the end; and their folder."""
    # Paths of sockets are short: the folder of a test would be too long.
    with tempfile.TemporaryDirectory(prefix="ikgym-", dir="/tmp") as folder:
        monkeypatch.setenv("RAY_TMPDIR", folder)
        monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
        monkeypatch.setenv("RAY_memory_monitor_refresh_ms", "0")  # others may use the memory of this machine
        small = {"num_cpus": 1, "object_store_memory": 80 * 2**20, "plasma_directory": folder}
        small |= {"include_log_monitor": False, "no_monitor": True}  # processes that take time to start
        before = signal.signal(signal.SIGALRM, hangs)
        signal.alarm(PATIENCE)
        nodes = Cluster()
        try:
            nodes.add_node(**small, include_dashboard=False, env_vars={FOLDER: folder, NODE: "head"})
            other = nodes.add_node(**small, env_vars={FOLDER: folder, NODE: "other"})
            monkeypatch.setenv("RAY_ADDRESS", nodes.address)
            yield nodes, other, pathlib.Path(folder)
        finally:
            signal.alarm(0)
            signal.signal(signal.SIGALRM, before)
            ray.shutdown()
            nodes.shutdown()
            gone = wait_for(lambda: not at_work_in(folder), 20.0)
    assert gone


def hangs(number, frame):
    raise TimeoutError(f"not done within {PATIENCE} s")


def at_work_in(folder):
    """Processes that have a file of a folder open, such as their log: those of Ray rename themselves."""
    found = set()
    for link in pathlib.Path("/proc").glob("[0-9]*/fd/*"):
        try:
            if str(link.readlink()).startswith(folder):
                found.add(int(link.parts[2]))
        except OSError:
            pass  # closed by now, or of somebody else
    return found - {os.getpid()}


def work(unit):
    """Plays a unit. The node that is to be killed stays at its second one; the other waits for that with its sixth."""
    folder, node = pathlib.Path(os.environ[FOLDER]), os.environ[NODE]
    (folder / f"{node}-{unit[0].seeds.seed}").touch()
    number = len(list(folder.glob(f"{node}-*")))
    if node == "other" and number == 2:
        (folder / AT_WORK).touch()
        time.sleep(2 * PATIENCE)
    if node == "head" and number == EPISODES // 2:
        wait_for((folder / AT_WORK).exists, PATIENCE)
    return playing.play(unit)


class Unknown:
    """What a node cannot read, such as a policy of a module that is not there."""

    def __reduce__(self):
        return __import__, ("no_such_module",)


@pytest.mark.slow
@needs_proc
def test_one_of_two_nodes_is_killed_half_way(cluster, monkeypatch, tmp_path, caplog):
    nodes, other, folder = cluster
    check, done = playing._check_versions, []

    def kill_half_way(batch, results):
        done.append(batch[0].key)
        if len(done) == EPISODES // 2:
            assert wait_for((folder / AT_WORK).exists, PATIENCE)
            nodes.remove_node(other, allow_graceful=False)
        check(batch, results)

    given = {"scenarios": "varga7-random", "policies": "dls", "episodes": EPISODES + 1, "steps": 50}
    alone = evaluate(**given)
    monkeypatch.setattr(playing, "BLOCK", 1)
    monkeypatch.setattr("baselines.workers.run_units", lambda function, *given: run_units(work, *given))
    monkeypatch.setattr(playing, "_check_versions", kill_half_way)
    rows = evaluate(**given, cluster="ray", out=tmp_path)
    assert len(done) == len(set(done)) == EPISODES
    assert caplog.text.count("its job is retried") == 1
    assert [untimed(row) for row in rows] == [untimed(row) for row in alone]
    assert [row.time_p50_us is None for row in rows] == [False] + [True] * EPISODES
    # To start nodes takes long: so here is also seen what they say of units that they cannot read.
    ((_, future),) = run_units(work, [Unknown()], Workers(cluster="ray"))
    with pytest.raises(ClusterError, match=r"cannot do its work: .*no_such_module.* Install ikgym and the packages"):
        future.result()


def untimed(row):
    values = row.to_json()
    values["machine"].pop("cores")
    return {name: value for name, value in values.items() if "time" not in name and name != "deadline_misses"}


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("", "expected the address of the cluster in the environment variable RAY_ADDRESS"),
        ("nowhere", "RAY_ADDRESS: expected HOST:PORT or auto, got 'nowhere'"),
        ("ray://127.0.0.1:1", "expected HOST:PORT or auto, got 'ray://127.0.0.1:1'"),
        ("127.0.0.1:99999", "No cluster of Ray can be reached at RAY_ADDRESS=127.0.0.1:99999"),
        (64 * "a" + ":1", "No cluster of Ray can be reached at RAY_ADDRESS=aaa"),
        ("closed", r"No cluster of Ray can be reached at .* \(Connection refused\)"),
    ],
)
def test_addresses_without_a_cluster(monkeypatch, address, message):
    if address == "closed":
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            address = f"127.0.0.1:{free.getsockname()[1]}"
    monkeypatch.setenv("RAY_ADDRESS", address)
    with pytest.raises(ClusterError, match=message):
        Workers(cluster="ray").check()
