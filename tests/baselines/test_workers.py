"""Work in other processes: dead workers are replaced, errors reach the caller, and workers end with their parent."""

import contextlib
import os
import pathlib
import signal
import subprocess
import sys
import time

import pytest

from baselines.workers import Workers, run_units
from ikgym.exceptions import InvalidInputError, MissingDependencyError, UnknownNameError
from ikgym.kernels import threads

FAR = Workers(cluster="ray")
EVALUATE = ("evaluate", "--scenarios", "varga7-random", "--episodes", "400", "--policies", "rhc:horizon=100,starts=1")
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


def dies_once(unit):
    """Is killed at the unit 1 unless a file exists that it makes before."""
    folder, number = unit
    mark = folder / "mark"
    if number == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def waits(folder):
    """Says which process it is, and stays; the first one fails once all are there."""
    (folder / str(os.getpid())).touch()
    if (folder / "first").exists():
        time.sleep(60.0)
    (folder / "first").touch()
    assert wait_for(lambda: len(list(folder.iterdir())) == 3, 30.0)
    raise InvalidInputError("enough")


def results(*arguments, **options):
    with contextlib.closing(run_units(*arguments, **options)) as done:
        return {unit: future.result() for unit, future in done}


@needs_proc
@pytest.mark.slow
def test_a_process_that_dies_is_replaced(tmp_path):
    done = results(dies_once, [(tmp_path, n) for n in range(5)], Workers(2))
    assert sorted(done.values()) == list(range(5))
    assert (tmp_path / "mark").exists()
    assert not descendants(os.getpid())


@needs_proc
@pytest.mark.slow
def test_an_error_reaches_the_caller_and_ends_the_other_workers(tmp_path):
    with pytest.raises(InvalidInputError, match="enough"):
        results(waits, [tmp_path] * 2, Workers(2))
    pids = [int(file.name) for file in tmp_path.iterdir() if file.name.isdigit()]
    assert len(pids) == 2
    assert wait_for(lambda: not any(map(alive, pids)), 30.0)


def test_workers_are_checked():
    assert Workers().here
    assert not Workers(2).here
    assert not FAR.here
    for number in (0, 1001, 10**23):
        with pytest.raises(InvalidInputError, match=f"workers: expected a whole number from 1 to 1000, got {number}"):
            Workers(number)
    with pytest.raises(UnknownNameError, match=r"There is no cluster 'rya'\. Did you mean 'ray'\? Available: ray\."):
        Workers(cluster="rya")


def test_without_ray_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match=r'pip install "ikgym\[cluster\]"'):
        FAR.check()


def test_fewer_cores(monkeypatch):
    monkeypatch.setattr(threads, "_limit", None)
    everything = threads.count_cores()
    threads.limit_cores(1)
    assert threads.count_cores() == 1
    threads.limit_cores(None)
    assert threads.count_cores() == everything


@needs_proc
@pytest.mark.slow
def test_workers_of_a_command_end_with_it():
    line = [sys.executable, "-m", "baselines.cli", *EVALUATE, "--workers", "2"]
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as parent:
        try:
            assert wait_for(lambda: len(descendants(parent.pid)) == 2, 60.0)
            workers = descendants(parent.pid)
            time.sleep(4.0)  # they have loaded what they need, and are at work
            assert all(map(alive, workers))
        finally:
            parent.kill()
        assert wait_for(lambda: not any(map(alive, workers)), 30.0)
