"""Units and their workers: what is lost is done again, what fails reaches the user."""

from __future__ import annotations

import os
import signal
import sys

import pytest

from baselines import workers
from baselines.workers import LostError, Workers, finished
from baselines.workers.processes import Processes
from ikgym import parallel
from ikgym.exceptions import InvalidInputError, MissingDependencyError, UnknownNameError
from tests.baselines.workers.losing import LosingPool


def square(unit, report):
    report(f"at {unit}")
    if unit < 0:
        raise InvalidInputError(f"expected at least 0, got {unit}")
    return unit * unit


def dies_once(unit, report):
    """Is killed at the unit 1 unless a file is there that it makes before."""
    folder, number = unit
    mark = folder / "mark"
    if number == 1 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_lost_worker_costs_its_unit_alone(caplog):
    with LosingPool(lost=[1, 4]) as pool:
        done = dict(finished(pool, square, range(4)))
    assert done == {0: 0, 1: 1, 2: 4, 3: 9}
    assert pool.units == [0, 1, 2, 3, 1, 1]
    assert pool.closed
    assert caplog.text.count("its unit is done again") == 2


def test_what_is_lost_again_and_again_is_said_to_be():
    done = dict(finished(LosingPool(lost=[1, 3, 4]), square, range(3)))
    assert isinstance(done.pop(1), LostError)
    assert done == {0: 0, 2: 4}


def test_a_unit_may_change_before_it_is_tried_again():
    assert list(finished(LosingPool(lost=[0]), square, [3], again=lambda unit: unit + 1)) == [(4, 16)]


def test_errors_and_reports_come_home():
    said = []
    with pytest.raises(InvalidInputError, match="expected at least 0, got -1") as caught:
        list(finished(LosingPool(), square, [2, -1], report=lambda unit, what: said.append((unit, what))))
    assert said == [(2, "at 2"), (-1, "at -1")]
    assert "In a worker:" in caught.value.__notes__[0]


@pytest.mark.slow
def test_a_process_that_dies_is_replaced(tmp_path):
    with Processes(2) as pool:
        done = {unit[1]: result for unit, result in finished(pool, dies_once, [(tmp_path, n) for n in range(5)])}
    assert done == {n: n for n in range(5)}
    assert (tmp_path / "mark").exists()


def test_who_works():
    assert Workers().here
    assert not Workers(2).here
    assert not Workers(cluster="ray").here
    with pytest.raises(InvalidInputError, match="workers: expected a whole number of at least 1, got 0"):
        Workers(0)
    with pytest.raises(UnknownNameError, match=r"There is no cluster 'rya'\. Did you mean 'ray'\? Available: ray\."):
        Workers(cluster="rya")


def test_without_ray_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    monkeypatch.delitem(sys.modules, "baselines.workers.ray_cluster", raising=False)
    monkeypatch.delattr(workers, "ray_cluster", raising=False)  # as the package has it once it was imported
    with pytest.raises(MissingDependencyError, match=r'pip install "ikgym\[cluster\]"'):
        Workers(cluster="ray").check()


def test_fewer_cores(monkeypatch):
    monkeypatch.setattr(parallel, "_limit", None)
    everything = parallel.cores()
    parallel.limit(1)
    assert parallel.cores() == 1
    parallel.limit(None)
    assert parallel.cores() == everything
