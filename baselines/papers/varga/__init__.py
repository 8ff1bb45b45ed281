"""Varga, Issa, Horváth and Tar 2021: the receding horizon without Lagrange multipliers."""

from __future__ import annotations

from baselines.papers.paper import Paper, claims_of
from baselines.papers.varga import claims
from baselines.papers.varga.figures import FIGURES

PAPER = Paper(
    "varga",
    "Varga, Issa, Horváth, Tar 2021: receding horizon without Lagrange multipliers",
    FIGURES,
    claims_of(claims),
)
