"""The search for settings of solvers by Optuna: ``ikgym tune``."""

from __future__ import annotations

from baselines.tuning.search import SPLIT, Search, run, searches

__all__ = ("SPLIT", "Search", "run", "searches")
