"""Faitli and Tar 2018: inverse kinematics by a quasi-differential fixed-point transformation."""

from __future__ import annotations

from baselines.papers.faitli import claims
from baselines.papers.faitli.figures import FIGURES
from baselines.papers.paper import Paper, claims_of

PAPER = Paper(
    "faitli",
    "Faitli, Tar 2018: quasi-differential fixed-point transformation",
    FIGURES,
    claims_of(claims),
)
