"""Who is evaluated: solvers, and whatever has the `predict` of Stable-Baselines3."""

from __future__ import annotations

from baselines.evaluation.entrants.base import Entrant
from baselines.evaluation.entrants.foreign import ForeignPolicy, Predictor, Wrap, play_wrapped
from baselines.evaluation.entrants.parse import ALL, AnyPolicy, check_sendable, entrant, entrants

__all__ = [
    "ALL",
    "AnyPolicy",
    "Entrant",
    "ForeignPolicy",
    "Predictor",
    "Wrap",
    "check_sendable",
    "entrant",
    "entrants",
    "play_wrapped",
]
