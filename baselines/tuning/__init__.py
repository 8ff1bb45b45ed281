"""The search for settings of solvers by Optuna: ``ikgym tune``."""

from __future__ import annotations

from baselines.tuning.search import SPLIT, Search, searches
from baselines.tuning.trials import run

__all__ = ("SPLIT", "Search", "run", "searches")
