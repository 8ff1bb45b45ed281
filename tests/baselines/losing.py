"""A cluster that is this process, and whose workers die where a test says so."""

import contextlib
import itertools

from baselines import workers


class LosingCluster:
    """Does units one after the other, in this process.

    Args:
        lost: Numbers of attempts at which the worker dies, in the order of the attempts.
    """

    def __init__(self, monkeypatch, lost=()):
        self.lost, self.units = set(lost), []
        self._numbers = itertools.count()
        monkeypatch.setattr(workers, "connect", lambda: None)
        monkeypatch.setattr(workers, "_tasks", lambda: contextlib.nullcontext(self._call))
        monkeypatch.setattr(workers, "MOST", 1)

    def _call(self, function, unit):
        self.units.append(unit)
        if next(self._numbers) in self.lost:
            raise workers.LostError("its node was lost")
        return function(unit)
