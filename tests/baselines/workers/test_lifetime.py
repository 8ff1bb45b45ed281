"""Workers end with the process that has started them, be it killed."""

from __future__ import annotations

import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest

EVALUATE = (
    *("baselines.evaluate", "--scenarios", "varga7-random", "--episodes", "400", "--no-plots", "--workers", "2"),
    *("--policies", "rhc:horizon=100,starts=1"),
)
# Segments enough that nobody is done before it is stopped.
TRAIN = (
    *("baselines.training.command", "ppo", "--preset", "smoke", "--segments", "100000", "--evaluate-every", "100000"),
    *("--seeds", "0", "1", "--workers", "2", "--out"),
)
# `baselines.training.command` has no main of its own: train.py calls it.
MAIN = "import sys; from {module} import main; sys.exit(main(sys.argv[1:]))"

WAIT = """
import multiprocessing, time
from baselines.workers.lifetime import end_with_parent

def work():
    end_with_parent()
    print(multiprocessing.current_process().pid, flush=True)
    time.sleep(60)

if __name__ == "__main__":
    context = multiprocessing.get_context("spawn")
    for process in [context.Process(target=work) for _ in range(2)]:
        process.start()
    time.sleep(60)
"""

needs_proc = pytest.mark.skipif(not pathlib.Path("/proc/self/stat").exists(), reason="looks processes up in /proc")


def alive(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def descendants(pid):
    """Processes that were started by the threads of one, without Python's tracker of resources."""
    threads = pathlib.Path(f"/proc/{pid}/task").glob("*/children")
    children = [child for thread in threads for child in thread.read_text().split()]
    commands = {child: pathlib.Path(f"/proc/{child}/cmdline").read_text() for child in children}
    return [int(child) for child, command in commands.items() if "spawn_main" in command]


def wait_for(condition, seconds):
    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        time.sleep(0.05)
    return condition()


@needs_proc
@pytest.mark.parametrize("end", [signal.SIGKILL, signal.SIGTERM])
def test_workers_end_with_a_killed_parent(tmp_path, end):
    (tmp_path / "wait.py").write_text(WAIT)
    sources = {**os.environ, "PYTHONPATH": str(pathlib.Path(__file__).parents[3])}
    line = [sys.executable, str(tmp_path / "wait.py")]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True, env=sources) as parent:
        try:
            workers = [int(parent.stdout.readline()) for _ in range(2)]
            assert all(map(alive, workers))
        finally:
            parent.send_signal(end)
        assert wait_for(lambda: not any(map(alive, workers)), 30.0)


@needs_proc
@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "end"), [(EVALUATE, signal.SIGTERM), (TRAIN, signal.SIGKILL)], ids=["evaluate", "train"]
)
def test_workers_of_commands_end_with_them(tmp_path, command, end):
    module, *options = command
    if options[-1] == "--out":
        pytest.importorskip("stable_baselines3")
        options.append(str(tmp_path))
    line = [sys.executable, "-c", MAIN.format(module=module), *options]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as parent:
        try:
            assert wait_for(lambda: len(descendants(parent.pid)) == 2, 60.0)
            workers = descendants(parent.pid)
            time.sleep(4.0)  # they have loaded what they need, and are at work
            assert all(map(alive, workers))
        finally:
            parent.send_signal(end)
        assert wait_for(lambda: not any(map(alive, workers)), 30.0)
