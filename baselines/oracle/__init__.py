"""The oracle: the cheapest joint path of a whole episode that is known.

>>> from baselines.oracle import Search, solve
>>> optimum = solve("varga7-fast", how=Search(starts=100))

The cost is exactly the environment's, its optimum is sought from many starts, and nobody certifies that there is no
cheaper path: it is the best known one. What a cost ratio is stated against lies in `baselines/data/best_known.json`,
and ``python -m baselines.optimum --update`` brings that up to date.
"""

from __future__ import annotations

from baselines.oracle.cache import solve
from baselines.oracle.optimum import Optimum, Search, Start

__all__ = ["Optimum", "Search", "Start", "solve"]
