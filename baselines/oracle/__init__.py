"""The oracle: the cheapest joint path of a whole episode that is known.

>>> from baselines.oracle import Search, solve
>>> optimum = solve("varga7-fast", how=Search(starts=100))

The cost is exactly the environment's, its optimum is sought from many starts, and nobody certifies that there is no
cheaper path: it is the best known one. Cost ratios are stated against `baselines/data/best_known.json`, which
``ikgym oracle --update`` brings up to date.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from baselines.oracle.cache import solve
    from baselines.oracle.optimum import Optimum, Search, Start

__all__ = ["Optimum", "Search", "Start", "solve"]


def __getattr__(name: str) -> Any:
    """The public names, imported when first used: best known costs are looked up without the solvers of a search."""
    if name in __all__:
        return getattr(importlib.import_module(f"{__name__}.{'cache' if name == 'solve' else 'optimum'}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
