"""Workers that are threads of this process, and are lost where a test says so."""

from __future__ import annotations

import itertools
from concurrent.futures import Future

from baselines.workers import Pool, Workers
from baselines.workers.pool import LostError, answer


class LosingPool(Pool):
    """Does units at once, but for those of a number, whose worker is lost; counted in the order of their submission."""

    def __init__(self, lost=()):
        self.lost, self.closed, self.units = set(lost), False, []
        self._numbers = itertools.count()

    def submit(self, function, unit, report):
        self.units.append(unit)
        future = Future()
        if next(self._numbers) in self.lost:
            future.set_exception(LostError("its node was lost"))
        else:
            future.set_result(answer(function, unit, report))
        return future

    def close(self):
        self.closed = True


def instead(monkeypatch, pool):
    """Has a pool stand for the workers of any cluster."""
    monkeypatch.setattr(Workers, "check", lambda self: None)
    monkeypatch.setattr(Workers, "pool", lambda self, units: pool)
    return pool
